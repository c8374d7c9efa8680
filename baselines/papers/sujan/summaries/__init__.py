"""Missions that share summaries of maps, beside Rocha04's batches of measurements, at equal bits (ours)."""

"""The planner without the simulator: map and poses in, the next goal of a robot out."""

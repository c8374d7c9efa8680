"""What the commands share: arguments, progress, outputs of missions, options of worlds."""

"""What a robot does: it senses, moves and talks."""

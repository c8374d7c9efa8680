"""Short beginnings for trainers that are not ours; docs/training.md shows them."""

"""What lies where a plan was never measured: a small network's probability that cells are solid."""

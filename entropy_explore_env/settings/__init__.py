"""Settings of a scenario and of its parts, frozen and checked once: a dataclass a file."""

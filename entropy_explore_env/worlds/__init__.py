"""The truth: worlds, made from recipes or read from files."""

"""The node that explores with Nav2."""

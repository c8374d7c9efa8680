"""Worlds that others have published, by name: their table, and how their files are fetched."""

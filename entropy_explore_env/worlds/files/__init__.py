"""Worlds from files that people have, one format a file; each is read in a process of its own."""

"""Experiments: trials run by worker processes, resumable, one table each; statistics, claims and pages."""

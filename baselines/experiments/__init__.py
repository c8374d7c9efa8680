"""Experiments: missions in cells, run by worker processes, resumable; statistics, claims and tables."""

import time

PROCESS_STARTED_NS = time.time_ns()
"""About when this process began to import its code: it does not run what was edited later."""

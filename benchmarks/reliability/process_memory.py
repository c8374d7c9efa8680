"""What this process holds of the machine's memory, in MiB."""

from __future__ import annotations

import math
import os
import resource
from pathlib import Path


def resident_mib() -> float:
    """Resident memory now; nan where the system does not say."""
    try:
        pages = int(Path("/proc/self/statm").read_text("ascii").split()[1])
    except OSError:
        return math.nan
    return pages * os.sysconf("SC_PAGE_SIZE") / 2**20


def peak_mib() -> float:
    """The most resident memory that this process ever held."""
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024

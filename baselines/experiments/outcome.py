"""What the work of an experiment comes to."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

Record = dict[str, Any]
"""What is kept of a mission, or of any other work of an experiment; JSON."""


class Outcome(NamedTuple):
    """A record, and arrays that are kept beside it, if there are any."""

    record: Record
    arrays: dict[str, np.ndarray] | None = None

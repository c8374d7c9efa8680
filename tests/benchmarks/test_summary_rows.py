"""The rows of summaries are measured, of a plan of which a part is known."""

from __future__ import annotations

import numpy as np

from benchmarks.rows import Effort
from benchmarks.summaries import CELLS, known_plan, summary_rows


def test_the_plan_is_known_in_part_and_better_near_scans():
    mean, precision = known_plan()
    assert mean.shape == precision.shape == (CELLS, CELLS, 1)
    known = precision > 0.0
    assert 0.8 < known.mean() < 1.0 and set(np.unique(mean)) == {0.0, 1.0}
    assert 0.1 < mean.mean() < 0.5
    assert precision[known].min() >= (0.08 + 0.006 * 8.0) ** -2 * (1.0 - 1e-6)


def test_rows_are_measured():
    encode, decode = summary_rows(Effort(rounds=1))
    assert encode.unit == decode.unit == "ms" and encode.goal == "≤ 30 ms" and decode.goal is None
    assert encode.ours > 0.0 and decode.ours > 0.0 and "1000 × 1000" in encode.job

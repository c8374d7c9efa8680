"""Runs a suite: first the tasks that it pins, then those that depend on what the first ones came to."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path

from baselines.experiments.rows import Row
from baselines.experiments.trials import Cell, CellTrial, How, run_trials
from baselines.suites.public_worlds import fetch_worlds
from baselines.suites.results import by_seed
from baselines.suites.suite import Suite


def run_suite(
    suite: Suite,
    table: Path,
    how: How,
    known: Sequence[Row] = (),
    trial_of: Callable[[Cell, int], CellTrial] = CellTrial,
) -> list[Row | None]:
    """Run what is missing of a suite; see `run_trials`.

    Args:
        suite: Without its later tasks.
        table: The file of rows.
        how: Where and how long.
        known: Rows from elsewhere.
        trial_of: Makes a trial of a cell and a seed.

    Returns:
        The row of each mission; None where the time was up.

    Raises:
        WorldError: A public world cannot be fetched: no mission is run.
    """
    began_s = time.monotonic()
    fetch_worlds(cell.scenario for cell in suite.cells)
    found = run_trials([trial_of(trial.point, trial.seed) for trial in suite.trials], table, how, known)
    if suite.later is None:
        return found
    first = {cell.id for cell in suite.cells}
    completed = suite.completed(by_seed(row for row in found if row is not None))
    later = [trial_of(each.point, each.seed) for each in completed.trials if each.cell not in first]
    left_s = max(how.stop_after_s - (time.monotonic() - began_s), 0.0)
    return found + run_trials(later, table, replace(how, stop_after_s=left_s), known)

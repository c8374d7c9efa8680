"""Sujan's cliff: cells, what is recorded, claims, samples of fig. 7, page."""

from __future__ import annotations

import numpy as np
import pytest

from baselines.experiments.trials import CellTrial
from baselines.papers.sujan import cliff, cliff_figures, cliff_mission
from baselines.papers.sujan.cliff import EXPERIMENT, all_claims
from baselines.papers.sujan.cliff_figures import samples
from baselines.papers.sujan.cliff_mission import (
    LOOKS,
    STEPS,
    cell_id,
    looks_of,
    new_columns,
    steps_needed,
)
from entropy_explore_env.belief.elevation import completed
from tests.baselines.papers.pages import cells_of, run_paper


def test_a_mission_records_its_columns_scan_by_scan(monkeypatch):
    monkeypatch.setattr(cliff, "STEPS", 5)
    cell = cells_of(EXPERIMENT, 1)[cell_id(5)]
    record = CellTrial(cell, 0).run()
    columns = record["columns"]
    assert len(columns) == record["scans"] + 1 and columns[0] == 0 and columns[-1] > columns[LOOKS] > 100
    assert len(record["interest_readable"]) == len(record["interest_unreadable"]) == len(columns)
    assert len(record["expected"]) == len(record["obtained"]) and record["edge_stops"] == 0
    assert 0.0 < record["interest_readable"][-1] < 1.0


def record_of(steps, expected=(100.0, 50.0), obtained=(80, 40), interest=(0.5, 1.0), edge_stops=0):
    """A record that maps so many new columns in each step, for ever, after 100 in the first looks."""
    columns = [0, 40, 60, 80, 100, *(100 + steps * n for n in range(1, STEPS + 1))]
    return {
        "columns": columns,
        "expected": list(expected),
        "obtained": list(obtained),
        "interest_unreadable": [interest[0]] * len(columns),
        "interest_readable": [interest[1]] * len(columns),
        "edge_stops": edge_stops,
    }


def test_claims_by_hand():
    """Method 5 maps ten times what 1 maps and twice what 3 maps."""
    speeds = {1: 1, 2: 2, 3: 5, 4: 6, 5: 10}
    records = {
        cell_id(method): [record_of(speed, obtained=(80, 40) if method == 5 else (40, 20)) for _ in range(3)]
        for method, speed in speeds.items()
    }
    assert new_columns(records, 3)[0, [0, 1, 20]].tolist() == [0, 5, 100]
    assert steps_needed(records).tolist() == [0.5] * 3
    assert looks_of(records, 3, "expected", 4)[0].tolist() == [100.0, 50.0, 0.0, 0.0]
    claims = {claim.id: claim for claim in all_claims(records)}
    assert all(claim.holds for claim in claims.values())
    assert claims["ten-10"].ours == pytest.approx(10.0) and claims["half"].ours == 0.5
    assert claims["answered"].ours == pytest.approx(2.0) and claims["interest-10"].ours == 0.5
    records[cell_id(2)][1] = record_of(2, obtained=(40, 20), edge_stops=2)
    records[cell_id(5)] = [record_of(6, interest=(1.0, 1.0)) for _ in range(3)]
    claims = {claim.id: claim for claim in all_claims(records)}
    held = {name for name, claim in claims.items() if claim.holds}
    assert held == {"more-3-1", "more-3-2", "more-4-3", "more-5-3", "answered"}
    assert claims["edge"].ours == 2


def test_both_samples_of_fig_7_are_completed():
    """Waves come back nearly; a step goes on as it was at the border of what is known, and falls off."""
    waves, step = samples()
    assert 0.4 < (~waves.known).mean() < 0.6 and 0.4 < (~step.known).mean() < 0.55
    assert waves.error_m[0] < 0.03 * np.ptp(waves.height_m)
    filled = completed(step.height_m, step.known)
    np.testing.assert_array_equal(filled[step.known], step.height_m[step.known])
    assert (np.diff(filled, axis=0) <= 1e-3).all() and 0.0 <= filled.min() and filled.max() <= 1.0
    first_unknown = int(step.known[0].sum())
    assert filled[5, first_unknown] > 0.95 and filled[-6, first_unknown] < 0.05


def test_the_command_writes_its_page_and_goes_on_where_it_was(tmp_path, capsys, monkeypatch):
    for module in (cliff, cliff_figures, cliff_mission):
        for short, steps in (("STEPS", 4), ("MORE", 3), ("FEW", 2)):
            monkeypatch.setattr(module, short, steps)
    monkeypatch.setattr(cliff_figures, "_SHOWN", ((1, 1), (3, 1), (5, 1)))
    ran = run_paper("sujan-cliff", tmp_path, capsys, "--seeds", "1")
    assert len(ran.claims) == 13 and "cliff-next-best-view" in ran.page
    rows = [
        line
        for line in ran.page.splitlines()
        if line.startswith("| method | fig. 29: new columns after 1 step")
    ]
    assert len(rows) == 1 and "fig. 31" in rows[0] and "fig. 32" in rows[0]

"""Golden missions end as they ended when they were recorded.

To renew them after a change of results run `python -m tests.golden.missions`, add its hash and a few words on
the change to RENEWALS.txt, and write the change into CHANGELOG.md.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from entropy_explore_env.reports.mission_record import load_record, same_end
from tests.golden.missions import (
    NAMES,
    RECORDS,
    content_hash,
    load_summary,
    run_again,
    summary_of,
    this_machine,
)

RENEWALS = Path(__file__).parent / "RENEWALS.txt"


def require_equal(what: str, ours: np.ndarray, theirs: np.ndarray) -> None:
    """Whole numbers exactly; floats to 1e-9 of the largest, float32 to their last bit but one."""
    assert (ours.dtype, ours.shape) == (theirs.dtype, theirs.shape), what
    if ours.dtype.kind != "f":
        np.testing.assert_array_equal(ours, theirs, what)
        return
    tolerance = max(1e-9, 2.0 * float(np.finfo(ours.dtype).eps))
    np.testing.assert_allclose(ours, theirs, rtol=tolerance, atol=tolerance, err_msg=what)


@pytest.mark.parametrize("name", NAMES)
def test_a_golden_mission_goes_as_it_went(name: str) -> None:
    """The strategy is run again; final beliefs are compared bit for bit where the machine promises that."""
    golden = load_record(RECORDS / f"{name}.npz")
    record, missions = run_again(golden)
    for field in ("commands", "scan_s", "scan_robot"):
        require_equal(field, getattr(record, field), getattr(golden, field))
    expected, machine = load_summary(name)
    found = summary_of(missions)
    assert list(found) == list(expected)
    for value in expected:
        require_equal(value, found[value], expected[value])
    if machine == this_machine():
        assert same_end(golden, missions), "floats are equal to 1e-9, but not bit for bit"


def test_golden_missions_are_telling() -> None:
    """They fly and drive, plan and go straight, lose, delay and repeat messages, wait, and mix teams."""
    records = [load_record(RECORDS / f"{name}.npz") for name in NAMES]
    scenarios = [record.scenario for record in records]
    assert len({record.strategy for record in records}) >= 8 and len({s.world for s in scenarios}) >= 7
    assert {s.robot.navigator for s in scenarios} == {"straight", "planned"}
    assert {s.robot.motion for s in scenarios} == {"free", "planar"}
    assert {s.grid.flat for s in scenarios} == {False, True}
    assert any(s.channel.loss_probability for s in scenarios) and any(s.channel.delay_s for s in scenarios)
    assert any(s.channel.phase_s for s in scenarios) and any(s.extra_kinds for s in scenarios)
    assert any(s.robot.when_blocked == "wait" for s in scenarios)
    assert any(s.sensor.range_noise_m for s in scenarios) and any(s.track_truth for s in scenarios)


def test_golden_files_change_only_with_a_line_of_their_own() -> None:
    renewed, _, words = RENEWALS.read_text("utf-8").strip().splitlines()[-1].partition(" ")
    assert renewed == content_hash() and words, "golden files were changed: see the top of this file"

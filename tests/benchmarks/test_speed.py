"""The speed table: its forms, its exit codes, and that it measures what it says."""

from __future__ import annotations

import json
import math
import sys
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from baselines.cli.arguments import run_command
from benchmarks import speed, startup, stepping
from benchmarks.fusion import Fusion, Measurements, fusion_row, measure_room
from benchmarks.rows import Effort, Goal, Row, Taken, alone, compared, interleave, timed
from entropy_explore_env.errors import SettingError
from entropy_explore_env.settings.grid import Grid
from entropy_explore_env.settings.scenarios import ROOM
from entropy_explore_env.settings.sensor import RangeSensor

TINY = Effort(scans=10, rounds=2, long_rounds=1, steps=4, missions=(1, 2), starts=1, large=False)
BOX = Grid((7, 11, 5), 0.5, (1.0, -2.0, 0.25))
FEW_RAYS = RangeSensor((math.pi / 6, math.pi / 12), math.pi / 36)
KEYS = ["job", "peer", "ours", "theirs", "unit", "ratio", "goal", "holds"]
HELD = Row("sums", "a peer", 3.0, 2.0, "sums/s", 1.5, "≥ 1 ×", True)
MISSED = Row("starts", None, 9.0, None, "s", None, "< 2 s", False)
FREE = Row("sums", "a peer", 1.0, 2.0, "sums/s", 0.5, None, None)


@pytest.fixture
def measured(monkeypatch: pytest.MonkeyPatch) -> Callable[..., None]:
    """Let the command find these rows instead of measuring."""

    def find(*rows: Row) -> None:
        monkeypatch.setattr(speed, "JOBS", {"sums": lambda effort: list(rows)})

    return find


def run(*words: str) -> int:
    return run_command(speed.main, words)


def test_json_is_one_object_with_machine_and_rows(measured, capsys):
    measured(HELD, MISSED, FREE)
    assert run("--json", "--quick") == 0
    out, err = capsys.readouterr()
    table = json.loads(out)
    assert list(table) == ["machine", "rows"]
    assert {"processor", "cores", "python", "packages", "command"} <= set(table["machine"])
    assert table["machine"]["command"] == "python -m benchmarks.speed --json --quick"
    assert [list(row) for row in table["rows"]] == [KEYS] * 3
    assert [row["holds"] for row in table["rows"]] == [True, False, None]
    assert table["rows"][1]["goal"] == "< 2 s" and table["rows"][1]["theirs"] is None
    assert "[1/1] sums" in err


def test_out_writes_the_page(measured, capsys, tmp_path: Path):
    measured(HELD, MISSED, FREE)
    page = tmp_path / "speed.md"
    assert run("--json", "--out", str(page)) == 0
    text = page.read_text()
    assert f"`python -m benchmarks.speed --json --out {page}`" in text
    assert "| sums | 3 sums/s | a peer | 2 sums/s | 1.5 × | ≥ 1 × | yes |" in text
    assert "| starts | 9 s | – | – | – | < 2 s | no |" in text
    assert "| sums | 1 sums/s | a peer | 2 sums/s | 0.5 × | – | – |" in text
    assert "Python" in text and list(tmp_path.iterdir()) == [page]


@pytest.mark.parametrize(
    ("module", "package"), [("octomap", "octomap-python"), ("mpe2.simple_spread_v3", "mpe2")]
)
def test_missing_peer_names_the_extra(measured, capsys, monkeypatch, module, package):
    measured(HELD)
    monkeypatch.setitem(sys.modules, module, None)
    assert run("--json") == 2
    out, err = capsys.readouterr()
    assert out == "" and err.count("\n") == 1
    assert package in err and "entropy_explore_env[bench]" in err


def test_ratio_is_the_median_of_the_rounds_ratios():
    row = compared("job", "peer", [10.0, 4.0, 6.0], [5.0, 1.0, 6.0], "steps/s", Goal("≥", 2.0))
    assert (row.ours, row.theirs, row.ratio, row.holds) == (6.0, 5.0, 2.0, True)
    assert compared("job", "peer", [1.0], [2.0], "ns").holds is None
    row = alone("job", [3.0, 1.0, 2.0], "s", Goal("<", 2.0, "s"))
    assert (row.ours, row.theirs, row.ratio, row.goal, row.holds) == (2.0, None, None, "< 2 s", False)


@pytest.mark.parametrize(
    ("sign", "below", "at", "above"),
    [
        ("≥", False, True, True),
        ("≤", True, True, False),
        ("<", True, False, False),
        ("=", False, True, False),
    ],
)
def test_goals(sign, below, at, above):
    goal = Goal(sign, 1.15)
    assert goal.text == f"{sign} 1.15 ×"
    assert [goal.holds(value) for value in (1.0, 1.15, 2.0)] == [below, at, above]


def test_jobs_take_turns():
    turns: list[tuple[str, int]] = []

    def job(name: str) -> Callable[[int], Taken]:
        return lambda number: timed(lambda: turns.append((name, number)))

    taken = interleave({"ours": job("ours"), "theirs": job("theirs")}, 2)
    assert turns == [("ours", 0), ("theirs", 0), ("ours", 1), ("theirs", 1)]
    assert all(t.wall_s >= 0.0 and t.cpu_s >= 0.0 for t in taken["ours"]) and len(taken["theirs"]) == 2


def test_end_points_lie_on_the_walls():
    measurements = measure_room(BOX, FEW_RAYS, 5)
    assert measurements.ends_m.shape == (5, 7 * 4, 3)
    low, high = np.asarray(BOX.origin_m), np.asarray(BOX.origin_m) + BOX.size_m
    assert ((measurements.positions_m > low) & (measurements.positions_m < high)).all()
    to_wall = np.minimum(measurements.ends_m - low, high - measurements.ends_m)
    np.testing.assert_allclose(to_wall.min(axis=-1), 0.0, atol=1e-9)


def test_fusion_crosses_the_voxels_of_a_straight_ray():
    """A level ray along y from the middle of voxel (2, 3, 1) to that of (2, 8, 1), one behind it."""
    start = np.asarray(BOX.origin_m) + 0.5 * np.array([2.5, 3.5, 1.5])
    measurements = Measurements(start[None], (start + np.array([0.0, 2.5, 0.0]))[None, None])
    fusion = Fusion(BOX, RangeSensor((0.0, 0.0), 0.1), measurements)
    raised = np.flatnonzero(fusion.belief.precision > ROOM.sigma_prior**-2 * 1.01)
    assert [tuple(int(i) for i in np.unravel_index(v, BOX.shape)) for v in raised] == [
        (2, y, 1) for y in range(3, 10)
    ]
    mean = fusion.belief.mean.reshape(BOX.shape)
    assert mean[2, 4, 1] < 1e-3 < mean[2, 9, 1]


def test_the_row_of_a_grid_is_measured():
    row = fusion_row(BOX, TINY)
    assert row.unit == "rays/s" and row.goal == "≥ 5 ×" and row.ours > 0 and row.theirs


def test_steps_are_measured_with_full_bursts(monkeypatch):
    monkeypatch.setattr(stepping, "LOOPED", 2)
    (row,) = stepping.step_rows(TINY)
    assert row.goal == "≥ 2 ×" and row.peer == "mpe2 simple_spread_v3, N = 4"
    assert row.ours > 0 and row.theirs
    rows = stepping.vector_rows(TINY)
    assert [row.goal for row in rows] == [None, "≥ 1.15 ×", "≥ 1.15 ×", "≥ 1.7 ×"]
    assert all(row.ours > 0 and row.theirs for row in rows)


def test_bursts_that_are_not_full_are_no_measurement():
    (env,) = stepping.Team(stepping.TURNING).envs
    env.reset(seed=0)
    robots = env.missions.state.robots
    with pytest.raises(RuntimeError, match="bursts of 64"):
        stepping.check_bursts(robots, 64)
    robots["scans"], robots["measurements_sent"] = 10, 630
    with pytest.raises(RuntimeError, match="2520 measurements sent in 40 scans"):
        stepping.check_bursts(robots, 64)
    robots["measurements_sent"] = 640
    stepping.check_bursts(robots, 64)


def test_first_step_of_a_fresh_process(monkeypatch):
    assert startup.first_step() > 0.0
    monkeypatch.setattr(startup, "_FIRST_STEP", "raise ValueError('no such room')")
    with pytest.raises(RuntimeError, match="no such room"):
        startup.first_step()


def test_only_what_is_asked_for_is_measured(monkeypatch, capsys):
    jobs = {
        "sums of many": lambda effort: [HELD],
        "products": lambda effort: pytest.fail("not asked for"),
    }
    monkeypatch.setattr(speed, "JOBS", jobs)
    assert speed.main(["--only", "many", "--json"]) == 0
    assert [row["job"] for row in json.loads(capsys.readouterr().out)["rows"]] == [HELD.job]
    with pytest.raises(SettingError, match="sums of many; products"):
        speed.main(["--only", "quotients"])

"""`python -m baselines.run`: what it prints and writes, and how it ends."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

from baselines import replay
from baselines.cli.arguments import run_command
from baselines.cli.progress import standing_still
from baselines.experiments.mission import run_mission, scripted
from baselines.strategies import ALIASES, STRATEGIES, make_strategy
from entropy_explore_env.envs.parallel_env import EntropyExploreEnv
from entropy_explore_env.reports.metrics import mission_figures
from entropy_explore_env.reports.mission_record import load_record
from entropy_explore_env.settings.changes import with_settings
from entropy_explore_env.settings.scenarios import BOX
from tests.baselines.ran import FILES, SHORT, without_clock
from tests.systems import needs_posix

ROOT = Path(__file__).parents[2]


# --- results


def test_json_is_one_object_with_every_key_and_the_mission_s_own_figures(figures):
    printed = figures("--strategy", "random", "--seed", "4")
    env = EntropyExploreEnv(with_settings(scripted(BOX), {"track_truth": True}))
    run_mission(env, make_strategy("random"), 4)
    expected = {"strategy": "random", **mission_figures(env.missions, 0, floor=True)}
    assert without_clock(printed) == json.loads(json.dumps(expected))
    assert (printed["scenario"], printed["robots"], printed["seed"]) == ("box-7x11x5", 2, 4)
    assert printed["finished"] and printed["end_reason"] == "MAPPED"
    assert printed["entropy_end_bits"] <= printed["entropy_threshold_bits"] < printed["entropy_start_bits"]
    assert 0 < printed["shared_measurements"] < printed["measurements"] <= 28 * printed["scans"]
    assert 0.0 < printed["wall_s"] < 60.0


@pytest.mark.parametrize("name", ALIASES)
def test_an_alias_runs_what_it_stands_for_and_says_so(figures, name):
    printed = figures("--strategy", name, *SHORT)
    assert printed["strategy"] == ALIASES[name] in STRATEGIES
    assert without_clock(printed) == without_clock(figures("--strategy", ALIASES[name], *SHORT))


def test_the_table_warns_of_robots_that_have_hardly_moved():
    def of(finished, *robots, scans=2262):
        rows = [{"distance_m": m, "blocked_moves": blocked, "scans": scans} for m, blocked in robots]
        return standing_still({"finished": finished, "per_robot": rows}, 1.0)

    (warning,) = of(True, (3.0, 9), (0.2, 810), (0.0, 0))
    assert warning == "warning: robot 1 has hardly moved: 0.2 m in 2,262 scans, 810 moves blocked"
    assert len(of(False, (0.0, 0), (0.3, 0), (1.3, 0))) == 2
    assert of(False, (0.0, 0), scans=9) == []


def test_team_strategy_and_ending_can_be_said(figures):
    three = figures("--robots", "3", "--strategy", "random", *SHORT)
    assert three["robots"] == len(three["per_robot"]) == 3
    assert (three["finished"], three["end_reason"], three["t_mission_s"]) == (False, "TIME_UP", 8.0)
    assert three["entropy_end_bits"] > three["entropy_threshold_bits"]
    assert without_clock(three) != without_clock(figures("--robots", "3", *SHORT))


def test_a_table_for_people_and_progress_on_standard_error_only(command, monkeypatch):
    monkeypatch.setenv("FORCE_COLOR", "1")
    monkeypatch.setenv("TERM", "xterm")
    monkeypatch.setenv("COLUMNS", "120")
    ran = command("box-7x11x5", *SHORT)
    assert ran.code == 0
    assert "box-7x11x5, gradient, 2 robots, seed 0" in ran.out and "scans" in ran.out and "TIME_UP" in ran.out
    assert "entropy left" in ran.err and "entropy left" not in ran.out
    assert "simulated" in ran.err and "shared" in ran.err


def test_the_table_leaves_out_what_means_nothing(command):
    """Sharing, where there is one robot; how many scans more than for a whole map, where there is none."""
    team, alone = ("shared measurements", "bits sent", "imbalance between robots"), ("--robots", "1")
    short, whole, single = (command("box-7x11x5", *words).out for words in (SHORT, (), alone))
    assert all(label in whole and label not in single for label in team)
    assert "scans over the floor" in whole and "scans over the floor" not in short


# --- as a process


def _heed_interrupts() -> None:
    signal.signal(signal.SIGINT, signal.SIG_DFL)


def process(*words: str, **environment: str) -> subprocess.Popen[str]:
    """A process that heeds Ctrl-C, also where the tests run in the background, which ignores it."""
    return subprocess.Popen(
        [sys.executable, "-m", "baselines.run", *words],
        preexec_fn=_heed_interrupts if os.name == "posix" else None,
        cwd=ROOT,
        env={**os.environ, **environment},
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )


def test_as_a_process_it_prints_the_same_object(figures):
    with process("box-7x11x5", "--seed", "1", "--json") as started:
        out, err = started.communicate(timeout=300)
    assert (started.returncode, err) == (0, "")
    assert without_clock(json.loads(out)) == without_clock(figures("--seed", "1"))


ENDLESS = ("--ending.sigma-end", "0.0002", "--ending.time-limit-s", "inf")


@needs_posix
def test_an_interrupted_process_writes_what_was_done_and_ends_with_130(tmp_path):
    """The mission would go on for hours; it is interrupted as soon as its progress bar is seen."""
    words = ("box-7x11x5", *ENDLESS, "--out", str(tmp_path))
    with process(*words, FORCE_COLOR="1", TERM="xterm") as started:
        assert started.stderr is not None
        shown = started.stderr.read(40)
        time.sleep(0.3)
        started.send_signal(signal.SIGINT)
        try:
            out, err = started.communicate(timeout=60)
        finally:
            started.kill()
    assert started.returncode == 130 and "Traceback" not in shown + err
    figures = json.loads((tmp_path / "mission.json").read_text())
    assert figures["end_reason"] == "RUNNING" and "RUNNING" in out
    assert figures["t_mission_s"] > 0.0 and not figures["finished"]
    assert err.endswith(f"interrupted after {figures['t_mission_s']:,.1f} s of the mission\n")
    assert sorted(path.name for path in tmp_path.iterdir()) == FILES
    assert run_command(replay.main, [str(tmp_path / "mission.npz"), "--json"]) == 0  # the same end, again
    results = load_record(tmp_path / "mission.npz").results
    assert results["time_s"][-1] == figures["t_mission_s"] and len(results["poses"]) == len(results["time_s"])
    assert (results["joint_precision"] > 0.0).all() and figures["ended_by"] == []

"""`python -m baselines.benchmark`: rows, page, failures; whatever was killed ends with the same bytes."""

from __future__ import annotations

import json
import re
import signal
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from baselines import benchmark, strategies
from baselines.benchmark import chosen_strategies
from baselines.cli.arguments import run_command
from baselines.experiments import trials
from baselines.experiments.mission import rounded, run_mission, scripted
from baselines.experiments.rows import read_table
from baselines.strategies import make_strategy
from baselines.strategies.rules.random_walk import RandomWalk
from baselines.suites import find_suite
from benchmarks.proofs.kills import contents
from entropy_explore_env.envs.parallel_env import EntropyExploreEnv
from entropy_explore_env.reports.metrics import mission_figures
from entropy_explore_env.settings.changes import with_settings
from entropy_explore_env.settings.json import settings_of
from entropy_explore_env.settings.scenarios import BOX, SCENARIOS

ROOT = Path(__file__).parents[2]
TINY = ("--scenarios", "box-7x11x5", "--robots", "1,2", "--time-limit-s", "150")
PAIR = (*TINY, "--strategies", "gradient", "--seeds", "6", "--jobs", "1")


def archive_in(folder: Path) -> Path:
    return folder / "own" / "own.jsonl.xz"


@pytest.fixture(scope="module")
def pair(tmp_path_factory):
    """A small experiment as a user runs it, in a process of its own."""
    folder = tmp_path_factory.mktemp("pair")
    words = [sys.executable, "-m", "baselines.benchmark", *PAIR, "--out", str(folder)]
    ran = subprocess.run(words, cwd=ROOT, capture_output=True, text=True, check=True)
    return folder, ran


# --- what a user gets


def test_the_command_leaves_a_page_a_figure_and_an_archive(pair):
    folder, ran = pair
    assert "over random's" in ran.stdout and "gradient" in ran.stdout
    assert "24/24" in ran.stderr and "own.md" in ran.stderr
    assert set(contents(folder)) == {"own.md", "own/own.jsonl.xz", "own/tasks.png"}
    rows = read_table(archive_in(folder))
    assert [(row.cell, row.seed) for row in rows] == sorted(
        (f"box-7x11x5-{robots}/{strategy}", seed)
        for robots in ("1-robot", "2-robots")
        for strategy in ("random", "gradient")
        for seed in range(6)
    )
    with Image.open(folder / "own" / "tasks.png") as picture:
        assert picture.width > 400 and len(np.unique(np.asarray(picture.convert("L")))) > 20


def test_the_page_says_what_made_it_and_every_row(pair):
    page = (pair[0] / "own.md").read_text()
    assert f"`python -m baselines.benchmark {' '.join(PAIR[:-2])}`" in page
    assert "**box-7x11x5, 1 robot**: " in page and "**box-7x11x5, 2 robots**: " in page
    assert page.count("time limit 150 s") == 2
    table = [line for line in page.splitlines() if line.startswith("| `")]
    assert len(table) == 6 and sum(line.startswith("| `gradient` |") for line in table) == 3
    assert "nan" not in page and "None" not in page and "failed" not in page
    assert "Rows: 24, of commit `" in page


def test_figures_are_those_of_the_missions(pair):
    env = EntropyExploreEnv(
        scripted(with_settings(BOX, {"track_truth": True, "time_limit_s": 150.0, "robots": 2}))
    )
    rows = {(row.cell, row.seed): row.record for row in read_table(archive_in(pair[0]))}
    for seed in (0, 5):
        run_mission(env, make_strategy("gradient"), seed)
        figures = rounded(mission_figures(env.missions, 0, floor=True))
        record = rows["box-7x11x5-2-robots/gradient", seed]
        assert record.pop("clock").keys() == {"decision_ms", "worst_decision_ms", "mission_s"}
        assert {name: figures[name] for name in record} == record and "joint" in record


def test_a_finished_experiment_says_the_same_again_without_a_mission(pair, capsys, monkeypatch):
    folder, _ = pair
    before = contents(folder)

    def nothing_to_do(_: object, tasks: list, *__: object) -> list:
        assert not tasks, "missions were run"
        return []

    monkeypatch.setattr(trials, "run_each", nothing_to_do)
    assert run_command(benchmark.main, [*PAIR, "--out", str(folder), "--json"]) == 0
    said = capsys.readouterr()
    results = json.loads(said.out, parse_constant=pytest.fail)
    assert said.err == "" and contents(folder) == before
    assert [len(results[name]) for name in ("overall", "tasks", "failed", "refused")] == [2, 4, 0, 0]


def test_another_run_begins_with_the_archive_of_the_first(pair, tmp_path, monkeypatch):
    """All of it: no mission is run. With a strategy more: only that one's are, and all are shown."""
    ran, real = [], trials.run_each

    def logged(do: object, tasks: list, *others: object):
        ran.extend(trial.cell for trial in tasks)
        return real(do, tasks, *others)

    monkeypatch.setattr(trials, "run_each", logged)
    words = ["--archive", str(archive_in(pair[0])), "--out", str(tmp_path / "same")]
    assert run_command(benchmark.main, [*PAIR, *words]) == 0
    assert ran == [] and contents(tmp_path / "same") == contents(pair[0])
    assert archive_in(tmp_path / "same").read_bytes() == archive_in(pair[0]).read_bytes()
    words = [*words[:2], "--out", str(tmp_path / "more"), "--seeds", "6", "--jobs", "1"]
    assert run_command(benchmark.main, [*TINY, *words, "--strategies", "mutual-information"]) == 0
    assert len(ran) == 12 and all(cell.endswith("/mutual-information") for cell in ran)
    page = (tmp_path / "more" / "own.md").read_text()
    assert all(f"| `{name}` | 2 | 12 |" in page for name in ("random", "gradient", "mutual-information"))


def test_an_archive_that_is_none_is_refused_and_nothing_is_written(pair, tmp_path, capsys):
    cut, other = tmp_path / "cut.jsonl.xz", tmp_path / "other.jsonl"
    cut.write_bytes(archive_in(pair[0]).read_bytes()[:-40])
    other.write_text('{"table": 99}\n')
    for archive in (cut, other, tmp_path / "nowhere.xz"):
        words = [*PAIR, "--archive", str(archive), "--out", str(tmp_path / "out")]
        assert run_command(benchmark.main, words) == 2
        said = capsys.readouterr().err
        assert said.startswith("error: ") and str(archive) in said and said.count("\n") == 1
        assert not (tmp_path / "out").exists()


# --- missions that fail


class Raises(RandomWalk):
    """In the middle of some missions."""

    def choose(self, view):
        if view.time_s > 5.0 and len(view.scenario.agents) == 2:
            raise ValueError("no | way\nat <all>")
        return super().choose(view)


class Sleeps(RandomWalk):
    """Chooses so long that the alarm rings, as far as the alarm can tell."""

    def choose(self, view):
        signal.raise_signal(signal.SIGALRM)
        return super().choose(view)


@pytest.fixture
def entered(monkeypatch):
    """Two strategies that fail, beside the random walk."""
    named = {"random": RandomWalk, "raises": Raises, "sleeps": Sleeps}
    monkeypatch.setattr(strategies, "STRATEGIES", named)
    monkeypatch.setattr(benchmark, "STRATEGIES", named)


FAILING = (*TINY, "--seeds", "2", "--jobs", "1", "--wall-limit-s", "600")


def test_a_mission_that_fails_is_a_row_with_its_reason(entered, tmp_path, capsys):
    assert run_command(benchmark.main, [*FAILING, "--out", str(tmp_path)]) == 0
    said = capsys.readouterr()
    assert "failed: sleeps, box-7x11x5, 1 robot, missions 0, 1: ran past 600 s on the clock" in said.out
    assert re.search(r"failed: raises, .*at <all> \(test_benchmark\.py, line \d+\)\n", said.out)
    page = (tmp_path / "own.md").read_text()
    failed = page.split("## Missions that failed")[1]
    assert r"| `raises` | box-7x11x5, 2 robots: 0, 1 | ValueError: no \| way at \<all\> |" in failed
    both = "box-7x11x5, 1 robot: 0, 1; box-7x11x5, 2 robots: 0, 1"
    assert f"| `sleeps` | {both} | ran past 600 s on the clock |" in failed
    assert "| `raises` | 0 of 2 |" in page and "| `raises` | 0 of 2, 2 failed |" in page
    words = [*FAILING, "--out", str(tmp_path), "--stop-after-s", "0", "--json"]
    assert run_command(benchmark.main, words) == 0
    results = json.loads(capsys.readouterr().out)
    assert [row["failed"] for row in results["tasks"]] == [0, 0, 2, 0, 2, 2]
    slept = next(row for row in results["tasks"] if row["strategy"] == "sleeps")
    assert (slept["failed"], slept["finished"], slept["time_s_end"][0]) == (2, 0, 150.0)
    overall = {row["strategy"]: row for row in results["overall"]}
    assert (overall["sleeps"]["tasks"], overall["sleeps"]["time_s_end_ratio"]) == (0, None)
    assert overall["raises"]["tasks"] == 1


def test_a_strategy_that_never_gets_through_ends_the_command_with_an_error(entered, tmp_path, capsys):
    words = [*TINY, "--robots", "2", "--seeds", "1", "--jobs", "1", "--strategies", "raises"]
    assert run_command(benchmark.main, [*words, "--out", str(tmp_path)]) == 1
    assert capsys.readouterr().err.endswith("error: every mission of raises raised an error\n")


def test_a_world_without_room_for_the_team_is_a_row_for_all(tmp_path, capsys):
    words = ["--scenarios", "box-7x11x5", "--robots", "1,900", "--seeds", "1", "--jobs", "1"]
    words += ["--strategies", "random", "--time-limit-s", "20", "--out", str(tmp_path), "--json"]
    assert run_command(benchmark.main, words) == 0
    failed = json.loads(capsys.readouterr().out)["failed"]
    assert len(failed) == 1 and failed[0]["task"] == "box-7x11x5, 900 robots"
    assert "WorldError" in failed[0]["reason"]


# --- what takes part


def test_the_reference_is_always_there_and_first():
    assert chosen_strategies("gradient,random") == ("random", "gradient")
    assert set(chosen_strategies("all")) == set(chosen_strategies(None)) == set(strategies.STRATEGIES)
    plans, faults = (find_suite(name, quick=True) for name in ("plans", "faults"))
    assert chosen_strategies("gradient", plans) == ("nearest-frontier", "gradient")
    assert chosen_strategies("gradient", plans, alone=True) == ("gradient",)
    assert set(chosen_strategies("all", plans, alone=True)) == set(strategies.STRATEGIES)
    assert chosen_strategies("best") == ("random", strategies.ALIASES["best"])
    assert chosen_strategies("gradient", faults) == ("gradient",)


def test_a_settings_file_and_flags_change_what_is_compared(tmp_path, capsys):
    """A scenario of one's own in a file, worlds of two folders with one name, and a flag."""
    pixels = np.full((30, 44), 254, np.uint8)
    pixels[10:20, 15:18] = 0
    files = []
    for name in ("a", "b"):
        (tmp_path / name).mkdir()
        files.append(str(tmp_path / name / "plan.png"))
        Image.fromarray(pixels[: 30 if name == "a" else 25]).save(files[-1])
    mine = with_settings(SCENARIOS["office"], {"name": "mine", "robots": 1, "time_limit_s": 15.0})
    (tmp_path / "mine.json").write_text(json.dumps(settings_of(mine)))
    usual = ["--strategies", "random", "--seeds", "2", "--jobs", "1", "--json"]
    words = ["--settings", str(tmp_path / "mine.json"), "--world", *files, "--robot.reach-m", "2"]
    assert run_command(benchmark.main, [*usual, *words, "--out", str(tmp_path / "out")]) == 0
    page = (tmp_path / "out" / "own.md").read_text()
    assert str(tmp_path) not in page and "world file `plan.png`, 22 × 15 voxels" in page
    assert "--settings mine.json --world a/plan.png b/plan.png --robot.reach-m 2" in page
    figures = [row.record for row in read_table(archive_in(tmp_path / "out"))]
    assert [one["world"] for one in figures] == ["a/plan", "b/plan"]
    assert {one["robots"] for one in figures} == {1} and all(one["t_mission_s"] <= 15.0 for one in figures)
    capsys.readouterr()
    # Files of one name as tasks of their own.
    words = ["--world", *files, "--robots", "1", "--time-limit-s", "5"]
    assert run_command(benchmark.main, [*usual, *words, "--out", str(tmp_path / "each")]) == 0
    results = json.loads(capsys.readouterr().out)
    assert {row["task"] for row in results["tasks"]} == {"a/plan, 1 robot", "b/plan, 1 robot"}
    page = (tmp_path / "each" / "own.md").read_text()
    assert str(tmp_path) not in page and "--world a/plan.png b/plan.png --robots 1" in page

"""`python -m baselines.benchmark`: rows, page, failures; whatever was killed ends with the same bytes."""

from __future__ import annotations

import csv
import json
import re
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest
from PIL import Image
from scipy import stats

from baselines import benchmark, strategies
from baselines.cli.arguments import parse, run_command
from baselines.experiments import runner
from baselines.experiments.mission import run_mission, scripted
from baselines.scoreboard import chosen
from baselines.scoreboard.chosen import chosen_strategies
from baselines.scoreboard.mission import SuiteMission
from baselines.strategies import make_strategy
from baselines.strategies.rules.random_walk import RandomWalk
from benchmarks.proofs.kills import contents
from entropy_explore_env.envs.parallel_env import EntropyExploreEnv
from entropy_explore_env.errors import SettingError
from entropy_explore_env.reports.metrics import mission_figures
from entropy_explore_env.scenario import with_settings
from entropy_explore_env.scenarios import BOX, LAB, SCENARIOS
from entropy_explore_env.settings import Grid
from entropy_explore_env.settings_json import settings_json
from entropy_explore_env.worlds.load import save_world
from entropy_explore_env.worlds.world import World
from tests.systems import needs_posix

ROOT = Path(__file__).parents[2]
TINY = ("--scenarios", "box-7x11x5", "--robots", "1,2", "--time-limit-s", "150")
PAIR = (*TINY, "--strategies", "gradient", "--seeds", "6", "--jobs", "1")


def rows_of(path: Path) -> list[dict[str, str]]:
    with path.open() as file:
        return list(csv.DictReader(file))


@pytest.fixture(scope="module")
def pair(tmp_path_factory):
    """A small experiment as a user runs it, in a process of its own."""
    folder = tmp_path_factory.mktemp("pair")
    words = [sys.executable, "-m", "baselines.benchmark", *PAIR, "--out", str(folder)]
    ran = subprocess.run(words, cwd=ROOT, capture_output=True, text=True, check=True)
    return folder, ran


# --- what a user gets


def test_the_command_leaves_page_tables_figures_and_a_file_a_mission(pair):
    folder, ran = pair
    assert "over random's" in ran.stdout and "gradient" in ran.stdout
    assert "24/24" in ran.stderr and "scoreboard.md" in ran.stderr
    assert set(contents(folder)) == {"scoreboard.md"} | {
        f"scoreboard/own/{name}"
        for name in (
            *("part.txt", "overall.csv", "tasks.csv", "missions.csv", "missions.jsonl.xz"),
            *("ratios.png", "tasks.png"),
        )
    }
    missions = sorted(str(path.relative_to(folder / "runs")) for path in folder.rglob("seed-*.json"))
    assert missions == sorted(
        f"box-7x11x5-{robots}/{strategy}/seed-{seed}.json"
        for robots in ("1-robot", "2-robots")
        for strategy in ("random", "gradient")
        for seed in range(6)
    )
    for name in ("ratios", "tasks"):
        with Image.open(folder / "scoreboard" / "own" / f"{name}.png") as picture:
            assert picture.width > 400 and len(np.unique(np.asarray(picture.convert("L")))) > 30


def test_the_page_says_what_made_it_and_every_row(pair):
    page = (pair[0] / "scoreboard.md").read_text()
    command = (
        "python -m baselines.benchmark --strategies gradient --scenarios box-7x11x5 --robots 1,2 --seeds 6"
    )
    assert f"`{command} --time-limit-s 150`" in page
    assert "### box-7x11x5, 1 robot\n" in page and "### box-7x11x5, 2 robots\n" in page
    assert page.count("time limit 150 s") == 2
    table = [line for line in page.splitlines() if line.startswith("| `")]
    assert len(table) == 6 and sum(line.startswith("| `gradient` |") for line in table) == 3
    assert "nan" not in page and "None" not in page and "failed" not in page.split("##", 1)[1]


def test_figures_are_those_of_the_missions(pair):
    folder, _ = pair
    env = EntropyExploreEnv(
        scripted(with_settings(BOX, {"track_truth": True, "time_limit_s": 150.0, "robots": 2}))
    )
    for seed in (0, 5):
        run_mission(env, make_strategy("gradient"), seed)
        figures = mission_figures(env.missions, 0, floor=True)
        path = folder / "runs" / "box-7x11x5-2-robots" / "gradient" / f"seed-{seed}.json"
        record = json.loads(path.read_text())["record"]
        assert record.pop("clock").keys() == {"decision_ms", "worst_decision_ms", "mission_s"}
        assert {name: figures[name] for name in record} == record and "joint" in record
        row = next(
            row
            for row in rows_of(folder / "scoreboard" / "own" / "missions.csv")
            if (row["task"], row["strategy"], row["seed"]) == ("box-7x11x5, 2 robots", "gradient", str(seed))
        )
        assert float(row["t_mission_s"]) == pytest.approx(figures["t_mission_s"], rel=1e-5)
        assert row["time_s_90_bits"] == ("" if figures["t90_s"] is None else f"{figures['t90_s']:.6g}")
        assert float(row["distance_m"]) == pytest.approx(figures["distance_m"], rel=1e-5)
        assert row["end_reason"] == figures["end_reason"]


def test_the_tables_are_made_of_the_missions(pair):
    folder, _ = pair
    missions = rows_of(folder / "scoreboard" / "own" / "missions.csv")
    names = [f"box-7x11x5, {team}" for team in ("1 robot", "2 robots")]

    def times(strategy, name):
        found = [row for row in missions if (row["strategy"], row["task"]) == (strategy, name)]
        return np.asarray([min(float(row["t_mission_s"]), 150.0) for row in found])

    rows = rows_of(folder / "scoreboard" / "own" / "tasks.csv")
    overall = rows_of(folder / "scoreboard" / "own" / "overall.csv")
    means = []
    for name in names:
        means.append(stats.gmean(times("gradient", name) / times("random", name)))
        row = next(row for row in rows if (row["task"], row["strategy"]) == (name, "gradient"))
        assert float(row["time_s_end_over_random"]) == pytest.approx(means[-1], rel=1e-4)
        assert float(row["time_s_end"]) == pytest.approx(np.median(times("gradient", name)), rel=1e-4)
        low, high = (float(row[f"time_s_end_over_random_{end}"]) for end in ("low", "high"))
        assert low <= means[-1] <= high
    assert low < high and means[1] < 1.0
    whole = {row["strategy"]: float(row["time_s_end_over_random"]) for row in overall}
    assert whole == {"random": 1.0, "gradient": pytest.approx(stats.gmean(means), rel=1e-4)}


def test_a_finished_experiment_says_the_same_again_without_a_mission(pair, capsys, monkeypatch):
    folder, _ = pair
    before = contents(folder)

    def nothing_to_do(_: object, tasks: list, *__: object) -> list:
        assert not tasks, "missions were run"
        return []

    monkeypatch.setattr(runner, "run_each", nothing_to_do)
    assert run_command(benchmark.main, [*PAIR, "--out", str(folder), "--json"]) == 0
    said = capsys.readouterr()
    results = json.loads(said.out, parse_constant=pytest.fail)
    assert said.err == "" and contents(folder) == before
    assert [len(results[name]) for name in ("overall", "tasks", "failed")] == [2, 4, 0]


def test_two_processes_write_the_same_bytes(pair, tmp_path, capsys):
    words = [*PAIR[:-1], "2", "--out", str(tmp_path), "--runs", str(tmp_path / "runs")]
    assert run_command(benchmark.main, words) == 0
    assert contents(tmp_path) == contents(pair[0])


def test_another_run_begins_with_the_archive_of_the_first(pair, tmp_path, capsys, monkeypatch):
    """All of it: no mission is run. With a strategy more: only that one's are."""
    archive, ran = pair[0] / "scoreboard" / "own" / "missions.jsonl.xz", []
    real = runner.run_each

    def logged(do: object, tasks: list, *others: object):
        ran.extend(order.work.file for order in tasks)
        return real(do, tasks, *others)

    monkeypatch.setattr(runner, "run_each", logged)
    words = ["--archive", str(archive), "--out", str(tmp_path / "same")]
    assert run_command(benchmark.main, [*PAIR, *words]) == 0
    assert "24 missions taken" in capsys.readouterr().err and ran == []
    assert contents(tmp_path / "same") == contents(pair[0])
    again = tmp_path / "same" / "scoreboard" / "own" / "missions.jsonl.xz"
    assert again.read_bytes() == archive.read_bytes()
    words = ["--archive", str(archive), "--out", str(tmp_path / "more"), "--seeds", "6", "--jobs", "1"]
    words += ["--strategies", "gradient,mutual-information"]
    assert run_command(benchmark.main, [*TINY, *words]) == 0
    assert len(ran) == 12 and all("/mutual-information/" in name for name in ran)


KILLER = """
import os, random, signal, sys, time
from pathlib import Path
from baselines import benchmark
from baselines.cli.arguments import run_command
import baselines.scoreboard.page, baselines.scoreboard.terminal, baselines.experiments.worker_pool
from tests.baselines.test_benchmark import PAIR

folder, kills = Path(sys.argv[1]), int(sys.argv[2])
moments, done = random.Random(0), []
for kill in range(kills):
    before, ended = len(list(folder.rglob("seed-*.json"))), False
    child = os.fork()
    if child == 0:
        os._exit(run_command(benchmark.main, [*PAIR, "--out", str(folder)]))
    if kill % 2:  # after a mission, or any time
        while len(list(folder.rglob("seed-*.json"))) == before and not ended:
            time.sleep(0.0005)
            ended = os.waitid(os.P_PID, child, os.WEXITED | os.WNOHANG | os.WNOWAIT) is not None
        time.sleep(moments.uniform(0.0, 0.03))
    else:
        time.sleep(moments.uniform(0.0, 0.3) if kill < kills - 4 else moments.uniform(0.3, 2.0))
    os.kill(child, signal.SIGKILL)
    _, status = os.waitpid(child, 0)
    done.append((os.WIFSIGNALED(status), len(list(folder.rglob("seed-*.json")))))
print(done)
"""
"""Starts the command and kills it at random moments, many times; forks share the import."""


@needs_posix
def test_killed_twenty_times_it_ends_with_the_same_bytes(pair, tmp_path):
    words = [sys.executable, "-c", KILLER, str(tmp_path), "20"]
    ran = subprocess.run(words, cwd=ROOT, capture_output=True, text=True, check=True)
    killed = eval(ran.stdout.splitlines()[-1])
    counts = [count for _, count in killed]
    assert sum(by_signal for by_signal, _ in killed) >= 15  # the rest had finished before
    assert counts == sorted(counts) and len(set(counts)) >= 5  # it went on, and was not done at once
    words = [sys.executable, "-m", "baselines.benchmark", *PAIR, "--out", str(tmp_path)]
    subprocess.run(words, cwd=ROOT, capture_output=True, check=True)
    assert contents(tmp_path) == contents(pair[0])


# --- missions that fail


class Raises(RandomWalk):
    """In the middle of some missions."""

    def choose(self, view):
        if view.time_s > 5.0 and len(view.scenario.agents) == 2:
            raise ValueError("no | way\nat <all>")
        return super().choose(view)


class Sleeps(RandomWalk):
    """Longer than anybody waits."""

    def choose(self, view):
        time.sleep(60.0)
        return super().choose(view)


@pytest.fixture
def entered(monkeypatch):
    """Two strategies that fail, beside the random walk."""
    named = {"random": RandomWalk, "raises": Raises, "sleeps": Sleeps}
    monkeypatch.setattr(strategies, "STRATEGIES", named)
    monkeypatch.setattr(chosen, "STRATEGIES", named)


FAILING = (*TINY, "--seeds", "2", "--jobs", "1", "--wall-limit-s", "0.5")


def test_a_mission_that_fails_is_a_row_with_its_reason(entered, tmp_path, capsys):
    assert run_command(benchmark.main, [*FAILING, "--out", str(tmp_path)]) == 0
    said = capsys.readouterr()
    assert "failed: sleeps, box-7x11x5, 1 robot, missions 0, 1: ran past 0.5 s on the clock" in said.out
    assert re.search(r"failed: raises, .*at <all> \(test_benchmark\.py, line \d+\)\n", said.out)
    page = (tmp_path / "scoreboard.md").read_text()
    failed = page.split("### Missions that failed")[1]
    assert r"| `raises` | box-7x11x5, 2 robots: 0, 1 | ValueError: no \| way at \<all\> |" in failed
    both = "box-7x11x5, 1 robot: 0, 1; box-7x11x5, 2 robots: 0, 1"
    assert f"| `sleeps` | {both} | ran past 0.5 s on the clock |" in failed
    assert "| `raises` | 0 of 2 |" in page and "| `raises` | 0 of 2, 2 failed |" in page
    rows = rows_of(tmp_path / "scoreboard" / "own" / "tasks.csv")
    assert [row["failed"] for row in rows] == ["0", "0", "2", "0", "2", "2"]
    slept = next(row for row in rows if row["strategy"] == "sleeps")
    assert (slept["failed"], slept["finished"], float(slept["time_s_end"])) == ("2", "0", 150.0)
    overall = {row["strategy"]: row for row in rows_of(tmp_path / "scoreboard" / "own" / "overall.csv")}
    assert (overall["sleeps"]["tasks"], overall["sleeps"]["time_s_end_over_random"]) == ("0", "")
    assert overall["raises"]["tasks"] == "1"
    ends = [row["end_reason"] for row in rows_of(tmp_path / "scoreboard" / "own" / "missions.csv")]
    assert ends.count("FAILED") == 6


def test_what_failed_stays_unless_the_limit_grows(entered, tmp_path, capsys):
    assert run_command(benchmark.main, [*FAILING, "--out", str(tmp_path)]) == 0
    before, started = contents(tmp_path), time.monotonic()
    assert run_command(benchmark.main, [*FAILING, "--out", str(tmp_path)]) == 0
    assert contents(tmp_path) == before
    assert time.monotonic() - started < 2.0 + 4 * 0.5  # nobody slept again
    capsys.readouterr()
    words = [*FAILING[:-1], "0.6", "--out", str(tmp_path), "--json"]
    assert run_command(benchmark.main, words) == 0
    reasons = {row["reason"] for row in json.loads(capsys.readouterr().out)["failed"]}
    assert reasons == {"ran past 0.6 s on the clock", "ValueError: no | way at <all>"}


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


def test_random_is_always_there_and_first():
    assert chosen_strategies("gradient,random") == ("random", "gradient")
    assert set(chosen_strategies("all")) == set(chosen_strategies(None)) == set(strategies.STRATEGIES)
    assert chosen_strategies("gradient", "plans") == ("nearest-frontier", "gradient")
    assert chosen_strategies("best") == ("random", strategies.ALIASES["best"])


def test_a_suite_says_who_stands_in_its_table():
    plans, volumes = chosen_strategies(None, "plans"), chosen_strategies(None, "volumes")
    assert plans[0] == "nearest-frontier" and strategies.ALIASES["best"] in plans
    of_teams = {"voronoi", "coordinated-frontier", "assigned-frontier"}
    assert set(volumes) - set(plans) == of_teams
    assert "pretrained:plans" in plans and "pretrained:volumes" not in volumes
    assert set(chosen_strategies("all", "plans")) == set(strategies.STRATEGIES)
    assert chosen_strategies("voronoi,suite", "plans")[:2] == ("nearest-frontier", "voronoi")
    assert set(chosen_strategies("suite,voronoi", "plans")) == {*plans, "voronoi"}
    with pytest.raises(SettingError, match="suite"):
        chosen_strategies("suite")


def test_scenarios_are_names_and_files(tmp_path):
    solid = np.zeros((9, 12, 7), bool)
    solid[4, 5] = True
    save_world(World(Grid(solid.shape, 0.25), solid, "hut"), tmp_path / "hut.npz")

    def chosen(*words):
        words = ["--robots", "1", *words]
        args = parse(benchmark.Args, words)
        suite, _ = benchmark._suite(args, words)
        return {task.places[0].name: task.scenario for task in suite.tasks}

    found = chosen("--scenarios", f"lab,{tmp_path / 'hut.npz'}")
    assert list(found) == ["lab", "hut"] and all(
        one.track_truth and one.robots == 1 for one in found.values()
    )
    assert found["lab"].ending == LAB.ending and found["lab"].grid == LAB.grid
    assert found["hut"].grid.shape == (9, 12, 7) and found["hut"].robot.reach_m == 0.5  # those of the room
    words = "--world-scenario", "cave", "--time-limit-s", "77"
    found = chosen("--scenarios", str(tmp_path / "hut.npz"), *words)
    assert found["hut"].robot.navigator == "planned" and found["hut"].ending.time_limit_s == 77.0
    assert found["hut"].grid.voxel_size_m == 0.4 and found["hut"].name == "hut"


def test_the_page_of_a_file_does_not_say_where_it_lies(tmp_path, capsys):
    image = Image.fromarray(np.full((30, 44), 254, np.uint8))
    path = tmp_path / "a plan.png"
    image.save(path)
    words = ["--scenarios", str(path), "--strategies", "random", "--robots", "1", "--seeds", "1"]
    words += ["--jobs", "1", "--time-limit-s", "20", "--out", str(tmp_path / "out"), "--json"]
    assert run_command(benchmark.main, words) == 0
    page = (tmp_path / "out" / "scoreboard.md").read_text()
    assert "--scenarios 'a plan.png'" in page and "world file `a plan.png`, " in page
    assert str(tmp_path) not in page and "1 ground robot" in page


def test_what_a_record_says_of_the_clock_is_its_own(monkeypatch):
    ticks = iter(range(10**6))
    monkeypatch.setattr("baselines.scoreboard.mission.time.perf_counter", lambda: float(next(ticks)))
    env = EntropyExploreEnv(
        scripted(with_settings(BOX, {"track_truth": True, "robots": 1, "time_limit_s": 9.0}))
    )
    record = SuiteMission()(env, "random", 0)
    assert record["clock"]["decision_ms"] == 1000.0  # a tick a decision
    assert record["clock"]["mission_s"] >= 2 * 3 and "per_robot" not in record


@pytest.mark.parametrize(
    "words",
    [
        ["--suite", "plan"],
        ["--suite", "plans", "--scenarios", "room"],
        ["--suite", "plans", "--seeds", "3"],
        ["--scenarios", "rooom"],
        ["--scenarios", "room,room"],
        ["--scenarios", "nowhere.bt"],
        ["--scenarios", "pyproject.toml"],
        ["--scenarios", ""],
        ["--strategies", "magic"],
        ["--strategies", "random,"],
        ["--robots", "0"],
        ["--robots", "2,2"],
        ["--robots", "two"],
        ["--robots", "1,"],
        ["--robots", "-1"],
        ["--seeds", "0"],
        ["--jobs", "0"],
        ["--time-limit-s", "0"],
        ["--time-limit-s", "inf"],
        ["--wall-limit-s", "nan"],
        ["--world-scenario", "moon"],
        ["--out", "pyproject.toml/below"],
        ["--magic"],
    ],
)
def test_bad_input_is_one_line_before_anything_runs(words, tmp_path, capsys, monkeypatch):
    def must_not_run(*_: object, **__: object) -> None:
        raise AssertionError("missions were run")

    monkeypatch.setattr(benchmark, "run_cells", must_not_run)
    monkeypatch.chdir(ROOT)
    given = words if "--out" in words else [*words, "--out", str(tmp_path / "out")]
    assert run_command(benchmark.main, ["--quick", *given]) == 2
    said = capsys.readouterr()
    assert not said.out and said.err.startswith("error: ") and said.err.count("\n") == 1
    assert not (tmp_path / "out").exists()


def test_quick_shrinks_what_is_not_given(monkeypatch, tmp_path):
    asked = []

    def seen(cells, *_: object, **__: object) -> None:
        asked.extend(cells)
        raise KeyboardInterrupt

    monkeypatch.setattr(benchmark, "run_cells", seen)
    words = ["--quick", "--robots", "3", "--out", str(tmp_path), "--strategies", "random"]
    assert run_command(benchmark.main, words) == 130
    assert [(cell.id, cell.seeds, cell.scenario.robots) for cell in asked] == [
        ("room-3-robots/random", 5, 3),
        ("office-3-robots/random", 5, 3),
    ]


def test_a_settings_file_and_flags_change_what_is_compared(tmp_path, capsys):
    """A scenario of one's own in a file, worlds of two folders with one name, and a flag."""
    pixels = np.full((30, 44), 254, np.uint8)
    pixels[10:20, 15:18] = 0
    files = []
    for folder in ("a", "b"):
        (tmp_path / folder).mkdir()
        files.append(str(tmp_path / folder / "plan.png"))
        Image.fromarray(pixels[: 30 if folder == "a" else 25]).save(files[-1])
    mine = with_settings(SCENARIOS["office"], {"name": "mine", "robots": 1, "time_limit_s": 15.0})
    (tmp_path / "mine.json").write_text(settings_json(mine))
    usual = ["--strategies", "random", "--seeds", "2", "--jobs", "1", "--json"]
    words = ["--settings", str(tmp_path / "mine.json"), "--world", *files, "--robot.reach-m", "2"]
    assert run_command(benchmark.main, [*usual, *words, "--out", str(tmp_path / "out")]) == 0
    page = (tmp_path / "out" / "scoreboard.md").read_text()
    assert str(tmp_path) not in page and "world file `plan.png`, 22 × 15 voxels" in page
    assert "--settings mine.json --world a/plan.png b/plan.png --robot.reach-m 2" in page
    runs = sorted((tmp_path / "out" / "runs").rglob("seed-*.json"))
    figures = [json.loads(run.read_text())["record"] for run in runs]
    assert [one["world"] for one in figures] == ["a/plan", "b/plan"]
    assert {one["robots"] for one in figures} == {1} and all(one["t_mission_s"] <= 15.0 for one in figures)
    capsys.readouterr()
    # Files of one name as scenarios of their own: a task each.
    words = ["--scenarios", ",".join(files), "--robots", "1", "--time-limit-s", "5"]
    assert run_command(benchmark.main, [*usual, *words, "--out", str(tmp_path / "each")]) == 0
    results = json.loads(capsys.readouterr().out)
    assert {row["task"] for row in results["tasks"]} == {"a/plan, 1 robot", "b/plan, 1 robot"}
    page = (tmp_path / "each" / "scoreboard.md").read_text()
    assert str(tmp_path) not in page and "--scenarios a/plan.png,b/plan.png --robots 1" in page


@pytest.mark.parametrize(
    ("words", "named"),
    [
        (["--suite", "plans", "--robot.reach-m", "2"], "robot.reach_m"),
        (["--settings", "mine.json", "--scenarios", "room"], "scenarios"),
        (["--scenarios", "hut.npz", "--world", "hut.npz"], "world"),
        (["--scenarios", "room", "--negate"], "negate"),
    ],
)
def test_options_that_contradict_each_other_are_named(words, named, tmp_path, monkeypatch, capsys):
    (tmp_path / "mine.json").write_text(settings_json(BOX))
    save_world(World(Grid((9, 12, 7), 0.25), np.zeros((9, 12, 7), bool), "hut"), tmp_path / "hut.npz")
    monkeypatch.chdir(tmp_path)
    assert run_command(benchmark.main, [*words, "--out", "out"]) == 2
    assert capsys.readouterr().err.startswith(f"error: {named} = ") and not (tmp_path / "out").exists()

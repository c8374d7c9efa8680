"""`python -m baselines.run`: what it prints and writes, and how it ends."""

from __future__ import annotations

import dataclasses
import json
import os
import signal
import subprocess
import sys
import time
from pathlib import Path
from typing import NamedTuple

import numpy as np
import pytest
from PIL import Image

from baselines import replay, run
from baselines.cli import mission_outputs as mission_log
from baselines.cli.arguments import run_command
from baselines.cli.progress import standing_still
from baselines.cli.world_options import Reading
from baselines.experiments.mission import run_mission, scripted
from baselines.strategies import ALIASES, STRATEGIES, make_strategy
from benchmarks.proofs.world_samples import pgm
from entropy_explore_env.envs.parallel_env import EntropyExploreEnv
from entropy_explore_env.missions.records import MissionEnd
from entropy_explore_env.reports.metrics import mission_figures
from entropy_explore_env.reports.mission_record import load_record
from entropy_explore_env.settings.changes import with_settings
from entropy_explore_env.settings.scenarios import BOX
from entropy_explore_env.worlds.load import LOAD_OPTIONS
from tests.systems import needs_posix

ROOT = Path(__file__).parents[2]
NAMED = (
    "scenario",
    "strategy",
    "robots",
    "seed",
    "finished",
    "end_reason",
    "t_mission_s",
    "scans",
    "measurements",
    "shared_measurements",
    "entropy_start_bits",
    "entropy_end_bits",
    "distance_m",
    "blocked_moves",
    "wall_s",
)
"""Keys that the README and README promises."""
FILES = ["map.npz", "mission.gif", "mission.json", "mission.npz", "mission.png"]
SHORT = ("--ending.time-limit-s", "8")


class Ran(NamedTuple):
    code: int
    out: str
    err: str


@pytest.fixture
def command(capsys):
    def ran(*words: str) -> Ran:
        code = run_command(run.main, words)
        return Ran(code, *capsys.readouterr())

    return ran


@pytest.fixture
def figures(command):
    def printed(*words: str) -> dict:
        ran = command("box-7x11x5", *words, "--json")
        assert (ran.code, ran.err) == (0, "")
        return json.loads(ran.out, parse_constant=pytest.fail)

    return printed


def without_clock(figures: dict) -> dict:
    return {name: value for name, value in figures.items() if name != "wall_s"}


# --- results


def test_json_is_one_object_with_every_key_and_the_mission_s_own_figures(figures):
    printed = figures("--strategy", "random", "--seed", "4")
    assert set(NAMED) <= set(printed)
    env = EntropyExploreEnv(with_settings(scripted(BOX), {"track_truth": True}))
    run_mission(env, make_strategy("random"), 4)
    expected = {"strategy": "random", **mission_figures(env.missions, 0, floor=True)}
    assert without_clock(printed) == json.loads(json.dumps(expected))
    assert (printed["scenario"], printed["robots"], printed["seed"]) == ("box-7x11x5", 2, 4)
    assert printed["finished"] and printed["end_reason"] == "MAPPED"
    assert printed["entropy_end_bits"] <= printed["entropy_threshold_bits"] < printed["entropy_start_bits"]
    assert 0 < printed["shared_measurements"] < printed["measurements"] <= 28 * printed["scans"]
    assert 0.0 < printed["wall_s"] < 60.0


def test_the_same_seed_gives_the_same_figures_but_for_the_wall_clock(figures):
    first, again, other = (figures("--seed", seed) for seed in ("3", "3", "4"))
    assert without_clock(first) == without_clock(again)
    assert without_clock(first) != without_clock(other)


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


def test_what_is_not_said_is_the_scenario_s_own(figures):
    said = (
        "--robots 2 --strategy gradient --seed 0 --channel.burst 8 --channel.i-min-bits 0.1 "
        "--robot.reach-m 1 --robot.max-speed-m-s 0.5 --ending.time-limit-s 10000"
    )
    assert without_clock(figures(*said.split())) == without_clock(figures())


@pytest.mark.parametrize(
    "options",
    [
        "--json",
        "--strategy random",
        "--json --strategy random --seed 3",
        "--seed=3",
        "--channel.no-announcements",
        "--no-json",
        "--channel.no_announcements",
    ],
)
def test_options_may_stand_before_the_scenario(options, command):
    before, after = (
        without_clock(json.loads(command(*words, "--json").out))
        for words in ([*options.split(), "box-7x11x5"], ["box-7x11x5", *options.split()])
    )
    assert before == after


def test_channel_options_change_the_result(figures):
    usual = figures()
    alone = figures("--channel.burst", "0")
    assert alone["shared_measurements"] == 0 < usual["shared_measurements"]
    assert all(robot["measurements_received"] == 0 for robot in alone["per_robot"])
    assert figures("--channel.i-min-bits", "1000")["shared_measurements"] == 0
    lossy = figures("--channel.loss-probability", "1")
    assert lossy["shared_measurements"] > 0 and lossy["messages_lost"] > 0
    assert all(robot["measurements_received"] == 0 for robot in lossy["per_robot"])
    assert figures("--channel.burst", "3")["shared_measurements"] < usual["shared_measurements"]


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


def test_a_world_file_takes_the_place_of_the_scenario_s_world(command, tmp_path):
    octomap = pytest.importorskip("octomap")
    tree = octomap.OcTree(0.25)
    for voxel in np.ndindex(8, 12, 6):
        solid = voxel[0] in (0, 7) or voxel[1] in (0, 11) or voxel[2] in (0, 5)
        tree.updateNode((np.asarray(voxel) + 0.5) * 0.25 - 1.0, solid)
    path = tmp_path / "hut.bt"
    assert tree.writeBinary(str(path).encode())
    words = ["box-7x11x5", "--world", str(path), "--robots", "2", "--json", *SHORT]
    fine = json.loads(command(*words, "--voxel-size-m", "0.25").out)
    assert (fine["scenario"], fine["world"]) == ("box-7x11x5", "hut")
    voxel_bits = 0.5 * np.log2(2 * np.pi * np.e) + np.log2(30.0)
    assert fine["entropy_start_bits"] == pytest.approx(8 * 12 * 6 * voxel_bits, rel=1e-6)
    coarse = command(*words)  # at the scenario's 0.5 m: half of each outer voxel is solid, nothing is free
    assert coarse.code in (0, 2) and coarse.err.count("\n") == (coarse.code == 2)


@pytest.fixture
def floor(tmp_path):
    """A plan of 6 × 5 m with a pillar, at 0.1 m a pixel."""
    shades = np.full((50, 60), 254, np.uint8)
    shades[20:30, 15:18] = 0
    path = tmp_path / "floor.pgm"
    path.write_bytes(pgm(shades))
    return path


def test_a_world_file_is_read_as_asked_and_replayed_from_the_record(floor, command, capsys, tmp_path):
    record = tmp_path / "r.npz"
    words = [
        "room",
        "--world",
        str(floor),
        "--resolution-m",
        "0.1",
        "--height-m",
        "2",
        "--robots",
        "2",
        *SHORT,
    ]
    ran = json.loads(command(*words, "--voxel-size-m", "0.2", "--record", str(record), "--json").out)
    assert (ran["scenario"], ran["world"]) == ("room", "floor")
    kept = load_record(record)
    assert kept.scenario.grid.shape == (30, 25, 10) and kept.world.occupied[8, 12].all()
    floor.unlink()  # the record holds the world
    assert run_command(replay.main, [str(record), "--json"]) == 0
    assert json.loads(capsys.readouterr().out)["replayed"]["same"] is True


def test_starts_and_a_world_number_are_taken_recorded_and_replayed(command, capsys, tmp_path):
    record, file = tmp_path / "r.npz", tmp_path / "starts.json"
    poses = [[0.75, 0.75, 0.75, 0.5, 0.1], [0.75, 3.75, 0.75, -2.0, -0.1]]
    file.write_text(json.dumps(poses))
    words = ("box-7x11x5", "--world-number", "12", "--record", str(record), "--json", *SHORT)
    ran = [json.loads(command(*words, "--starts", given).out) for given in (json.dumps(poses), str(file))]
    assert [each.pop("wall_s") >= 0.0 for each in ran] == [True] * 2 and ran[0] == ran[1]
    kept = load_record(record)
    assert kept.starts.tolist() == poses and kept.world_number == 12
    assert run_command(replay.main, [str(record), "--json"]) == 0
    assert json.loads(capsys.readouterr().out)["replayed"]["same"] is True
    planar = ("--robot.motion", "planar", "--starts", "[[0.75, 0.75, 0.5], [0.75, 3.75, -2]]")
    command(*words, *planar)
    assert load_record(record).starts.tolist() == [
        [0.75, 0.75, 0.75, 0.5, 0.0],
        [0.75, 3.75, 0.75, -2.0, 0.0],
    ]


@pytest.mark.parametrize(
    ("options", "said"),
    [
        (["--starts", "nowhere.json"], ["starts", "nowhere.json"]),
        (["--starts", "[[1, 2"], ["starts", "JSON"]),
        (["--starts", "[1, 2]"], ["starts", "JSON"]),
        (["--starts", "[[1, 2, 0.5], [1, 2, 0.5]]"], ["starts[0]", "flies"]),
        (["--starts", "[[1, 2, 1, 0, 0]]"], ["starts", "(2, 5)"]),
        (["--starts", "[[1, 2, 1, 0, 0], [1, 2, 1, 0, 0]]"], ["starts[1]", "robot_0"]),
        (["--world-number", "-1"], ["world = -1", "0 to 2147483647"]),
        (["--world", "FLOOR", "--world-number", "1"], ["world = 1", "only the worlds of recipes"]),
    ],
)
def test_starts_and_worlds_that_cannot_be_are_one_line_and_code_2(options, said, floor, command):
    words = [str(floor) if word == "FLOOR" else word for word in options]
    ran = command("box-7x11x5", "--robots", "2", *words, *SHORT)
    assert ran.code == 2 and ran.err.count("\n") == 1
    assert all(word in ran.err for word in said), ran.err


def test_a_file_without_options_stays_a_setting_of_the_scenario(floor, command, tmp_path):
    record = tmp_path / "r.npz"
    assert command("office", "--world", str(floor), "--record", str(record), "--json", *SHORT).code == 0
    assert load_record(record).scenario.world == str(floor) and load_record(record).world is None


def test_the_table_says_whose_robots_explore_a_loaded_world(floor, command):
    words = ("--world", str(floor), "--resolution-m", "0.1", "--voxel-size-m", "0.1", *SHORT)
    for scenario, more, said, range_said in (
        ("office", (), "those of office", "8 m"),
        ("room", (), "those of room", "the whole world"),
        ("room", ("--robot.max-speed-m-s", "0.5"), "those of room, changed", "the whole world"),
        ("room", ("--sensor.max-range-m", "2.5"), "those of room, changed", "2.5 m"),
    ):
        lines = command(scenario, *words, *more).out.splitlines()
        assert any("sensor's range" in line and f" {range_said} " in line for line in lines)
        assert any("robots and sensor" in line and f" {said} " in line for line in lines)
        assert any(" 60 × 50 voxels of 0.1 m " in line for line in lines)
        assert any(" 6 × 5 m " in line for line in lines)


def test_the_table_leaves_out_what_means_nothing(command):
    """Sharing, where there is one robot; how many scans more than for a whole map, where there is none."""
    team, alone = ("shared measurements", "bits sent", "imbalance between robots"), ("--robots", "1")
    short, whole, single = (command("box-7x11x5", *words).out for words in (SHORT, (), alone))
    assert all(label in whole and label not in single for label in team)
    assert "scans over the floor" in whole and "scans over the floor" not in short


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["--height-m", "2"], ["height_m", "--world"]),
        (["--negate"], ["negate", "--world"]),
        (["--hollow"], ["hollow", "--world"]),
        (["--world", "FLOOR", "--ceiling-m", "2"], ["ceiling_m", "does not apply"]),
        (["--world", "FLOOR", "--height-m", "-2"], ["height_m", "a number > 0"]),
        (["--world", "FLOOR", "--height-m", "tall"], ["--height-m"]),
        (["--world", "office", "--height-m", "2"], ["a file"]),
    ],
)
def test_options_that_a_world_does_not_take_are_refused(words, said, floor, command, tmp_path):
    given = [word.replace("FLOOR", str(floor)) for word in words]
    ran = command("room", *given, "--out", str(tmp_path / "out"))
    assert ran.code == 2 and ran.err.count("\n") == 1 and all(word in ran.err for word in said)
    assert not (tmp_path / "out").exists()


def test_every_option_of_load_world_is_an_option_of_the_command():
    options = {field.name for field in dataclasses.fields(Reading)}
    assert options - {"hollow"} | {"fill", "voxel_size_m"} == set(LOAD_OPTIONS)
    asked = Reading(height_m=1.0, negate=True, free_above=3.0, map_rule="nav2", hollow=True).options()
    assert asked == {"height_m": 1.0, "negate": True, "free_above": 3.0, "map_rule": "nav2", "fill": False}
    assert Reading().options() == {}


# --- files


def read_gif(path: Path) -> list[np.ndarray]:
    with Image.open(path) as animation:
        frames = []
        for number in range(animation.n_frames):  # type: ignore[attr-defined]
            animation.seek(number)
            frames.append(np.asarray(animation.convert("RGB")))
    return frames


def test_the_files_are_whole(command, tmp_path):
    folder = tmp_path / "a" / "b"
    ran = command("box-7x11x5", "--seed", "2", "--out", str(folder), "--json")
    assert (ran.code, ran.err) == (0, "")
    assert sorted(path.name for path in folder.iterdir()) == FILES
    printed = json.loads(ran.out)
    kept = json.loads((folder / "mission.json").read_text(), parse_constant=pytest.fail)
    assert {name: kept[name] for name in printed} == printed
    check_series(kept)
    assert kept["settings"]["grid"]["shape"] == [7, 11, 5]
    assert kept["settings"]["sensor"]["max_range_m"] == "inf"
    assert kept["settings"]["channel"]["burst"] == 8
    with Image.open(folder / "mission.png") as picture:
        picture.load()
        assert picture.format == "PNG" and min(picture.size) > 500
        assert len(np.unique(np.asarray(picture.convert("L")))) > 50
    frames = read_gif(folder / "mission.gif")
    assert 10 <= len(frames) <= 102
    assert all(frame.shape == (480, 640, 3) for frame in frames)
    assert (frames[0] != frames[-1]).any()


def check_series(kept: dict) -> None:
    series = kept["series"]
    lengths = {name: len(values) for name, values in series.items()}
    assert len(set(lengths.values())) == 1 and 2 < lengths["time_s"] <= 1001
    assert series["time_s"][0] == 0.0 and series["time_s"][-1] == kept["t_mission_s"]
    assert (np.diff(series["time_s"]) > 0).all()
    entropy = np.asarray(series["entropy_bits"])
    assert entropy.shape == (lengths["time_s"], kept["robots"])
    assert (entropy[0] == kept["entropy_start_bits"]).all() and entropy[-1].min() == kept["entropy_end_bits"]
    assert (np.diff(entropy, axis=0) <= 1e-9).all()
    assert series["scans"][-1] == kept["scans"]
    assert series["shared_measurements"][-1] == kept["shared_measurements"]


def test_a_long_mission_keeps_its_ends_and_not_too_many_moments(command, tmp_path, monkeypatch):
    monkeypatch.setattr(mission_log, "_SERIES_POINTS", 20)
    monkeypatch.setattr(mission_log, "_GIF_PICTURES", 10)
    fake_pictures(monkeypatch)
    assert command("box-7x11x5", "--out", str(tmp_path), "--json").code == 0
    kept = json.loads((tmp_path / "mission.json").read_text())
    check_series(kept)
    assert len(kept["series"]["time_s"]) <= 41
    frames = read_gif(tmp_path / "mission.gif")
    assert 4 <= len(frames) <= 14


def fake_pictures(monkeypatch: pytest.MonkeyPatch) -> None:
    """Save the time that matplotlib takes."""
    monkeypatch.setattr("baselines.cli.mission_picture.mission_picture", lambda *_: b"picture")


def test_the_table_says_what_was_written(command, tmp_path, monkeypatch):
    fake_pictures(monkeypatch)
    folder = tmp_path / "a long name of a folder that no table may break into two lines" / "results"
    ran = command("box-7x11x5", "--out", str(folder), *SHORT)
    assert ran.code == 0 and f"{folder}/mission.json" in ran.out


# --- bad input


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["nowhere"], ["scenario", "nowhere", "box-7x11x5"]),
        ([""], ["scenario"]),
        (["box-7x11x5", "--strategy", "dance"], ["strategy", "dance", "gradient"]),
        (["box-7x11x5", "--frobnicate", "3"], ["--frobnicate"]),
        (["box-7x11x5", "more"], ["more"]),
        (["box-7x11x5", "--robots", "two"], ["--robots", "two"]),
        (["box-7x11x5", "--robots", "1.5"], ["--robots", "1.5"]),
        (["box-7x11x5", "--robots"], ["--robots"]),
        (["box-7x11x5", "--robots", "0"], ["robots", "0", "1"]),
        (["box-7x11x5", "--robots", "-3"], ["robots"]),
        (["box-7x11x5", "--robots", "5000"], ["robots", "5000", "1000"]),
        (["box-7x11x5", "--robots", "900", "--json"], ["robots", "900", "at most"]),
        (["box-7x11x5", "--seed", "-1"], ["seed", "-1"]),
        (["box-7x11x5", "--seed", "0.5"], ["--seed", "0.5"]),
        (["box-7x11x5", "--channel.burst", "-1"], ["burst", "-1"]),
        (["box-7x11x5", "--channel.i-min-bits", "nan"], ["i_min_bits", "nan"]),
        (["box-7x11x5", "--channel.loss-probability", "1.5"], ["loss_probability", "1.5"]),
        (["box-7x11x5", "--robot.motion", "crawl"], ["motion", "crawl", "planar"]),
        (["box-7x11x5", "--robot.reach-m", "0"], ["reach_m", "0"]),
        (["box-7x11x5", "--sensor.max-range-m", "-1"], ["max_range_m", "-1"]),
        (["box-7x11x5", "--sensor.field-of-view-rad", "9", "1"], ["field_of_view_rad", "9"]),
        (["box-7x11x5", "--ending.sigma-end", "inf"], ["sigma_end", "inf"]),
        (["box-7x11x5", "--voxel-size-m", "0.2"], ["voxel_size_m", "--world"]),
        (["box-7x11x5", "--world", "missing.bt"], ["world", "missing.bt", "exists"]),
        (["box-7x11x5", "--world", "missing.bt", "--voxel-size-m", "nan"], ["voxel_size_m", "nan"]),
        (["box-7x11x5", "--world", "plan.pdf"], ["world", "plan.pdf", ".bt"]),
    ],
)
def test_bad_input_is_one_line_and_code_2(words, said, command):
    check_refused(command(*words), said)


def check_refused(ran: Ran, said: list[str]) -> None:
    assert (ran.code, ran.out) == (2, "")
    assert ran.err.startswith("error: ") and ran.err.endswith("\n") and ran.err.count("\n") == 1
    assert "Traceback" not in ran.err and all(word in ran.err for word in said)


def test_too_many_robots_are_one_line_also_under_a_progress_bar(command):
    check_refused(command("box-7x11x5", "--robots", "900"), ["robots", "900"])


@pytest.mark.parametrize(
    "content", [b"", b"a text", b"# Octomap OcTree binary file\nid OcTree\nsize 9\nres 0.1\ndata\n"]
)
def test_a_file_that_is_no_octomap_is_refused(content, command, tmp_path):
    pytest.importorskip("octomap")
    path = tmp_path / "broken.bt"
    path.write_bytes(content)
    check_refused(command("box-7x11x5", "--world", str(path), "--json"), ["broken.bt"])
    check_refused(command("box-7x11x5", "--world", str(tmp_path), "--json"), ["world"])


def test_a_folder_that_cannot_be_made_is_refused(command, tmp_path, monkeypatch):
    fake_pictures(monkeypatch)
    (tmp_path / "taken").write_text("mine")
    for out in (tmp_path / "taken", tmp_path / "taken" / "deeper"):
        check_refused(command("box-7x11x5", "--out", str(out), "--json", *SHORT), ["taken"])
    assert [path.name for path in tmp_path.iterdir()] == ["taken"]
    assert (tmp_path / "taken").read_text() == "mine"


def test_a_folder_that_cannot_be_made_is_refused_before_the_mission(command, tmp_path, monkeypatch):
    def must_not_run(*_: object) -> None:
        raise AssertionError("the mission ran")

    monkeypatch.setattr(run, "run_mission", must_not_run)
    (tmp_path / "taken").write_text("mine")
    check_refused(command("box-7x11x5", "--out", str(tmp_path / "taken"), "--json"), ["out", "taken"])


# --- interruption


def test_an_interrupted_mission_prints_and_writes_nothing(command, tmp_path, monkeypatch):
    def interrupted(env: EntropyExploreEnv, *_: object) -> None:
        env.reset(seed=0)
        raise KeyboardInterrupt

    monkeypatch.setattr(run, "run_mission", interrupted)
    ran = command("box-7x11x5", "--json", "--out", str(tmp_path / "out"))
    assert ran == (130, "", "interrupted\n")
    assert [path for path in tmp_path.rglob("*") if path.is_file()] == []


@pytest.mark.parametrize("done", [0, 1, 2])
def test_files_are_whole_or_not_there_when_writing_is_interrupted(done, command, tmp_path, monkeypatch):
    """Interrupted in the fsync of the file after the first `done`; an older file stays as it was."""
    fake_pictures(monkeypatch)
    (tmp_path / "mission.json").write_text("older")
    calls, really = [], os.fsync

    def fsync(handle: int) -> None:
        calls.append(handle)
        if len(calls) > done:
            raise KeyboardInterrupt
        really(handle)

    monkeypatch.setattr("os.fsync", fsync)
    ran = command("box-7x11x5", "--json", "--out", str(tmp_path), *SHORT)
    assert ran == (130, "", "interrupted\n")
    written = ["mission.json", "mission.png", "mission.gif"][: max(done, 1)]
    assert sorted(path.name for path in tmp_path.iterdir()) == sorted(written)
    if done == 0:
        assert (tmp_path / "mission.json").read_text() == "older"
    else:
        check_series(json.loads((tmp_path / "mission.json").read_text()))
    if done == 2:
        assert (tmp_path / "mission.png").read_bytes() == b"picture"


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


def test_bad_input_ends_a_process_with_code_2():
    with process("box-7x11x5", "--robots", "none") as started:
        out, err = started.communicate(timeout=300)
    check_refused(Ran(started.returncode, out, err), ["--robots"])


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


def test_the_mission_s_end_is_said_by_its_name():
    assert {end.name for end in MissionEnd} == {
        "RUNNING",
        "MAPPED",
        "TIME_UP",
        "CYCLES_UP",
        "SEEN",
        "STOPPED",
        "EXHAUSTED",
    }
    env = EntropyExploreEnv(with_settings(scripted(BOX), {"max_cycles": 3}))
    run_mission(env, make_strategy("random"), 0)
    assert mission_figures(env.missions, 0)["end_reason"] == "CYCLES_UP"


def test_flying_robots_in_a_flat_plan_are_told_that_they_stay_in_its_plane(tmp_path, monkeypatch, capsys):
    monkeypatch.setenv("HOME", str(tmp_path))
    (tmp_path / "plan.pgm").write_bytes(pgm(np.full((30, 40), 254, np.uint8)))
    words = ["--strategy", "random", "--world", "~/plan.pgm", "--robots", "1", "--json", "--seed", "1e0"]
    words += ["--ending.max-cycles", "3e0", "--voxel-size-m", "0.1"]
    assert run.main(["room", *words]) == 0
    said = capsys.readouterr()
    assert json.loads(said.out)["seed"] == 1
    assert "plan.pgm is one voxel high: robots stayed in its plane and looked level" in said.err
    assert run.main(["room", *words, "--height-m", "1.0"]) == 0
    assert "one voxel high" not in capsys.readouterr().err
    assert run.main(["office", *words]) == 0
    assert "one voxel high" not in capsys.readouterr().err

"""Trials: what is missing is run, whatever was killed, and a finished table has the same bytes."""

from __future__ import annotations

import dataclasses
import os
import random
import signal
import time
import warnings
from dataclasses import dataclass
from pathlib import Path

import pytest

from baselines.experiments import trials as module
from baselines.experiments.origin import Origin
from baselines.experiments.rows import read_table
from baselines.experiments.trials import (
    Cell,
    CellTrial,
    How,
    by_cell,
    described,
    failed_record,
    run_cells,
    run_trials,
    trials_of,
)
from baselines.experiments.worker_pool import Failure
from entropy_explore_env.errors import SettingError
from entropy_explore_env.settings.changes import with_settings
from entropy_explore_env.settings.scenarios import BOX, OFFICE

SHORT = with_settings(BOX, {"time_limit_s": 20.0})
CELLS = (Cell("walk", SHORT, "random", 3), Cell("steep", SHORT, "gradient", 2))


@dataclass(frozen=True)
class Square:
    """A trial that takes a moment; with a trace it notes there that it was run."""

    seed: int
    trace: str = ""
    factor: int = 1
    cell: str = "square"
    world: str = "none"

    @property
    def settings(self):
        return {"factor": self.factor}

    def run(self):
        if self.trace:
            with Path(self.trace).open("a", encoding="ascii") as file:
                file.write(f"{self.seed} ")
        time.sleep(0.001)
        if self.factor == 0:
            raise ValueError("nothing")
        return {"square": self.factor * self.seed**2}


def killed_after(seconds, work):
    """Do work in a process that is killed after some time; whether it came to an end before."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", DeprecationWarning)  # of forks where there are threads
        child = os.fork()
    if child == 0:
        try:
            work()
        finally:
            os._exit(0)
    time.sleep(seconds)
    os.kill(child, signal.SIGKILL)
    return os.waitpid(child, 0)[1] == 0


@pytest.mark.skipif(not hasattr(os, "fork"), reason="forks")
def test_kills_at_random_moments_lose_nothing_and_end_in_the_same_bytes(tmp_path):
    squares = [Square(seed) for seed in range(150)]
    random.Random(0).shuffle(squares)
    run_trials(sorted(squares, key=lambda square: square.seed), tmp_path / "whole.jsonl", How())
    table, rng, kept, kills = tmp_path / "killed.jsonl", random.Random(1), 0, 0
    while kills < 100:
        if killed_after(rng.uniform(0.0, 0.02), lambda: run_trials(squares, table, How())):
            table.unlink()  # it came to its end: once more
            kept = 0
            continue
        kills += 1
        assert len(read_table(table)) >= kept
        kept = len(read_table(table))
    run_trials(squares, table, How())
    assert table.read_bytes() == (tmp_path / "whole.jsonl").read_bytes()


def test_missions_leave_the_same_bytes_by_one_process_and_by_two(tmp_path):
    one = run_cells(CELLS, tmp_path / "one.jsonl", How(1))
    two = run_cells(CELLS, tmp_path / "two.jsonl", How(2, limit_s=300.0))
    assert one == two and (tmp_path / "one.jsonl").read_bytes() == (tmp_path / "two.jsonl").read_bytes()
    assert [len(records) for records in by_cell(one).values()] == [3, 2]
    assert [record["seed"] for record in by_cell(one)["walk"]] == [0, 1, 2]
    assert {row.world for row in one} == {BOX.world} and len({str(row.settings) for row in one}) == 2


def test_only_what_is_missing_is_run_and_other_settings_stay_beside_it(tmp_path):
    table, trace = tmp_path / "t.jsonl", tmp_path / "trace"

    def ran(trials, **how):
        trace.write_text("")
        run_trials(trials, table, How(**how))
        return sorted(map(int, trace.read_text("ascii").split()))

    squares = [Square(seed, str(trace)) for seed in range(4)]
    assert ran(squares[:2]) == [0, 1]
    assert ran(squares) == [2, 3]
    assert ran(squares) == []
    assert ran([dataclasses.replace(square, factor=3) for square in squares]) == [0, 1, 2, 3]
    assert len(read_table(table)) == 8
    assert ran(squares[1:], rerun=True) == [1, 2, 3]
    assert len(read_table(table)) == 8


def test_rows_of_older_commits_are_run_again_where_that_is_asked_for(tmp_path, monkeypatch):
    table, squares = tmp_path / "t.jsonl", [Square(seed) for seed in range(3)]
    monkeypatch.setattr(module, "this_origin", lambda: Origin("old", True))
    run_trials(squares[:2], table, How())
    monkeypatch.setattr(module, "this_origin", lambda: Origin("new", True))
    monkeypatch.setattr(module, "commits_since", lambda commit: frozenset({commit, "new"}))
    run_trials(squares, table, How())
    assert [row.origin.commit for row in read_table(table)] == ["old", "old", "new"]
    run_trials(squares, table, How(since="old"))
    assert [row.origin.commit for row in read_table(table)] == ["old", "old", "new"]
    run_trials(squares, table, How(since="middle"))
    assert [row.origin.commit for row in read_table(table)] == ["new", "new", "new"]


def test_failures_are_raised_or_kept_and_a_longer_limit_runs_late_ones_again(tmp_path):
    table, failing = tmp_path / "t.jsonl", Square(1, factor=0)
    with pytest.raises(ValueError, match="nothing"):
        run_trials([Square(2), failing], table, How())
    assert len(read_table(table)) == 1
    (row,) = run_trials([failing], table, How(keep_failures=True))
    assert row.record["failed"] == "ValueError: nothing" and "in run" in row.record["trace"]
    late = failed_record(Failure("ran past 1 s", late=True), 1.0)
    known = [dataclasses.replace(row, cell="square", seed=5, settings={"factor": 1}, record=late)]
    assert run_trials([Square(5)], table, How(limit_s=0.5), known)[0].record == late
    assert run_trials([Square(5)], table, How(limit_s=2.0))[0].record == {"square": 25}


def test_what_contradicts_itself(tmp_path):
    with pytest.raises(SettingError, match=r"since.*no value beside --rerun"):
        How(rerun=True, since="HEAD")
    with pytest.raises(SettingError, match=r"cell = 'square, seed 1'.*one trial"):
        run_trials([Square(1), Square(2), Square(1)], tmp_path / "t.jsonl", How())
    with pytest.raises(SettingError, match=r"since.*a commit of this repository"):
        run_trials([Square(1)], tmp_path / "t.jsonl", How(since="no-such-commit"))
    assert not (tmp_path / "t.jsonl").exists()


def test_no_trial_is_begun_when_the_time_is_up(tmp_path):
    assert run_trials([Square(1)], tmp_path / "t.jsonl", How(stop_after_s=0.0)) == [None]
    assert run_cells(CELLS[:1], tmp_path / "t.jsonl", How(stop_after_s=0.0)) == []


# --- settings of cells


def settings_of(cell):
    return CellTrial(cell, 0).settings


def test_settings_are_what_differs_from_defaults(tmp_path):
    cell = Cell("a", OFFICE, "best", 2)
    assert settings_of(cell)["strategy"] == "planned-rate"
    assert settings_of(cell) == settings_of(dataclasses.replace(cell, id="b", seeds=5))
    other = dataclasses.replace(cell, scenario=with_settings(OFFICE, {"robots": 7}))
    assert settings_of(other) != settings_of(cell) and settings_of(other)["scenario"]["robots"] == 7
    rewarded = with_settings(OFFICE, {"reward": {"cost_per_s": 0.5}})
    assert settings_of(dataclasses.replace(cell, scenario=rewarded)) == settings_of(cell)


def test_of_files_the_content_counts_and_not_the_folder(tmp_path):
    files = [tmp_path / "one" / "world.npz", tmp_path / "two" / "world.npz"]
    for file in files:
        file.parent.mkdir()
        file.write_bytes(b"same")
    assert described(str(files[0])) == described(str(files[1])) == described(files[0])
    other = tmp_path / "world.npz"
    other.write_bytes(b"other")
    assert described(other) != described(files[0])


def test_a_strategy_from_elsewhere_counts_by_its_file(tmp_path):
    file = tmp_path / "mine.py"
    file.write_text("from baselines.strategies.rules.random_walk import RandomWalk as Mine")
    cell = Cell("a", SHORT, f"{file}:Mine", 1)
    before = settings_of(cell)["strategy_files"]
    file.write_text("x = 1")
    module._file_digest.cache_clear()
    module._cell_settings.cache_clear()
    assert settings_of(cell)["strategy_files"] != before
    assert "strategy_files" not in settings_of(Cell("a", SHORT, "random", 1))


def test_missions_are_begun_seed_by_seed():
    assert [(one.cell, one.seed) for one in trials_of(CELLS)] == [
        ("walk", 0),
        ("steep", 0),
        ("walk", 1),
        ("steep", 1),
        ("walk", 2),
    ]

"""What is left of an experiment: rounds in order, a stop in time, and what older code ran."""

from __future__ import annotations

import json
import math

import pytest

from baselines.experiments import runner
from baselines.experiments.confirmation import keep_confirmed
from baselines.experiments.outcome import Outcome
from baselines.experiments.runner import NOT_RUN, Conditions, read_record, run_all


class Doubled:
    """Work that doubles a number; `code` says with which version, and that one adds `wrong`."""

    def __init__(self, number, code="new", wrong=0.0, log=None):
        self.number, self.code, self.wrong = number, code, wrong
        self.log = [] if log is None else log

    @property
    def file(self):
        return f"doubled/{self.number}"

    @property
    def settings_digest(self):
        return f"of {self.number}"

    def code_digest(self):
        return self.code

    def run(self):
        self.log.append(self.number)
        return Outcome({"twice": 2.0 * self.number + self.wrong, "clock": {"ms": len(self.log) + 0.5}})


def conditions(folder, **changes):
    return Conditions(folder, 1, "test", True, **changes)


def works(log, count=4, **changes):
    return [Doubled(number, log=log, **changes) for number in range(count)]


def test_what_older_code_ran_is_kept_where_a_sample_comes_out_the_same(tmp_path):
    log = []
    run_all(works([], code="old"), conditions(tmp_path))
    fresh = works(log, count=5)
    assert keep_confirmed(fresh, ["a", "a", "a", "b", "b"], conditions(tmp_path)) == 2
    assert log == [0, 3]  # the first of each group, whatever its time on the clock
    records = run_all(fresh, conditions(tmp_path))
    assert log == [0, 3, 4] and [record["twice"] for record in records] == [0.0, 2.0, 4.0, 6.0, 8.0]
    assert keep_confirmed(fresh, ["a"] * 5, conditions(tmp_path)) == 0 and log == [0, 3, 4]


def test_a_group_whose_sample_differs_is_run_again(tmp_path):
    log = []
    run_all(works([], code="old", wrong=1.0), conditions(tmp_path))
    fresh = works(log)
    assert keep_confirmed(fresh, ["a", "a", "b", "b"], conditions(tmp_path)) == 0
    records = run_all(fresh, conditions(tmp_path))
    assert log == [0, 2, 1, 3] and [record["twice"] for record in records] == [0.0, 2.0, 4.0, 6.0]


class Ending(Doubled):
    """A mission; with the old code those of even number but the first came to no end."""

    def run(self):
        self.log.append(self.number)
        return Outcome({"finished": self.code == "new" or self.number % 4 != 2, "clock": {}})


def test_missions_without_an_end_are_run_again_where_most_of_their_group_ended(tmp_path):
    log = []
    run_all([Ending(number, code="old") for number in range(6)], conditions(tmp_path))
    fresh = [Ending(number, log=log) for number in range(6)]
    assert keep_confirmed(fresh, ["a"] * 6, conditions(tmp_path)) == 4
    assert log == [0, 2]
    assert all(record["finished"] for record in run_all(fresh, conditions(tmp_path))) and log == [0, 2]


def test_missions_without_an_end_are_kept_where_hardly_any_of_their_group_ended(tmp_path):
    log = []
    old, new = ([Ending(number, code=code, log=log) for number in (1, 2, 6)] for code in ("old", "new"))
    run_all(old, conditions(tmp_path))
    log.clear()
    assert keep_confirmed(new, ["a"] * 3, conditions(tmp_path)) == 2 and log == [1]


def test_each_older_code_of_a_group_has_a_sample_of_its_own(tmp_path):
    log = []
    run_all(works([], code="right")[:2], conditions(tmp_path))
    run_all(works([], code="wrong", wrong=1.0)[2:], conditions(tmp_path))
    assert keep_confirmed(works(log), ["a"] * 4, conditions(tmp_path)) == 1
    assert log == [0, 2]
    kept = [read_record(tmp_path, work, "new") for work in works(log)]
    assert [record and record["twice"] for record in kept] == [0.0, 2.0, 4.0, None]


def test_a_record_that_was_changed_by_hand_confirms_nothing(tmp_path):
    run_all(works([], code="old"), conditions(tmp_path))
    path = tmp_path / "doubled" / "1.json"
    content = json.loads(path.read_text())
    content["record"]["twice"] = 7.0
    path.write_text(json.dumps(content))
    log = []
    assert keep_confirmed(works(log), ["a"] * 4, conditions(tmp_path)) == 2
    assert [record["twice"] for record in run_all(works(log), conditions(tmp_path))] == [0.0, 2.0, 4.0, 6.0]
    assert log == [0, 1]


@pytest.mark.parametrize(("stop_after_s", "done"), [(0.0, 0), (2.5, 3), (math.inf, 4)])
def test_when_the_time_is_up_no_work_is_begun(tmp_path, monkeypatch, stop_after_s, done):
    """A clock that goes on by one second whenever a piece of work has been done."""
    log = []
    monkeypatch.setattr(runner.time, "monotonic", lambda: float(len(log)))
    records = run_all(works(log), conditions(tmp_path, stop_after_s=stop_after_s))
    assert log == list(range(done))
    assert [record != NOT_RUN for record in records] == [number < done for number in range(4)]
    monkeypatch.undo()
    assert all(record != NOT_RUN for record in run_all(works(log), conditions(tmp_path)))
    assert log == list(range(4))

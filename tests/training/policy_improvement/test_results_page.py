"""The page of the policies' results: what it compares, counts and writes."""

from __future__ import annotations

import dataclasses

import pytest

from baselines.cli.arguments import run_command
from baselines.experiments.cells import missions_of, run_cells
from baselines.experiments.runner import NOT_RUN
from baselines.scoreboard.suites import find_suite
from entropy_explore_env.command import BAD_INPUT
from entropy_explore_env.scenario import with_settings
from training.policy_improvement import results_page, results_text
from training.policy_improvement.policy_tests import TESTS, Test, compared


def record(seconds: float, finished: bool = True) -> dict:
    clock = {"decision_ms": seconds / 4.0}
    joint = {"driven_m": seconds / 2.0}
    return {"t_mission_s": seconds, "joint": joint, "finished": finished, "clock": clock}


def test_only_starts_that_both_ran_are_compared():
    ours = [record(8.0), record(10.0), NOT_RUN, record(30.0)]
    theirs = [record(10.0), record(10.0), record(5.0), record(15.0)]
    found = compared(Test("office", 1), ours, theirs)
    assert found is not None
    assert found.starts == 3 and found.finished == (3, 3) and found.measured.medians == (10.0, 10.0)
    assert found.measured.ratio.value == 1.0 and found.measured.ratio.low <= 1.0 <= found.measured.ratio.high
    assert found.decision_ms == (2.5, 2.5)
    assert found.measured.mean_ratio.value == pytest.approx((0.8 * 1.0 * 2.0) ** (1 / 3))
    assert found.measured.worst_tenth == pytest.approx(
        26.0 / 14.0
    )  # 90th percentiles of 8, 10, 30 and of 10, 10, 15
    assert compared(Test("office", 1), [NOT_RUN], [record(1.0)]) is None


def test_missions_that_failed_or_were_not_finished_count_with_the_time_limit():
    office = Test("office", 1)
    limit_s = office.task.scenario.ending.time_limit_s
    failed = {"failed": "it raised", "trace": "", "limit_s": None}
    found = compared(office, [failed, record(50.0, finished=False)], [record(10.0), record(10.0)])
    assert found is not None and found.finished == (0, 2) and found.measured.medians == (limit_s, 10.0)
    assert found.decision_ms == (12.5, 2.5)
    found = compared(office, [record(10.0)], [failed])
    assert found is not None and found.finished == (1, 0) and found.measured.medians == (10.0, limit_s)


@pytest.mark.parametrize(
    ("ours", "goal", "holds"),
    [
        ([record(9.0)] * 5, 0.92, True),
        ([record(9.0)] * 5, 0.89, False),
        ([record(9.0)] * 4 + [record(9.0, finished=False)], 0.92, False),
        ([record(10.0), record(9.0), record(9.0), record(11.0), record(8.0)], 0.92, False),  # interval
        ([record(10.0)] * 5, 1.0, True),
        ([record(10.1)] * 5, 1.0, False),
    ],
)
def test_a_goal_asks_for_the_ratio_its_interval_and_finished_missions(ours, goal, holds):
    found = compared(Test("office", 1), ours, [record(10.0)] * 5)
    assert found is not None and found.holds(goal) is holds


def test_where_missions_are_long_thirty_starts_are_run_and_all_where_they_are_short():
    for test in (test for name in TESTS for test in TESTS[name]):
        starts = sum(cell.seeds for cell in test.cells("planned-rate", 100))
        assert starts == (100 if test.short else 30)
        assert sum(cell.seeds for cell in test.cells("planned-rate", 3)) == 3
    assert sum(test.short for test in TESTS["volumes"]) == 6


def test_in_the_dungeons_the_path_counts(tmp_path):
    (dungeons,) = (test for test in TESTS["plans"] if test.name == "dungeons")
    found = compared(dungeons, [record(8.0)], [record(10.0)])
    assert found is not None and found.measured.medians == (4.0, 5.0)
    found = compared(dungeons, [record(8.0, finished=False)], [record(10.0)])
    assert found is not None and found.measured.medians == (3600.0, 5.0)  # 7,200 s at 0.5 m/s
    cells = dungeons.cells("planned-rate", 3)
    assert len(cells) == 3 and all(cell.seeds == 1 for cell in cells)
    assert len({cell.scenario.world for cell in cells}) == 3
    short = with_settings(cells[0].scenario, {"ending": {"time_limit_s": 20.0}})
    cell = dataclasses.replace(cells[0], scenario=short)
    (ran,) = run_cells([cell], tmp_path, 1, "one", quiet=True)[cell.id]
    assert not ran["finished"] and ran["joint"]["driven_m"] > 0.0
    assert dungeons.measured({**ran, "finished": True}) == ran["joint"]["driven_m"]


def test_tasks_are_of_the_test_split_and_differ_by_what_their_names_say():
    for tests in TESTS.values():
        assert len({test.task.folder for test in tests}) == len(tests)
        for test in tests:
            if test.name != "dungeons":
                assert test.task.scenario.split == "test" and test.task.scenario.robots == test.robots
            assert test.goal is not None or test.learned
    lost = next(test for test in TESTS["plans"] if test.words.startswith("half"))
    assert lost.task.scenario.channel.loss_probability == 0.5


def test_missions_of_the_scoreboard_are_those_of_the_page():
    """An archive of it holds them under the same names and settings."""
    for name, tests in TESTS.items():
        suite = {"plans": ("plans", "volumes"), "volumes": ("volumes",)}[name]
        theirs = {
            mission.file: mission.settings_digest
            for each in suite
            for mission in missions_of(find_suite(each, False, ("planned-rate",)).cells)
        }
        for test in tests:
            ours = missions_of(test.cells("planned-rate", 30))
            shared = [one for one in ours if one.file in theirs]
            assert all(one.settings_digest == theirs[one.file] for one in shared)
            known = {"office, 1 robot", "office, 3 robots", "dungeons, 1 robot"}
            known |= {test.title for test in TESTS["volumes"] if test.robots in (1, 3) and not test.words}
            assert len(shared) == (len(ours) if test.title in known else 0), test.title


def test_the_page_is_written_stopped_and_gone_on_with(tmp_path, monkeypatch, capsys):
    small = Test("box-7x11x5", 2, learned=True, goal=0.01)
    tests = {"volumes": (small, Test("box-7x11x5", 1, goal=2.0))}
    monkeypatch.setattr(results_page, "TESTS", tests)
    monkeypatch.setattr(results_text, "TESTS", tests)
    options = ["--policies", "volumes", "--seeds", "3", "--out", str(tmp_path), "--jobs", "1"]
    assert run_command(results_page.main, [*options, "--stop-after-s", "1e-6"]) == 0
    assert "| box-7x11x5" not in (tmp_path / "policy.md").read_text()
    assert run_command(results_page.main, options) == 0
    page = (tmp_path / "policy.md").read_text()
    assert page.count("| box-7x11x5, 2 robots | 3 | 3 and 3 |") == 1
    assert page.count("| box-7x11x5, 1 robot | 3 |") == 1
    assert page.count("| ≤ 0.01 | no |") == 1 and page.count("| ≤ 2.00 | ") == 1
    assert "nan" not in page
    assert "- box-7x11x5, 2 robots, over `planned-rate`: " in page and "where 0.01 was asked" in page
    assert run_command(results_page.main, options) == 0
    assert (tmp_path / "policy.md").read_text() == page
    capsys.readouterr()
    archive, other = tmp_path / "policy" / "volumes" / "missions.jsonl.xz", tmp_path / "other"
    words = [*options, "--out", str(other), "--archive", str(archive), str(archive), "--stop-after-s", "1e-6"]
    assert run_command(results_page.main, words) == 0  # no mission is run
    assert (other / "policy.md").read_text() == page
    (other / "policy" / "plans").mkdir()
    (other / "policy" / "plans" / "part.txt").write_text("## What another run wrote\n")
    monkeypatch.setattr(results_page, "TESTS", {"plans": (small,), **results_page.TESTS})
    said = capsys.readouterr().err
    assert run_command(results_page.main, words) == 0
    assert (other / "policy.md").read_text().replace("## What another run wrote\n\n", "") == page
    assert f"12 missions taken from {archive}" in said and f"0 missions taken from {archive}" in said


def test_unknown_policies_and_starts_are_refused(tmp_path, capsys):
    out = ["--out", str(tmp_path / "new")]
    assert run_command(results_page.main, ["--policies", "cellars", *out]) == BAD_INPUT
    assert "pretrained:volumes" in capsys.readouterr().err
    for none in ("", "room"):
        assert run_command(results_page.main, ["--policies", none, *out]) == BAD_INPUT
        assert capsys.readouterr().err.startswith("error: ")
    assert run_command(results_page.main, ["--seeds", "0", *out]) == BAD_INPUT
    assert "seeds" in capsys.readouterr().err
    for name in ("stop-after-s", "wall-limit-s"):
        assert run_command(results_page.main, [f"--{name}=-1", *out]) == BAD_INPUT
        assert name.replace("-", "_") in capsys.readouterr().err
    assert run_command(results_page.main, ["--jobs", "0", *out]) == BAD_INPUT
    assert not (tmp_path / "new").exists()

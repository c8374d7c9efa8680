"""Rows of a suite's tables, from missions worked out by hand."""

from __future__ import annotations

import csv
import io
import math
from dataclasses import replace

import pytest

from baselines.experiments.origin import Origin
from baselines.experiments.rows import Row
from baselines.experiments.trials import CellTrial
from baselines.suites.page import cite, shown, tasks_table, write_page
from baselines.suites.results import Results, failed_rows, overall_rows, results_of, task_rows
from baselines.suites.suite import PATH, TIME, Place, Suite, Task
from entropy_explore_env.settings.changes import with_settings
from entropy_explore_env.settings.scenarios import BOX


def results_of_times(times: dict[str, list[list[float | str | None]]], robots: int = 2) -> Results:
    """Strategy → task → mission: seconds; None = cut off at 100 s; a word = failed for this reason."""
    names = [f"world-{number}" for number in range(len(times["random"]))]
    limited = with_settings(BOX, {"time_limit_s": 100.0, "robots": robots})
    tasks = tuple(Task(name, (Place(name, limited, len(times["random"][0])),)) for name in names)
    suite = Suite("own", "Mine", tasks, tuple(times))
    records = {}
    for strategy, worlds in times.items():
        for task, seconds in zip(tasks, worlds, strict=True):
            found = [
                {"failed": time_s, "limit_s": None}
                if isinstance(time_s, str)
                else {
                    "world": task.name,
                    "finished": time_s is not None,
                    "end_reason": "TIME_UP" if time_s is None else "MAPPED",
                    "t_mission_s": 100.0 if time_s is None else time_s,
                    "t90_s": None if time_s is None else time_s / 2,
                    "distance_m": 7.0,
                    "balance": 0.25,
                    "bits_sent": 1500,
                    "joint": {"driven_m": 7.0},
                    "clock": {"decision_ms": 1.0, "worst_decision_ms": 3.0, "mission_s": 2.0},
                }
                for time_s in seconds
            ]
            records[suite.cell_id(task, task.places[0], strategy)] = dict(enumerate(found))
    return Results(suite, records)


def test_a_part_of_the_missions_is_compared_where_both_ran_them():
    """`quick` has run the first and the third mission of one world, and none of the other."""
    whole = results_of_times(
        {"random": [[50.0, 40.0, 20.0], [60.0, 80.0, 90.0]], "quick": [[25.0] * 3, [1.0] * 3]}
    )
    suite, records = whole.suite, dict(whole.records)
    first, second = (suite.cell_id(task, task.places[0], "quick") for task in suite.tasks)
    records[first] = {seed: records[first][seed] for seed in (0, 2)}
    del records[second]
    results = Results(suite, records)
    rows = {(row["task"], row["strategy"]): row for row in task_rows(results)}
    assert set(rows) == {("world-0", "random"), ("world-0", "quick"), ("world-1", "random")}
    assert [row["missions"] for row in rows.values()] == [3, 2, 3]
    ratio = math.sqrt(25.0 / 50.0 * 25.0 / 20.0)
    assert rows["world-0", "quick"]["time_s_end_ratio"].value == pytest.approx(ratio)
    overall = {row["strategy"]: row for row in overall_rows(results)}
    assert (overall["quick"]["tasks"], overall["quick"]["missions"]) == (1, 2)
    assert overall["quick"]["time_s_end_ratio"].value == pytest.approx(ratio)
    assert list(results.numbered(suite.tasks[0], "quick")) == [0, 2]


def test_without_a_shared_mission_there_is_no_ratio(tmp_path):
    whole = results_of_times({"random": [[50.0, 40.0]], "quick": [[25.0, 25.0]]})
    suite, records = whole.suite, dict(whole.records)
    for strategy, missing in (("random", 0), ("quick", 1)):
        cell = suite.cell_id(suite.tasks[0], suite.tasks[0].places[0], strategy)
        records[cell] = {seed: record for seed, record in records[cell].items() if seed != missing}
    results = Results(suite, records)
    assert results.ratio("quick", "random", TIME, suite.tasks) is None
    page = write_page(tmp_path, results, [], "a command").read_text()
    assert "| `quick` | 1 | 1 | 100% | - | - |" in page


BY_HAND = {
    "random": [[50.0, 40.0], [None, 80.0]],
    "gradient": [[25.0, 50.0], [20.0, None]],
    "odd": [[10.0, "Oops"], [30.0, None]],
}


def test_rows_of_tasks_worked_out_by_hand():
    rows = {(row["task"], row["strategy"]): row for row in task_rows(results_of_times(BY_HAND))}
    walk, gradient, odd = (rows["world-0", name] for name in BY_HAND)
    assert (walk["finished"], walk["failed"], walk["time_s_end"].value) == (2, 0, 45.0)
    assert (odd["finished"], odd["failed"], odd["time_s_end"].value) == (1, 1, 55.0)
    assert gradient["time_s_end_ratio"].value == pytest.approx(math.sqrt(25 / 50 * 50 / 40))
    assert odd["time_s_end_ratio"].value == pytest.approx(math.sqrt(10 / 50 * 100 / 40))
    assert (
        odd["time_s_90_bits"].value == (5.0 + 100.0) / 2 and odd["median_time_s_90_bits"] is None
    )  # half only
    assert walk["median_time_s_90_bits"] == (25.0 + 20.0) / 2 and odd["decision_ms"] == 1.0
    assert rows["world-1", "random"]["time_s_end"].value == 90.0


def test_the_overall_rows_worked_out_by_hand():
    rows = {row["strategy"]: row for row in overall_rows(results_of_times(BY_HAND))}
    expected = math.sqrt(math.sqrt(0.5 * 1.25) * math.sqrt(0.2 * 1.25))
    assert rows["gradient"]["time_s_end_ratio"].value == pytest.approx(expected)
    assert rows["random"]["time_s_end_ratio"].value == 1.0
    assert (rows["odd"]["finished"], rows["odd"]["worst_decision_ms"]) == (0.5, 3.0)
    middle, low, high = rows["odd"]["time_s_end_ratio"]
    assert low < middle < high


def test_a_path_counts_with_what_the_team_could_have_driven():
    results = results_of_times(BY_HAND)
    task = results.suite.tasks[1]
    assert BOX.robots == 2 and BOX.robot.max_speed_m_s == 0.5
    assert results.values(task, "random", PATH).tolist() == [2 * 0.5 * 100.0, 7.0]
    assert results.values(task, "random", TIME).tolist() == [100.0, 80.0]


def test_who_cannot_act_in_a_task_takes_no_part_in_ratios_there():
    """`random` refuses the second world: `quick` is compared in the first alone, not with a time limit."""
    results = results_of_times({"random": [[50.0, 40.0], ["no", "no"]], "quick": [[25.0, 20.0], [1.0, 2.0]]})
    overall = {row["strategy"]: row for row in overall_rows(results)}
    assert overall["quick"]["time_s_end_ratio"].value == pytest.approx(0.5)
    assert (overall["quick"]["tasks"], overall["random"]["tasks"]) == (2, 1)
    rows = {(row["task"], row["strategy"]): row for row in task_rows(results)}
    for strategy in ("quick", "random"):
        assert rows["world-1", strategy]["time_s_end_ratio"] is None


def test_failures_of_one_reason_share_a_row():
    times = {"random": [["Oops", "Oops", 3.0, "Ouch"]], "odd": [[1.0, 2.0, "Oops", 4.0]]}
    rows = [(row["strategy"], row["reason"], row["missions"]) for row in failed_rows(results_of_times(times))]
    assert rows == [("random", "Oops", [0, 1]), ("random", "Ouch", [3]), ("odd", "Oops", [2])]


def test_a_page_where_all_failed_is_a_page(tmp_path):
    page = write_page(tmp_path, results_of_times({"random": [["Oops", "Oops"]]}), [], "the command")
    assert "| `random` | 0 of 2, 2 failed | > 100 |" in page.read_text()


def test_tables_of_teams_show_how_even_the_work_was_and_what_was_sent():
    team, alone = (tasks_table(results_of_times({"random": [[50.0]]}, robots)) for robots in (2, 1))
    assert "| imbalance | bits sent |" in team and "| 0.25 | 1,500 |" in team
    assert "imbalance" not in alone and "bits sent" not in alone


def test_a_paper_cites_the_table_as_latex_and_csv_and_the_figure(tmp_path):
    cite(tmp_path, results_of_times({"random": [[50.0, 40.0]], "quick": [[25.0, 20.0]]}))
    head, *rows = csv.reader(io.StringIO((tmp_path / "own.csv").read_text()))
    quick = dict(zip(head, rows[0], strict=True))
    assert [row[0] for row in rows] == ["quick", "random"]
    assert [float(quick[f"time_s_end_ratio_{part}"]) for part in ("value", "low", "high")] == [0.5] * 3
    latex = (tmp_path / "own.tex").read_text()
    assert latex.startswith("\\begin{tabular}{lrrrrr}") and latex.count("\\\\\n") == 3
    assert (tmp_path / "own.pdf").read_bytes().startswith(b"%PDF")


def test_a_figure_without_width_stands_alone():
    results = results_of_times({"random": [[50.0, 40.0]], "quick": [[25.0, 30.0]]})
    rows = {row["strategy"]: row["time_s_end_ratio"] for row in overall_rows(results)}
    assert shown(rows["random"], ".2f") == "1.00" and shown(None, ".2f") == "-"
    assert shown(rows["quick"], ".2f") == "0.61 (0.50 … 0.75)"
    assert results.ratio_alone("quick", results.suite.tasks[0]) == pytest.approx(rows["quick"].value)


def test_rows_of_other_settings_are_passed_over_and_others_strategies_are_shown():
    suite = results_of_times({"random": [[50.0, 40.0]]}).suite
    more = replace(suite, strategies=("random", "gradient"))
    rows = [
        Row(trial.cell, trial.seed, trial.world, trial.settings, Origin("abc", True), {"finished": False})
        for trial in map(CellTrial, [cell for cell in more.cells for _ in range(2)], [0, 1, 0, 1])
    ]
    foreign = replace(rows[0], settings={**rows[0].settings, "scenario": {"robots": 9}})
    beyond, elsewhere = replace(rows[0], seed=2), replace(rows[0], cell="world-9/random")
    later = replace(rows[1], record={"finished": True, "t_mission_s": 3.0})
    results, kept = results_of(suite, [*rows, foreign, beyond, elsewhere, later])
    assert results.suite.strategies == ("random", "gradient") and len(kept) == 4
    assert results.records["world-0/random"] == {0: {"finished": False}, 1: later.record}

"""What more robots and worse channels change: ratios by hand, and the page's table."""

from __future__ import annotations

import math

import pytest

from baselines.experiments.runner import NOT_RUN
from baselines.scoreboard.effects import effect_rows, effects_table
from baselines.scoreboard.page import write_page
from baselines.scoreboard.results import Results
from baselines.scoreboard.suites import Place, Suite, Task
from entropy_explore_env.scenario import with_settings
from entropy_explore_env.scenarios import BOX

LIMIT_S = 100.0


def task(robots, words="", beside=None):
    name = f"box, {robots} robot{'s' if robots > 1 else ''}{words}"
    scenario = with_settings(BOX, {"robots": robots, "time_limit_s": LIMIT_S})
    return Task(name, (Place(name, scenario, 3),), beside)


TASKS = (
    task(1),
    task(2, beside="box, 1 robot"),
    task(4, beside="box, 1 robot"),
    task(4, ", burst 64", beside="box, 4 robots"),
)
SECONDS = {
    "random": [[80.0, 40.0, 60.0], [40.0, 10.0, 30.0], [10.0, 20.0, NOT_RUN], [20.0, 20.0, 20.0]],
    "voronoi": [[None, 50.0, 50.0], [50.0, 50.0, 50.0], [NOT_RUN] * 3, [25.0, 25.0, 25.0]],
}


def results(times_of=SECONDS):
    def record(seconds):
        if seconds == NOT_RUN:
            return NOT_RUN
        return {
            "finished": seconds is not None,
            "t_mission_s": seconds or LIMIT_S,
            "joint": {"driven_m": 1.0},
            "clock": {"decision_ms": 1.0, "worst_decision_ms": 3.0},
        }

    suite = Suite("teams", TASKS, tuple(times_of))
    records = {
        suite.cell_id(each, each.places[0], strategy): [record(seconds) for seconds in times]
        for strategy, tasks in times_of.items()
        for each, times in zip(TASKS, tasks, strict=True)
    }
    return Results(suite, records)


def test_times_are_compared_mission_by_mission_with_the_task_beside():
    rows = {(row["task"], row["strategy"]): row for row in effect_rows(results())}
    two = rows["box, 2 robots", "random"]
    assert (two["beside"], two["missions"], two["finished"], two["beside_finished"]) == (
        "box, 1 robot",
        3,
        3,
        3,
    )
    assert two["time_over"] == pytest.approx((0.5 * 0.25 * 0.5) ** (1 / 3))
    assert two["time_over_low"] <= two["time_over"] <= two["time_over_high"]
    assert rows["box, 4 robots", "random"]["time_over"] == pytest.approx(math.sqrt(10 / 80 * 20 / 40))
    assert rows["box, 4 robots, burst 64", "random"]["time_over"] == pytest.approx(math.sqrt(2.0))
    cut = rows["box, 2 robots", "voronoi"]  # one mission of one robot was cut off at 100 s
    assert (cut["missions"], cut["finished"], cut["beside_finished"]) == (3, 3, 2)
    assert cut["time_over"] == pytest.approx(0.5 ** (1 / 3))
    assert ("box, 4 robots", "voronoi") not in rows and len(rows) == 4


def test_the_page_shows_speed_ups_and_what_channels_cost(tmp_path):
    found = results()
    head, _, *rows = effects_table(found, effect_rows(found)).strip().splitlines()
    assert (
        head == "| world | strategy | missions | speed-up, 2 robots | speed-up, 4 robots | time, burst 64 |"
    )
    assert rows[0].startswith("| box | `random` | 2 … 3 | 2.52 (")
    assert rows[1].startswith("| box | `voronoi` | 3 | > 1.26 (") and rows[1].endswith("| - | - |")
    page = write_page(tmp_path, found, "a command").read_text()
    assert "### What more robots and worse channels change" in page and rows[0] in page
    lines = (tmp_path / "scoreboard" / "teams" / "effects.csv").read_text().splitlines()
    assert (
        lines[0].startswith("task,beside,strategy,missions,finished,beside_finished,time_over,")
        and len(lines) == 5
    )
    assert "[`effects.csv`](scoreboard/teams/effects.csv)" in page


@pytest.mark.parametrize(
    ("one", "two", "four", "burst", "speed_up", "channel"),
    [
        ([80.0, 80.0], [40.0, 40.0], [20.0, 20.0], [40.0, 40.0], "2.00", "2.00"),
        ([None, 50.0], [50.0, 50.0], [20.0, 20.0], [40.0, None], "> 1.41", "> 3.16"),
        ([50.0, 50.0], [50.0, None], [None, 25.0], [25.0, 25.0], "< 0.71", "< 0.50"),
        ([None, 50.0], [50.0, None], [None, 25.0], [None, 25.0], "-", "-"),
    ],
)
def test_a_figure_is_a_bound_where_missions_of_one_side_were_cut_off(
    one, two, four, burst, speed_up, channel
):
    found = results({"random": [one, two, four, burst]})
    cells = effects_table(found, effect_rows(found)).strip().splitlines()[-1].split(" | ")
    assert [cells[3].partition(" (")[0], cells[5].partition(" (")[0].rstrip(" |")] == [speed_up, channel]


def test_a_suite_whose_tasks_stand_alone_has_no_such_part(tmp_path):
    alone = Suite("own", (task(1), task(2, beside="elsewhere")), ("random",))
    records = {alone.cell_id(each, each.places[0], "random"): [NOT_RUN] * 3 for each in alone.tasks}
    found = results().records[TASKS[0].folder + "/random"]
    records[alone.cell_id(alone.tasks[0], alone.tasks[0].places[0], "random")] = found
    ran = Results(alone, records)
    assert effect_rows(ran) == []
    assert "more robots" not in write_page(tmp_path, ran, "a command").read_text()
    assert not (tmp_path / "scoreboard" / "own" / "effects.csv").exists()

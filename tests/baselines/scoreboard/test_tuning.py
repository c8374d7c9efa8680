"""Rivals' settings: which are tried, where, and the table in the page."""

from __future__ import annotations

import math

import pytest

from baselines.cli.arguments import run_command
from baselines.experiments.statistics import Interval
from baselines.scoreboard import tuning as command
from baselines.scoreboard.mission import SETTINGS, configured
from baselines.scoreboard.suites import Place, Task, find_suite
from baselines.scoreboard.tuning import TUNINGS, find_tuning, marks, ranged, variants, with_table
from baselines.strategies import make_strategy
from entropy_explore_env.errors import SettingError
from tests.baselines.strategies.explorers.test_missions import small_plan


@pytest.mark.parametrize("suite", TUNINGS)
def test_each_setting_is_varied_alone_and_the_default_comes_first(suite):
    tuning = find_tuning(suite)
    for strategy, grid in tuning.grid.items():
        found, default = variants(tuning, strategy), vars(make_strategy(strategy).config)  # type: ignore[attr-defined]
        assert found[0] == strategy and len(set(found)) == len(found)
        defaults = sum(default[name] is not None for name in grid)
        assert len(found) == 1 + sum(map(len, grid.values())) - defaults
        for variant in found[1:]:
            name, _, value = variant.partition(SETTINGS)[2].partition("=")
            made = vars(configured(make_strategy(strategy), f"{name}={value}").config)  # type: ignore[attr-defined]
            assert {each for each, was in default.items() if made[each] != was} == {name}
            assert made[name] == float(value)
            assert default[name] is None or type(made[name]) is type(default[name])
    with pytest.raises(SettingError, match=r"strategies = 'random'"):
        variants(tuning, "random")


def test_what_is_not_tuned_is_refused_by_name():
    with pytest.raises(SettingError, match=r"nope=1.*behind"):
        configured(make_strategy("planned-rate"), "nope=1")
    with pytest.raises(SettingError, match=r"weight=1.*none at all"):
        configured(make_strategy("random"), "weight=1")
    with pytest.raises(
        SettingError, match=r"suite = 'others': allowed is one of plans, tours, volumes, teams"
    ):
        find_tuning("others")


@pytest.mark.parametrize("suite", TUNINGS)
def test_nothing_of_the_suite_is_tuned_on_but_dungeons_of_odd_number(suite):
    tested = {
        task.name: task
        for task in find_suite("plans" if suite == "tours" else suite, False, ("random",)).tasks
    }
    for task in find_tuning(suite).tasks(3):
        if task.name == "dungeons":
            assert [place.name for place in task.places] == ["1", "3", "5"]
        else:
            assert task.scenario.split == "train" and tested[task.name].scenario.split == "test"
            assert task.missions == 3


def test_a_ratio_of_one_mission_in_each_plan_has_no_interval():
    assert ranged(Interval(0.956, 0.9, 1.014)) == "0.96 (0.90 … 1.01)"
    assert ranged(Interval(0.956, 0.956, 0.956)) == "0.96"


def test_new_rows_take_the_place_of_their_strategies_and_others_stay():
    begin, end = marks("plans")
    head = "| strategy | setting |\n| --- | --- |\n"
    page = f"before\n{begin}\nold\n{end}\nafter\n"
    once = with_table(page, "plans", head + "| `b` | x=1 |\n| `b` | x=2 |\n")
    assert "old" not in once and once.startswith("before\n") and once.endswith(f"{end}\nafter\n")
    more = with_table(once, "plans", head + "| `c` | y=1 |\n")
    both = with_table(more, "plans", head + "| `a` | z=1 |\n| `b` | x=3 |\n")
    rows = [line for line in both.splitlines() if line.startswith("| `")]
    assert rows == ["| `a` | z=1 |", "| `b` | x=3 |", "| `c` | y=1 |"]
    assert with_table(both, "plans", head + "| `a` | z=1 |\n") == both
    other = with_table(both, "plans", "| rule |\n| --- |\n| `d` |\n")  # of another form: nothing stays
    assert [line for line in other.splitlines() if line.startswith("| `")] == ["| `d` |"]
    with pytest.raises(SettingError, match="a page with the lines"):
        with_table(once, "volumes", head)


def test_the_command_writes_the_paths_over_the_defaults(tmp_path, monkeypatch, capsys):
    plan = small_plan(ending={"seen_share": 0.8, "time_limit_s": 500.0})
    hall = TUNINGS["plans"]._replace(
        tasks=lambda n: (Task("hall", (Place("hall", plan, n),)),), grid={"tour": {"near": (0.4, 0.05)}}
    )
    monkeypatch.setattr(command, "TUNINGS", {"plans": hall})
    page = tmp_path / "page.md"
    page.write_text("\n".join(marks("plans")))
    words = ["--strategies", "tour", "--starts", "2", "--runs", str(tmp_path / "runs"), "--page", str(page)]
    assert run_command(command.main, words) == 0
    rows = [line.split(" | ") for line in page.read_text().splitlines() if line.startswith("| `")]
    assert [row[1:4] for row in rows] == [["default", "2", "1"], ["near=0.05", "2", rows[1][3]]]
    ratios = [[float(row[column].split()[0]) for column in (3, 4)] for row in rows]
    assert ratios[1][1] == pytest.approx(ratios[0][1] * ratios[1][0], abs=0.011)
    assert ratios[1][0] != 1.0 and math.isfinite(ratios[1][0])
    before = page.read_text()
    assert run_command(command.main, words) == 0 and page.read_text() == before
    run_cells = command.run_cells

    def edited_meanwhile(*args, **settings):
        page.write_text(f"{page.read_text()}\nA sentence.")
        return run_cells(*args, **settings)

    monkeypatch.setattr(command, "run_cells", edited_meanwhile)
    assert run_command(command.main, words) == 0 and page.read_text() == f"{before}\nA sentence."
    capsys.readouterr()

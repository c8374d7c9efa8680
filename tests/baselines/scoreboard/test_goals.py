"""Goals of the recommended strategy: what counts, and the committed page."""

from __future__ import annotations

import math

import pytest

from baselines.cli.arguments import run_command
from baselines.scoreboard import goals
from baselines.scoreboard.goals import GOALS, Missions
from entropy_explore_env.command import BAD_INPUT
from tests.code_blocks import DOCS

HEAD = "task,strategy,mission,end_reason,t_mission_s,distance_m,time_s_99_seen\n"


@pytest.fixture
def plans(tmp_path):
    """Two plans: in one both ran two missions, in the other one of four ran past the limit, one failed."""
    folder = tmp_path / "scoreboard" / "plans"
    folder.mkdir(parents=True)
    rows = [
        "office,distance-advantage,0,SEEN,100.0,40.0,90.0",
        "office,distance-advantage,1,SEEN,100.0,90.0,90.0",
        "office,nearest-frontier,0,SEEN,100.0,80.0,80.0",
        "office,nearest-frontier,1,SEEN,100.0,45.0,80.0",
        "office,nearest-frontier,2,SEEN,100.0,45.0,80.0",
        "hybrid,distance-advantage,3,TIME_UP,7200.0,17.0,",
        "hybrid,nearest-frontier,3,SEEN,100.0,900.0,80.0",
        "hybrid,nearest-frontier,4,FAILED,,,",
        "hybrid,distance-advantage,4,SEEN,100.0,9.0,80.0",
    ]
    (folder / "missions.csv").write_text(HEAD + "\n".join(rows) + "\n")
    return tmp_path


def test_paired_missions_count_and_unfinished_ones_with_what_could_be_driven(plans):
    (goal,) = (each for each in GOALS if each.ours == "distance-advantage")
    found = Missions(plans, "plans").compare(goal)
    assert found is not None and (found.tasks, found.missions) == (2, 3)
    hybrid = 3600.0 / 900.0  # 7,200 s at 0.5 m/s
    assert found.ratio.value == pytest.approx(math.sqrt(1.0 * hybrid))
    assert not found.holds(0.86) and found.holds(2.01)


def test_who_ran_nothing_has_no_row(plans):
    text = goals.page_of({"plans": Missions(plans, "plans"), **dict.fromkeys(("volumes", "teams"), Empty())})
    assert text.count("| plans |") == 1 and "| 2 tasks |" in text and "| **no** |" in text


class Empty:
    """A suite of which nothing was run."""

    def compare(self, goal):
        return None


def test_a_folder_without_tables_is_refused(tmp_path, capsys):
    assert run_command(goals.main, ["--results", str(tmp_path)]) == BAD_INPUT
    assert "missions.csv" in capsys.readouterr().err


def test_the_committed_page_is_of_the_committed_missions():
    page = (DOCS / "results" / "goals.md").read_text(encoding="utf-8")
    missions = {suite: Missions(DOCS / "results", suite) for suite in {goal.suite for goal in GOALS}}
    assert goals.page_of(missions) == page

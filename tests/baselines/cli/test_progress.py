"""What a person sees of a mission in the terminal."""

from __future__ import annotations

import pytest

from baselines.cli import progress
from baselines.cli.mission_outputs import show_results
from baselines.cli.progress import progress_bar
from baselines.experiments.mission import run_mission, scripted_env
from baselines.strategies import make_strategy
from entropy_explore_env.reports.metrics import mission_figures
from tests.reference.scenes import free_box


@pytest.mark.parametrize(("every_s", "hidden", "lines"), [(0.0, False, 4), (0.0, True, 0), (1e9, False, 0)])
def test_lines_now_and_then_stand_in_for_the_bar_where_there_is_no_terminal(
    capsys, monkeypatch, every_s, hidden, lines
):
    monkeypatch.setattr(progress, "LINE_EVERY_S", every_s)
    env = scripted_env(free_box(robots=1, ending={"max_cycles": 3}))
    with progress_bar("box, random", hidden) as show:
        run_mission(env, make_strategy("random"), 0, show)
    told = capsys.readouterr().err.splitlines()
    assert len(told) == lines
    assert all(line.startswith("box, random: entropy left ") and line.endswith(" s") for line in told)


@pytest.mark.parametrize("content", ["measurements", "summaries"])
def test_the_table_counts_summaries_where_robots_send_them(capsys, content):
    every = {"summary_every_s": 0.5} if content == "summaries" else {}
    scenario = free_box(robots=2, channel={"content": content, **every}, ending={"max_cycles": 12})
    env = scripted_env(scenario, track_truth=True)
    run_mission(env, make_strategy("random"), 0)
    figures = {**mission_figures(env.missions, 0), "wall_s": 1.0, "strategy": "random"}
    show_results(env, figures, [], as_json=False)
    rows = [line for line in capsys.readouterr().out.splitlines() if "summaries sent" in line]
    assert len(rows) == (content == "summaries")
    if rows:
        assert rows[0].split()[-1] == str(env.missions.state.summaries["sent"][0].sum())

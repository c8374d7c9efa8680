"""Figures of Sawhney 2009 that show no measurements: fig. 1 by the paper's numbers, small missions."""

from __future__ import annotations

import dataclasses
import itertools
import math

import numpy as np
import pytest

from baselines.cli.figures import png
from baselines.experiments.mission import scripted
from baselines.papers.sawhney import illustrations as sawhney_pictures
from baselines.papers.sawhney import report as sawhney_report
from baselines.papers.sawhney.illustrations import (
    example_options,
    figure_paths,
    figure_plan,
    figure_section,
    figure_terrain,
    first_options,
    ground_of,
    snapshots,
)
from baselines.papers.sawhney.mission import explore_until_done
from baselines.papers.sawhney.sweep import PLANS, TERRAINS, world_cell
from baselines.papers.sawhney.terrain_model import write_model
from baselines.strategies.metrics import Metric
from baselines.strategies.rules.per_time_visibility import PerTimeVisibility
from entropy_explore_env.envs.parallel_env import EntropyExploreEnv
from entropy_explore_env.scenario import with_settings
from entropy_explore_env.settings import Grid

SMALL = {
    "office": {"grid": Grid((90, 70, 1), 0.1), "sensor": {"angular_step_rad": math.pi / 30}},
    "terrain": {"grid": Grid((30, 24, 16), 1.0), "sensor": {"angular_step_rad": math.pi / 30}},
}


def small_cell(world, robots=2):
    """A cell of the experiment in a small world."""
    cell = world_cell(world, robots, "ptv")
    return dataclasses.replace(cell, scenario=with_settings(cell.scenario, SMALL[world]))


@pytest.mark.parametrize(
    ("metric", "means"), [(Metric(20.0), (11.0, 1.0, 11.0)), (Metric(), (15.2, 1.3, 12.5))]
)
def test_the_first_ten_options_are_the_paper_s(metric, means):
    seconds, seen = example_options()
    first = first_options(metric, seconds, seen)
    ratio = seen[first] / seconds[first]
    assert (seen[first].mean(), seconds[first].mean(), ratio.mean()) == pytest.approx(means)


def test_small_beta_goes_for_what_is_seen_and_not_for_time():
    seconds, seen = example_options()
    first = first_options(Metric(2.0), seconds, seen)
    assert {(1.0, 20.0), (2.0, 20.0), (1.0, 18.0), (3.0, 20.0)} < set(
        zip(seconds[first], seen[first], strict=True)
    )
    assert (seen - 2.0 * seconds)[first].min() >= np.delete(seen - 2.0 * seconds, first).max()


@pytest.mark.parametrize("world", SMALL)
def test_snapshots_are_of_one_mission_as_it_goes_on(world):
    cell = small_cell(world)
    taken = snapshots(cell, 0)
    env = EntropyExploreEnv(cell.scenario)
    env.reset(seed=0)
    truth = env.missions.worlds[0]
    assert truth is not None and len(taken) == 4
    shares = [now.share for now in taken]
    assert shares == sorted(shares) and shares[-1] > 0.95 and taken[0].time_s < taken[-1].time_s
    for before, after in itertools.pairwise(taken):
        assert (before.chart.mapped <= after.chart.mapped).mean() > 0.99
        assert [len(way) for way in before.paths_m] <= [len(way) for way in after.paths_m]
    for now in taken[:-1]:
        assert now.expected.any() and not (now.expected & now.chart.mapped).any()
        assert now.chart.edge.any() and now.chart.mapped[now.chart.edge].all()
    assert not taken[-1].expected.any()
    known = taken[-1].chart
    if world == "terrain":
        right = known.ground[known.mapped] == ground_of(truth)[known.mapped]
        assert right.mean() > 0.95 and np.isnan(known.ground[~known.mapped]).all()
    else:
        assert truth.occupied[:, :, 0][known.covered].all()
    for robot, way in enumerate(taken[0].paths_m):
        np.testing.assert_allclose(way[0], env.view(f"robot_{robot}").pose[:3])


def test_expected_is_what_those_who_choose_now_will_see():
    """By the snapshot's own candidates, from the viewpoints that were just chosen."""
    cell, chosen_at = small_cell("office", 1), {}
    explorer, env = PerTimeVisibility(cell.record.exploring), EntropyExploreEnv(scripted(cell.scenario))

    def look(share, views, chosen):
        place = env.missions.grid.in_grid_units(chosen[0])[:3]
        chosen_at[views[0].time_s] = explorer.cells_of(0).expected(place)

    explore_until_done(env, explorer, 0, look)
    taken = snapshots(cell, 0)
    assert len(taken) == 4
    for now in taken[:-1]:
        np.testing.assert_array_equal(now.expected, chosen_at[now.time_s])


def test_a_mission_that_is_cut_off_is_drawn_as_far_as_it_came():
    plan, terrain = (
        dataclasses.replace(cell, scenario=with_settings(cell.scenario, {"ending": {"time_limit_s": 4.0}}))
        for cell in (small_cell("office", 1), small_cell("terrain", 1))
    )
    assert not snapshots(plan, 0)[-1].finished
    for figure in (figure_plan(plan, "plan"), figure_section(terrain), figure_paths([("V/t", plan)] * 2)):
        assert len(png(figure)) > 4000


def test_every_picture_has_a_title_and_the_worlds_are_drawn(monkeypatch, tmp_path):
    monkeypatch.setattr(
        sawhney_pictures,
        "world_cell",
        lambda name, robots, *_: small_cell("terrain" if "terrain" in name else "office", robots),
    )
    drawn, means = sawhney_pictures.pictures(("plans", "terrains"), None)
    assert set(drawn) == set(sawhney_report.TITLES) and len(means) == 3
    assert set(sawhney_pictures.pictures(("terrains",), None)[0]) == {"worlds", "terrain-mission", "section"}
    monkeypatch.undo()
    figure = sawhney_pictures.figure_worlds(write_model(tmp_path))
    assert [axes.get_title() for axes in figure.axes] == [*PLANS, *TERRAINS, "dem"]


def test_pictures_of_small_missions(monkeypatch):
    plan, terrain = small_cell("office", 1), small_cell("terrain")
    for figure in (
        figure_plan(plan, "plan"),
        figure_terrain(terrain, "terrain"),
        figure_section(small_cell("terrain", 1)),
        figure_paths([("V/t", plan), ("V/t again", plan)]),
    ):
        assert len(png(figure)) > 5000
    monkeypatch.setattr(sawhney_pictures, "world_cell", lambda *_: plan)
    figure, means = sawhney_pictures.figure_options()
    assert [name for name, *_ in means] == ["V - 2t", "V - 20t", "V/t"] and len(figure.axes) == 4

"""Viewing places: lines of sight beside a slow reference, and tours that use them."""

from __future__ import annotations

import math
from types import SimpleNamespace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from baselines.experiments.mission import run_mission
from entropy_explore_env.envs.parallel_env import EntropyExploreEnv
from entropy_explore_env.frontiers.blocks import NONE
from entropy_explore_env.frontiers.frontier_map import KNOWN_SIGMA
from entropy_explore_env.frontiers.voxel_map import is_visible
from entropy_explore_env.planner.scene import Goal
from entropy_explore_env.planner.tour import SharedTour, Tour
from entropy_explore_env.reports.metrics import mission_figures
from entropy_explore_env.robots.motion import MoveEnd
from tests.planner.scenes import (
    belief_of_plan,
    cell,
    random_plan,
    scenario_of,
    scene_of,
    small_plan,
    varied,
)
from tests.reference import explorers as reference
from tests.reference.scenes import drawn, seeds

SHAPES = st.sampled_from([(17, 11), (31, 14)])


def number(plan, place):
    return np.int32(np.ravel_multi_index(place, plan.shape))


def crossed(first, second):
    """The cells strictly between two that the line between their centres leads through the inside of."""
    x, y = np.abs(np.subtract(second, first)).tolist()
    count = 8 * max(x, 1) * max(y, 1)  # faces are met at least 1/(2xy) of the line apart
    shares = (np.arange(count) + 0.5) / count
    points = np.array(first) + 0.5 + shares[:, None] * (np.array(second) - np.array(first))
    return {*map(tuple, np.floor(points).astype(int).tolist())} - {tuple(first), tuple(second)}


def through_a_corner(first, second):
    """Whether the line between the centres of two cells meets corners of cells, where casts may differ."""
    x, y = (abs(int(b - a)) for a, b in zip(first, second, strict=True))
    return x // math.gcd(x, y) % 2 == 1 and y // math.gcd(x, y) % 2 == 1


def niche():
    """(20, 9) a hall of two rows, and off its middle a niche of which the end is unknown."""
    plan = np.full((20, 9), reference.WALL, np.int8)
    plan[1:19, 3:5] = reference.FREE
    plan[10, 5:7] = reference.FREE
    plan[10, 7] = reference.UNKNOWN
    return plan


@given(SHAPES, seeds)
@drawn(40)
def test_visible_is_what_a_line_through_known_free_cells_reaches(shape, seed):
    rng = np.random.default_rng(seed)
    plan, robot = random_plan(shape, rng)
    frontiers = scene_of(plan, robot).cells._blocks
    free = np.argwhere(plan == reference.FREE)
    unknown = np.argwhere(plan == reference.UNKNOWN)
    if len(unknown) == 0:
        return
    for place, voxel in zip(rng.choice(free, 12), rng.choice(unknown, 12), strict=True):
        if through_a_corner(place, voxel):
            continue
        apart = float(np.linalg.norm(place - voxel))
        wanted = all(plan[at] == reference.FREE for at in crossed(place, voxel))
        assert is_visible(frontiers, number(plan, place), number(plan, voxel), 100.0) == wanted
        assert not is_visible(frontiers, number(plan, place), number(plan, voxel), apart - 0.01)


def unseen_around(plan, place):
    """The unknown cells beside frontier cells at most three cells off."""
    edges = set(reference.frontier_cells(plan))
    sides = ((1, 0), (-1, 0), (0, 1), (0, -1))
    return sorted(
        (int(x), int(y))
        for x, y in np.argwhere(plan == reference.UNKNOWN)
        if max(abs(x - place[0]), abs(y - place[1])) <= 3 and any((x + i, y + j) in edges for i, j in sides)
    )


@given(SHAPES, seeds)
@drawn(60)
def test_a_viewing_place_makes_the_way_over_it_shortest_of_all_that_see_the_same(shape, seed):
    rng = np.random.default_rng(seed)
    plan, robot = random_plan(shape, rng)
    scene, rule = scene_of(plan, robot), varied(SharedTour(), opening=1.0)
    goal = rule.pick(scene)
    assert goal.target == Tour().pick(scene_of(plan, robot))
    if goal.target == NONE:
        return
    unseen = scene.cells.unseen_around(goal.target, 3)
    assert sorted(cell(plan, voxel) for voxel in unseen) == unseen_around(plan, cell(plan, goal.target))
    ways, seeing = reference.lengths_from(plan, robot), np.zeros(shape, bool)
    tour = rule.tour_among(scene, *scene.paths.all_frontiers(scene.here))
    if len(tour) > 1:
        ways = ways + reference.lengths_from(plan, cell(plan, tour[1]))
    frontiers, reach = scene.cells._blocks, 0.5 * scene.cells.reach
    for place in np.argwhere(np.isfinite(ways)):
        at = number(plan, place)
        visible = [is_visible(frontiers, at, voxel, reach) for voxel in unseen]
        seeing[tuple(place)] = len(visible) > 0 and all(visible)
    assert goal.looked == bool(seeing[robot])
    if seeing[robot] or goal.place == goal.target:
        assert goal.place == goal.target
        assert seeing[robot] or ways[seeing].min(initial=np.inf) >= ways[cell(plan, goal.target)] - 1e-5
    else:
        assert seeing[cell(plan, goal.place)]
        assert ways[cell(plan, goal.place)] == pytest.approx(ways[seeing].min())
        assert ways[cell(plan, goal.place)] < ways[cell(plan, goal.target)]


def test_a_robot_looks_into_a_pocket_from_where_its_end_is_visible_by_hand():
    plan = niche()
    goal = SharedTour().pick(scene_of(plan, (2, 4)))
    assert cell(plan, goal.target) == (10, 6)
    # A line from (9, 3), the best place beside column 10, would lead through the jamb (9, 5).
    assert cell(plan, goal.place) == (10, 4)
    plan[9, 5] = plan[11, 5] = reference.FREE
    assert cell(plan, SharedTour().pick(scene_of(plan, (2, 4))).place)[0] == 9


def test_from_a_viewing_place_and_without_pockets_a_robot_drives_to_the_cell_itself():
    plan = niche()
    target = number(plan, (10, 6))
    assert SharedTour().pick(scene_of(plan, (10, 3))) == Goal(target, target, looked=True)
    assert varied(SharedTour(), opening=0.0).pick(scene_of(plan, (2, 4))) == Goal(target, target)
    assert varied(SharedTour(), view=0.0).pick(scene_of(plan, (2, 4))) == Goal(target, target)


def test_between_scans_a_robot_stops_where_all_is_is_visible():
    plan = niche()
    scene = scene_of(plan, (10, 3))
    scene.view.since_scan_m = 0.2  # type: ignore[misc]
    assert SharedTour().pick(scene) == Goal(number(plan, (10, 6)), number(plan, (10, 3)))


def test_a_robot_that_has_looked_keeps_going_to_the_cell():
    plan = niche()
    target = int(number(plan, (10, 6)))
    scene = scene_of(plan, (2, 4), target)
    scene.looked = target
    assert SharedTour().pick(scene) == Goal(target, target, looked=True)


@pytest.mark.parametrize("wide", [0, 1])
def test_an_opening_is_of_as_many_edges_as_an_eighth_of_the_range(wide):
    plan = np.full((30, 20), reference.WALL, np.int8)
    plan[1:29, 3:5] = reference.FREE
    few = math.ceil(scene_of(plan, (2, 4)).cells.reach / 8)
    across = few - 1 + wide
    plan[12 : 12 + across, 5:7] = reference.FREE
    plan[12 : 12 + across, 7] = reference.UNKNOWN
    goal = SharedTour().pick(scene_of(plan, (2, 4)))
    assert goal.target != NONE
    assert (goal.place == goal.target) == (wide == 1)


class Walk:
    """Moves a robot by hand: a belief, a voxel in which it stands, and how its drive ended."""

    def __init__(self, plan):
        self.plan, self.rule = plan, SharedTour()
        self.scenario = scenario_of(plan.shape)
        self.mean, self.precision = belief_of_plan(plan)
        self.rule.reset(self.scenario, np.random.default_rng(0))
        self.goes((2, 4))  # the first call looks around

    def goes(self, place, move_end=MoveEnd.ARRIVED, since_scan_m=0.0):
        """The cell to which the robot is sent that stands in a place."""
        centre = self.scenario.grid.centre_of(np.array([*place, 0]))
        view = SimpleNamespace(
            mean=self.mean,
            precision=self.precision,
            scenario=self.scenario,
            kind=self.scenario.kind_of(0),
            teammates={},
            robot=0,
            pose=np.array([*centre, 0.0, 0.0]),
            planar=True,
            ceiling=None,
            move_end=move_end,
            under_way=since_scan_m > 0.0,
            since_scan_m=since_scan_m,
            time_s=0.0,
            scan=SimpleNamespace(utility_bits=np.ones(1)),
        )
        viewpoint = self.rule.choose(view)
        return cell(self.plan, np.ravel_multi_index(self.place_of(viewpoint), (*self.plan.shape, 1)))

    def place_of(self, viewpoint):
        """The voxel of a viewpoint."""
        return tuple(int(i) for i in self.scenario.grid.in_grid_units(viewpoint)[:3])

    def show_something(self, place):
        """A change of the map elsewhere."""
        self.mean[(*place, 0)], self.precision[(*place, 0)] = 0.95, 100.0


def far_niche():
    """The niche, and unknown cells far from it that no frontier cell lies beside."""
    plan = niche()
    plan[1:19, 0] = reference.UNKNOWN
    return plan


def test_where_a_look_shows_nothing_the_robot_goes_on_to_the_cell_and_does_not_come_back():
    walk = Walk(far_niche())
    assert walk.goes((2, 4)) == (10, 4)
    assert walk.goes((6, 4), since_scan_m=0.3) == (10, 4)
    assert walk.goes((10, 4)) == (10, 6)
    for step, place in enumerate([(10, 5), (10, 4), (9, 4), (9, 3)]):
        walk.show_something((1 + step, 0))
        assert walk.goes(place) == (10, 6)
    assert walk.rule._memories[0].cells.is_frontier(int(number(walk.plan, (10, 6))))


def test_where_the_drive_to_a_viewing_place_ends_early_the_robot_goes_to_the_cell_itself():
    walk = Walk(far_niche())
    assert walk.goes((2, 4)) == (10, 4)
    assert walk.goes((5, 4), MoveEnd.NO_PATH) == (10, 6)
    walk.show_something((1, 0))
    assert walk.goes((5, 4)) == (10, 6)
    memory = walk.rule._memories[0]
    assert memory.level == KNOWN_SIGMA
    walk.goes((5, 4), MoveEnd.NO_PATH)
    assert memory.level < KNOWN_SIGMA  # the cell was dropped, and no other was left at this level


def test_without_a_frontier_there_is_no_goal():
    plan = niche()
    plan[10, 7] = reference.WALL
    assert SharedTour().pick(scene_of(plan, (2, 4))) == Goal(NONE, NONE)


@pytest.mark.parametrize("radius", [0.0, 0.05])
@pytest.mark.parametrize("redecide", ["at_stop", "on_scan", 0.7])
def test_robots_with_and_without_a_body_see_everything_on_short_paths(redecide, radius):
    ending = {"seen_share": 1.0 if radius == 0.0 else 0.995, "time_limit_s": 2000.0}
    scenario = small_plan(ending=ending, robot={"body_radius_m": radius, "redecide": redecide})
    env, driven_m = EntropyExploreEnv(scenario), []
    for strategy in (Tour(), SharedTour()):
        run_mission(env, strategy, 5)
        figures = mission_figures(env.missions, 0)
        assert figures["finished"]
        driven_m.append(figures["distance_m"])
    assert driven_m[1] < 1.1 * driven_m[0]

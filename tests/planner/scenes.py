"""Plans as a robot knows them, and what its rule reads of them, for tests of rules and of the planner."""

from __future__ import annotations

import math
from types import SimpleNamespace

import numpy as np

from baselines.experiments.mission import scripted
from entropy_explore_env.belief.paths.search import new_search
from entropy_explore_env.frontiers.blocks import NONE
from entropy_explore_env.frontiers.frontier_map import FrontierConfig
from entropy_explore_env.frontiers.path_lengths import KnownPaths
from entropy_explore_env.frontiers.voxel_frontiers import BLOCK, VoxelFrontiers
from entropy_explore_env.planner.frontier_rule import Scene
from entropy_explore_env.robots.knowledge import TeammateView
from entropy_explore_env.settings.changes import with_settings
from entropy_explore_env.settings.grid import Grid
from entropy_explore_env.settings.scenarios import find_scenario
from tests.reference import explorers as reference


def random_plan(shape, rng):
    """Known free cells in patches, walls and unknown cells among them; one free cell for the robot."""
    plan = np.full(shape, reference.UNKNOWN, np.int8)
    for _ in range(int(rng.integers(2, 9))):
        low = [int(rng.integers(0, n)) for n in shape]
        wide = [int(rng.integers(2, 9)) for _ in shape]
        plan[low[0] : low[0] + wide[0], low[1] : low[1] + wide[1]] = reference.FREE
    plan[(plan == reference.FREE) & (rng.random(shape) < 0.15)] = reference.WALL
    free = np.argwhere(plan == reference.FREE)
    robot = tuple(int(i) for i in free[rng.integers(len(free))]) if len(free) else (0, 0)
    plan[robot] = reference.FREE
    return plan, robot


def belief_of_plan(plan):
    """(X, Y, 1) mean and precision that say the same."""
    mean = np.where(plan == reference.WALL, 0.95, 0.05).astype(np.float32)
    precision = np.where(plan == reference.UNKNOWN, 30.0**-2, 100.0).astype(np.float32)
    return mean[:, :, None], precision[:, :, None]


def scenario_of(shape, **robot):
    base = find_scenario("office")
    settings = {"grid": Grid((*shape, 1), 0.1), "world": "empty", "robot": {"body_radius_m": 0.0, **robot}}
    return with_settings(base, settings)


def scene_of(plan, robot, target=NONE, block=BLOCK):
    """What a robot there knows of a plan."""
    scenario = scenario_of(plan.shape)
    mean, precision = belief_of_plan(plan)
    view = SimpleNamespace(
        mean=mean, precision=precision, scenario=scenario, teammates={}, robot=0, since_scan_m=0.0
    )
    spacing_m = block * scenario.grid.voxel_size_m
    cells = VoxelFrontiers(scenario, scenario.kind_of(0), FrontierConfig(spacing_m=spacing_m))
    cells.update(view, 0.5)  # type: ignore[arg-type]
    paths = KnownPaths(scenario, scenario.kind_of(0), cells, new_search(scenario.grid.voxels))
    here = int(np.ravel_multi_index(robot, plan.shape))
    paths.start(here)
    return Scene(view, cells, paths, here, target)  # type: ignore[arg-type]


def varied(rule, **settings):
    """The rule with other settings than those of its class."""
    for name, value in settings.items():
        assert hasattr(rule, name)
        setattr(rule, name, value)
    return rule


def cell(plan, voxel):
    x, y = np.unravel_index(voxel, plan.shape)
    return int(x), int(y)


def corridor():
    """(30, 3) a straight corridor, known from cell 1 to cell 27 and open at both ends."""
    plan = np.full((30, 3), reference.WALL, np.int8)
    plan[1:28, 1] = reference.FREE
    plan[0, 1] = plan[28:, 1] = reference.UNKNOWN
    return plan


def pose_in(place):
    """(5,) in the middle of a cell."""
    return np.array([0.1 * (place[0] + 0.5), 0.1 * (place[1] + 0.5), 0.05, 0.0, 0.0])


def mate(place, target=None):
    """A teammate that was heard in a cell just now; under way to another, if that is given."""
    announced_s = -1.0 if target is None else 5.0
    viewpoint = pose_in(place if target is None else target)
    return TeammateView(4.0, pose_in(place), announced_s, viewpoint, 0.0, 0.0)


def with_mates(scene, mates):
    scene.view.time_s = 5.0
    scene.view.teammates = dict(enumerate(mates, start=1))
    return scene


def small_plan(**settings):
    """A part of a cluttered hall, for a point robot that decides at every scan under way."""
    base = with_settings(scripted(find_scenario("cluttered")), {"grid": Grid((70, 60, 1), 0.1)})
    changes = {
        "robots": 1,
        "robot": {"reach_m": math.inf, "body_radius_m": 0.0, "redecide": "on_scan"},
        "sensor": {"max_range_m": 1.5, "angular_step_rad": math.pi / 90, "scan_every_m": 0.2},
        "ending": {"sigma_end": 1e-3, "time_limit_s": 2000.0},
        "track_truth": True,
    }
    return with_settings(base, {**changes, **settings})

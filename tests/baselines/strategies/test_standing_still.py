"""Robots that start close to each other where they cannot pass map or keep moving, whatever the strategy.

Once two robots 0.7 m apart stood for a whole mission, 810 of 811 moves blocked by each other's bodies.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import NamedTuple

import numpy as np
import pytest

from baselines.experiments.mission import run_mission, scripted
from baselines.strategies import STRATEGIES, make_strategy
from baselines.strategies.allocation import ExplorationConfig
from baselines.strategies.protocol import Strategy
from baselines.strategies.rules.per_time_visibility import PerTimeVisibility
from entropy_explore_env.envs.parallel_env import EntropyExploreEnv
from entropy_explore_env.robots.motion import MoveEnd
from entropy_explore_env.settings.changes import with_settings
from entropy_explore_env.settings.grid import Grid
from entropy_explore_env.settings.scenario import Scenario
from entropy_explore_env.settings.scenarios import CAVE, OFFICE
from entropy_explore_env.worlds.load import load_world
from entropy_explore_env.worlds.world import World
from tests.public_worlds import needs_public_worlds


class Maze(NamedTuple):
    """Cells in which one path leads from each to each other; two robots cannot pass each other in it."""

    scenario: Scenario
    """Whose robots and sensors are in it, their bodies 0.3 m in radius."""
    cells: tuple[int, int]
    """Along x and y."""
    voxel_size_m: float
    pitch: int
    """Voxels from one cell to the next."""
    free: int
    """Width of corridors, voxels; in volumes also their height."""
    layers: int
    reach_m: float

    @property
    def grid(self) -> Grid:
        """A wall all around, a voxel wider than that between two cells."""
        x, y = (cells * self.pitch + self.wall for cells in self.cells)
        return Grid((x, y, self.layers), self.voxel_size_m)

    @property
    def wall(self) -> int:
        """Voxels between two corridors."""
        return self.pitch - self.free


MAZES = {
    "corridors": Maze(OFFICE, (5, 4), 0.1, 12, 9, 1, 3.0),
    "tunnels": Maze(CAVE, (3, 3), 0.3, 5, 3, 5, 2.0),
}
"""Of ground robots with a lidar, and of flying ones with cameras."""
LIMIT_S, STILL_S = 150.0, 60.0
STILL_IN_A_ROW_S = 90.0
"""Of one of four robots in a row where none can pass, while others map: 77 s were seen with a random walk."""
MOVED_M, GAINED_BITS = 0.2, 100.0
"""A robot that does neither for STILL_S stands still."""


class Stand(NamedTuple):
    """How long robots of one mission neither moved nor gained anything."""

    robot_s: float
    """Any of them, at most."""
    team_s: float
    """All of them at the same time, at most."""
    stopped: int
    """Drives that a teammate's body stopped."""


def world_of(maze: Maze, rng: np.random.Generator) -> World:
    """A world of a maze (depth first)."""
    occupied = np.ones(maze.grid.shape, bool)
    stack, seen = [(0, 0)], {(0, 0)}
    _open(maze, occupied, (0, 0), (0, 0))
    while stack:
        x, y = stack[-1]
        around = [(x + 1, y), (x - 1, y), (x, y + 1), (x, y - 1)]
        free = [
            c for c in around if c not in seen and 0 <= c[0] < maze.cells[0] and 0 <= c[1] < maze.cells[1]
        ]
        if not free:
            stack.pop()
            continue
        following = free[int(rng.integers(len(free)))]
        _open(maze, occupied, (x, y), following)
        seen.add(following)
        stack.append(following)
    return World(maze.grid, occupied, name="maze")


def _open(maze: Maze, occupied: np.ndarray, cell: tuple[int, int], other: tuple[int, int]) -> None:
    low = np.minimum(cell, other) * maze.pitch + maze.wall
    high = np.maximum(cell, other) * maze.pitch + maze.wall + maze.free
    floor = 0 if maze.grid.flat else 1
    occupied[low[0] : high[0], low[1] : high[1], floor : floor + maze.free] = False


def close_starts(world: World, robots: int, rng: np.random.Generator) -> np.ndarray:
    """(A, 5) poses in a row along corridors, 0.7 m apart or as near to that as they fit."""
    edge_m, reach = world.grid.voxel_size_m, 3 if world.grid.flat else 1
    free = np.argwhere(~world.occupied)
    beside = [tuple(slice(max(at - reach, 0), at + reach + 1) for at in voxel) for voxel in free]
    roomy = [voxel for voxel, around in zip(free, beside, strict=True) if not world.occupied[around].any()]
    places = (np.array(roomy) + 0.5) * edge_m
    chosen = [places[int(rng.integers(len(places)))]]
    while len(chosen) < robots:
        gaps = np.linalg.norm(places[:, None] - np.array(chosen)[None], axis=-1).min(axis=1)
        chosen.append(places[int(np.argmin(np.where(gaps >= 0.7, gaps, np.inf)))])
    starts = np.zeros((robots, 5))
    starts[:, :3] = chosen
    starts[:, 3] = rng.uniform(-np.pi, np.pi, robots)
    return starts


def stand_of(
    kind: str, strategy: str | Callable[[], Strategy], robots: int, seed: int, **changes: object
) -> Stand:
    """How long robots stand in a maze with close starts.

    Args:
        kind: Name of a maze.
        strategy: Name.
        robots: Team size.
        seed: Of maze, starts and mission.
        changes: Other settings of the scenario.
    """
    rng, maze = np.random.default_rng(seed), MAZES[kind]
    world = world_of(maze, rng)
    settings = {
        "grid": maze.grid,
        "robots": robots,
        "ending": {"time_limit_s": LIMIT_S},
        "robot": {"reach_m": maze.reach_m},
    }
    env = EntropyExploreEnv(with_settings(with_settings(scripted(maze.scenario), settings), changes))
    since = np.zeros(robots)
    places, gained = np.full((robots, 3), np.inf), np.zeros(robots)
    longest, all_of_them, stopped = 0.0, 0.0, 0

    def note(env: EntropyExploreEnv) -> None:
        nonlocal longest, all_of_them, stopped
        state = env.missions.state
        time_s, here = float(state.missions[0]["time_s"]), state.robots[0]["origin"][:, :3]
        bits = state.robots[0]["gained_bits"]
        active = np.linalg.norm(here - places, axis=1) >= MOVED_M
        active |= bits - gained >= GAINED_BITS
        places[active], gained[active], since[active] = here[active], bits[active], time_s
        longest = max(longest, float((time_s - since).max()))
        all_of_them = max(all_of_them, float((time_s - since).min()))
        stopped += int((state.robots[0]["move_end"] == MoveEnd.TEAMMATE.code).sum())

    options = {"world": world, "starts": close_starts(world, robots, rng)}
    made = make_strategy(strategy) if isinstance(strategy, str) else strategy()
    run_mission(env, made, seed, note, options=options)
    return Stand(longest, all_of_them, stopped)


@pytest.mark.parametrize("kind", MAZES)
@pytest.mark.parametrize("strategy", STRATEGIES)
def test_robots_that_start_close_to_each_other_keep_moving(strategy, kind):
    for robots in (2, 3) if kind == "corridors" else (4,):
        assert stand_of(kind, strategy, robots, seed=robots).robot_s < STILL_S


NO_PROMISES = partial(PerTimeVisibility, ExplorationConfig(metric="nearest", promises=False))
ONCE_STOOD: list[tuple[str, str | Callable[[], Strategy], int, int]] = [
    # For 74, 71, 78 and 42 s, each in the way of the next.
    ("corridors", partial(PerTimeVisibility, ExplorationConfig(metric="coordinated")), 4, 7),
    ("corridors", NO_PROMISES, 4, 9),
    ("corridors", NO_PROMISES, 4, 13),
    ("corridors", PerTimeVisibility, 4, 8),
    # For 113 s: neither had seen the tunnel behind itself, nor turned to see it.
    ("tunnels", "least-mapped", 4, 39),
    # For 70, 91 and 120 s: one looked through its teammate for bits that never came, others drove to a place
    # on the far side of it that they had not dropped.
    ("tunnels", "planned-rate", 2, 84),
    ("tunnels", "receding-horizon", 2, 137),
    ("tunnels", "receding-horizon", 2, 182),
    # For 87 s, each scanning for ever from the centre of its Voronoi cell.
    ("tunnels", "voronoi", 2, 3),
]
"""Maze, strategy, robots and seed."""


@pytest.mark.parametrize(("kind", "strategy", "robots", "seed"), ONCE_STOOD)
def test_robots_do_not_stand_where_they_once_stood(kind, strategy, robots, seed):
    assert stand_of(kind, strategy, robots, seed).robot_s < 20.0


def test_a_start_from_which_two_robots_once_stood_for_the_whole_mission():
    """0.7 m apart in a dungeon; with another rule one of them drove 0.2 m in 1,200 s."""
    needs_public_worlds("dungeon-20")
    world = load_world("dungeon-20")
    settings = {"robots": 2, "start_radius_m": 0.9, "ending": {"time_limit_s": 1200.0}}
    env = EntropyExploreEnv(with_settings(scripted(OFFICE), {**settings, "grid": world.grid}))
    run_mission(env, make_strategy("planned-rate"), 20, options={"world": world})
    state = env.missions.state
    assert state.missions[0]["time_s"] < 600.0
    assert (state.robots[0]["distance_m"] > 50.0).all()


@pytest.mark.parametrize("strategy", ["nearest-frontier", "distance-advantage", "tour"])
def test_explorers_whose_bodies_block_each_other_part_when_they_replan_under_way(strategy):
    """Two in corridors that are too narrow to pass: bodies stop them, and both map on."""
    under_way = {"robot": {"redecide": "on_scan"}, "sensor": {"scan_every_m": 0.3}}
    stand = stand_of("corridors", strategy, 2, 2, **under_way)
    assert stand.stopped > 0 and stand.robot_s < STILL_S


@pytest.mark.long
@pytest.mark.parametrize("kind", MAZES)
@pytest.mark.parametrize("robots", [2, 4])
@pytest.mark.parametrize("strategy", STRATEGIES)
def test_robots_of_200_close_starts_keep_moving(strategy, robots, kind):
    robot_s, team_s = STILL_IN_A_ROW_S if robots == 4 else STILL_S, STILL_S
    stands = [stand_of(kind, strategy, robots, seed) for seed in range(200)]
    assert [seed for seed, at in enumerate(stands) if at.robot_s >= robot_s or at.team_s >= team_s] == []

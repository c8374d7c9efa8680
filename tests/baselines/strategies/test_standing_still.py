"""Robots that start close to each other in narrow corridors map or keep moving, whatever the strategy.

Once two robots 0.7 m apart stood for a whole mission, 810 of 811 moves blocked by each other's bodies.
"""

from __future__ import annotations

import numpy as np
import pytest

from baselines.experiments.mission import run_mission, scripted
from baselines.strategies import STRATEGIES, make_strategy
from entropy_explore_env.envs.parallel_env import EntropyExploreEnv
from entropy_explore_env.robots.motion import MoveEnd
from entropy_explore_env.scenario import with_settings
from entropy_explore_env.scenarios import OFFICE
from entropy_explore_env.settings import Grid
from entropy_explore_env.worlds.world import World

CELLS, PITCH, OPEN = (5, 4), 12, 9
"""Cells of a maze along x and y, voxels of 0.1 m from one to the next, and how wide corridors are: two robots
of 0.3 m radius cannot pass each other."""
GRID = Grid((CELLS[0] * PITCH + 3, CELLS[1] * PITCH + 3, 1), 0.1)
LIMIT_S, STILL_S = 150.0, 60.0
MOVED_M, GAINED_BITS = 0.2, 100.0
"""A robot that does neither for STILL_S stands still."""


def maze(rng: np.random.Generator) -> World:
    """A maze in which one path leads from each cell to each other (depth first)."""
    occupied = np.ones(GRID.shape, bool)
    stack, seen = [(0, 0)], {(0, 0)}
    _open(occupied, (0, 0), (0, 0))
    while stack:
        x, y = stack[-1]
        around = [(x + 1, y), (x - 1, y), (x, y + 1), (x, y - 1)]
        free = [c for c in around if c not in seen and 0 <= c[0] < CELLS[0] and 0 <= c[1] < CELLS[1]]
        if not free:
            stack.pop()
            continue
        following = free[int(rng.integers(len(free)))]
        _open(occupied, (x, y), following)
        seen.add(following)
        stack.append(following)
    return World(GRID, occupied, name="maze")


def _open(occupied: np.ndarray, cell: tuple[int, int], other: tuple[int, int]) -> None:
    low, high = np.minimum(cell, other) * PITCH + 3, np.maximum(cell, other) * PITCH + 3 + OPEN
    occupied[low[0] : high[0], low[1] : high[1]] = False


def close_starts(world: World, robots: int, rng: np.random.Generator) -> np.ndarray:
    """(A, 5) poses in a row along corridors, 0.7 m apart or as near to that as they fit."""
    free = np.argwhere(~world.occupied[:, :, 0])
    roomy = [c for c in free if not world.occupied[c[0] - 3 : c[0] + 4, c[1] - 3 : c[1] + 4].any()]
    places = np.array(roomy) * 0.1 + 0.05
    chosen = [places[int(rng.integers(len(places)))]]
    while len(chosen) < robots:
        gaps = np.linalg.norm(places[:, None] - np.array(chosen)[None], axis=-1).min(axis=1)
        chosen.append(places[int(np.argmin(np.where(gaps >= 0.7, gaps, np.inf)))])
    starts = np.zeros((robots, 5))
    starts[:, :2], starts[:, 2] = chosen, 0.05
    starts[:, 3] = rng.uniform(-np.pi, np.pi, robots)
    return starts


def longest_stand_s(strategy: str, robots: int, seed: int, **changes: object) -> float:
    """The longest time that a robot neither moves nor gains anything, in a maze with close starts."""
    return stand_of(strategy, robots, seed, **changes)[0]


def stand_of(strategy: str, robots: int, seed: int, **changes: object) -> tuple[float, int]:
    """As `longest_stand_s`; and how many drives a teammate's body stopped.

    Args:
        strategy: Name.
        robots: Team size.
        seed: Of maze, starts and mission.
        changes: Other settings of the scenario.
    """
    rng = np.random.default_rng(seed)
    world = maze(rng)
    settings = {
        "grid": GRID,
        "robots": robots,
        "ending": {"time_limit_s": LIMIT_S},
        "robot": {"reach_m": 3.0},
    }
    env = EntropyExploreEnv(with_settings(with_settings(scripted(OFFICE), settings), changes))
    since = np.zeros(robots)
    places, gained, longest = np.full((robots, 3), np.inf), np.zeros(robots), 0.0
    stopped = 0

    def note(env: EntropyExploreEnv) -> None:
        nonlocal longest, stopped
        state = env.missions.state
        time_s, here = float(state.missions[0]["time_s"]), state.robots[0]["origin"][:, :3]
        bits = state.robots[0]["gained_bits"]
        active = np.linalg.norm(here - places, axis=1) >= MOVED_M
        active |= bits - gained >= GAINED_BITS
        places[active], gained[active], since[active] = here[active], bits[active], time_s
        longest = max(longest, float((time_s - since).max()))
        stopped += int((state.robots[0]["move_end"] == MoveEnd.TEAMMATE.code).sum())

    options = {"world": world, "starts": close_starts(world, robots, rng)}
    run_mission(env, make_strategy(strategy), seed, note, options=options)
    return longest, stopped


@pytest.mark.parametrize("strategy", STRATEGIES)
def test_robots_that_start_close_to_each_other_keep_moving(strategy):
    for robots in (2, 3):
        assert longest_stand_s(strategy, robots, seed=robots) < STILL_S


@pytest.mark.parametrize("strategy", ["nearest-frontier", "distance-advantage", "tour"])
def test_explorers_whose_bodies_block_each_other_part_when_they_replan_under_way(strategy):
    """Two in corridors that are too narrow to pass: bodies stop them, and both map on."""
    under_way = {"robot": {"redecide": "on_scan"}, "sensor": {"scan_every_m": 0.3}}
    stood_s, stopped = stand_of(strategy, 2, 2, **under_way)
    assert stopped > 0 and stood_s < STILL_S


@pytest.mark.long
@pytest.mark.parametrize("robots", [2, 4])
@pytest.mark.parametrize("strategy", STRATEGIES)
def test_robots_of_200_close_starts_keep_moving(strategy, robots):
    stood = [seed for seed in range(200) if longest_stand_s(strategy, robots, seed) >= STILL_S]
    assert stood == []

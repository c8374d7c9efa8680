"""What exploring plans costs: a step with a dense scanner, a decision, expected visibility, a mission."""

from __future__ import annotations

import math
import time

import numpy as np

from baselines.experiments.mission import scripted
from baselines.papers.sawhney.mission import Run, explore_until_done
from baselines.papers.sawhney.sweep import world_cell
from baselines.strategies.allocation import Allocator
from baselines.strategies.metrics import Metric
from baselines.strategies.rules.per_time_visibility import PerTimeVisibility
from benchmarks.planning import FLOOR, cluttered
from benchmarks.rows import Effort, Goal, Row, alone, compared, timed
from entropy_explore_env.belief.paths.search import new_search
from entropy_explore_env.envs.parallel_env import EntropyExploreEnv
from entropy_explore_env.frontiers.blocks import COVERED, NONE, UNEXPLORED, UNMAPPED
from entropy_explore_env.frontiers.frontier_map import KNOWN_SIGMA, FrontierConfig
from entropy_explore_env.frontiers.knowledge import voxel_of
from entropy_explore_env.frontiers.path_lengths import KnownPaths
from entropy_explore_env.frontiers.ray_tree import grow_tree, rays_around
from entropy_explore_env.frontiers.visibility import count_from, new_counter
from entropy_explore_env.frontiers.voxel_frontiers import VoxelFrontiers
from entropy_explore_env.missions.simulation import Missions
from entropy_explore_env.missions.view import view_of
from entropy_explore_env.planner.scene import Scene
from entropy_explore_env.scenario import Scenario, with_settings
from entropy_explore_env.scenarios import find_scenario
from entropy_explore_env.settings import Grid
from entropy_explore_env.worlds.world import World

PUBLISHED_STEPS_S = 10.0
"""Steps a second measured of a published 2-D exploration environment (ARiADNE's sensor)."""
_STEP_GOAL = 500.0 * PUBLISHED_STEPS_S
_SIDE = 1000
_ROOM, _DOOR = 50, 6
"""Voxels along a room and a door of the large plan."""
_PLACES = 200
_FLOOR_SHARE, _FLOOR_EDGE_M = 0.16, 0.03
_WARM = (90, 70, 1)


def exploring_rows(effort: Effort) -> list[Row]:
    """A step with 720 rays on 480 × 640, decisions on large plans, expected visibility, a whole mission."""
    decisions = [decision_row(effort), larger_row(effort)]
    return [step_row(effort), *decisions, visibility_row(effort), floor_row(effort)]


def dense_plan() -> Scenario:
    """480 × 640 cells of clutter, a scanner of 720 rays all around."""
    sensor = {"field_of_view_rad": (2 * math.pi, 0.0), "angular_step_rad": math.pi / 360, "max_range_m": 8.0}
    settings = {"grid": Grid((480, 640, 1), 0.1), "robots": 1, "sensor": sensor, "robot": {"reach_m": 0.5}}
    settings |= {"time_limit_s": 1e6}
    return with_settings(scripted(find_scenario("cluttered")), settings)


def step_row(effort: Effort) -> Row:
    """Steps a second of an environment whose robot scans 720 rays in each."""
    env = EntropyExploreEnv(with_settings(dense_plan(), {"robot": {"navigator": "straight"}}))
    rng, rates = np.random.default_rng(0), []

    def work() -> None:
        for _ in range(effort.steps):
            env.step({agent: rng.uniform(-1, 1, 3).astype(np.float32) for agent in env.agents})

    for start in range(effort.long_rounds + 1):  # the first one compiles
        env.reset(seed=start)
        rates.append(effort.steps / timed(work).cpu_s)
    rates = rates[1:]
    job = f"ParallelEnv.step, 720 rays all around up to 8 m, 480 × 640 (published: {PUBLISHED_STEPS_S:g}/s)"
    return alone(job, rates, "steps/s", Goal("≥", _STEP_GOAL, "steps/s"))


def rooms_plan(side: int = _SIDE) -> tuple[Scenario, np.ndarray]:
    """1000 × 1000 cells in rooms with doors, or another square, and (X, Y, Z) bool what is solid."""
    solid = np.zeros((side, side, 1), bool)
    solid[::_ROOM] = solid[:, ::_ROOM] = solid[-1] = solid[:, -1] = True
    for wall in range(_ROOM, side, _ROOM):
        for room in range(0, side, _ROOM):
            door = slice(room + _ROOM // 2, room + _ROOM // 2 + _DOOR)
            solid[wall, door] = solid[door, wall] = False
    settings = {
        "grid": Grid((side, side, 1), 0.1),
        "robots": 1,
        "robot": {"reach_m": math.inf, "body_radius_m": 0.0},
        "sensor": {"max_range_m": 3.0},
    }
    return with_settings(scripted(find_scenario("cluttered")), settings), solid


class Deciding:
    """Decisions among some 200 candidates, 500 × 1000 cells of a plan known, the others not.

    Between decisions the robot scans: a decision takes the new belief in, searches paths, and counts V as far
    as the choice needs it.
    """

    def __init__(self, side: int = _SIDE) -> None:
        """Prepare the plan."""
        scenario, solid = rooms_plan(side)
        self._missions, self._scans = _half_known(scenario, solid), 0
        self._view, kind = view_of(self._missions, 0, 0), scenario.kind_of(0)
        here = voxel_of(self._view, self._view.pose)
        self.candidates = VoxelFrontiers(scenario, kind, FrontierConfig(spacing_m=3.0))
        paths = KnownPaths(scenario, kind, self.candidates, new_search(scenario.grid.voxels))
        self._scene = Scene(self._view, self.candidates, paths, here, NONE)

    def decide_ms(self) -> float:
        """Milliseconds of the next decision."""
        precision, mean, scan = self._missions.precision[0, 0], self._missions.mean[0, 0], self._scans % 20
        self._scans += 1
        wall = 450, 405 + self._scans % 90  # a voxel of it turns out free
        mean[wall], precision[wall] = 0.1, precision[wall] + 1.0
        precision[455 + scan : 475 + scan, 455:475] += 1.0
        mean[500 + scan, 400:420], precision[500 + scan, 400:420] = 0.1, 100.0 + self._scans
        started = time.thread_time()
        self.candidates.update(self._view, KNOWN_SIGMA)
        self._scene.paths.start(self._scene.here)
        Allocator(self._scene, Metric()).allocate([], [])
        return 1e3 * (time.thread_time() - started)


def _half_known(scenario: Scenario, solid: np.ndarray) -> Missions:
    """A mission in which 500 × 1000 cells of a plan are known, but for patches."""
    missions = Missions(scenario, given=[World(scenario.grid, solid, "rooms")])
    missions.reset(0, 0)
    known = np.zeros(solid.shape, bool)
    known[: _SIDE // 2, :_SIDE] = True
    rng = np.random.default_rng(0)
    for x, y in rng.integers(0, _SIDE // 2, (170, 2)):  # and patches of it unknown
        known[x : x + 8, y : y + 8] = False
    missions.mean[0, 0] = np.where(known, solid, 0.5)
    missions.precision[0, 0] = np.where(known, 100.0, scenario.sigma_prior**-2)
    missions.state.robots[0, 0]["goal"][:2] = missions.state.robots[0, 0]["origin"][:2] = 46.0
    return missions


def decision_row(effort: Effort) -> Row:
    """Milliseconds a decision on 1000 × 1000 cells."""
    deciding = Deciding()
    taken = [deciding.decide_ms() for _ in range(effort.rounds + 2)]
    count = len(deciding.candidates.listed()[0])
    job = f"a decision of per-time-visibility, 1000 × 1000, {count} candidates, as far as the choice needs"
    return alone(job, taken[2:], "ms", Goal("<", 50.0, "ms"))


def larger_row(effort: Effort) -> Row:
    """The same in a map of four times as many cells, of which as much is known and as much changes."""
    small, large = Deciding(), Deciding(2 * _SIDE)
    ours, theirs = np.array([(large.decide_ms(), small.decide_ms()) for _ in range(effort.rounds + 2)])[2:].T
    job = "a decision of per-time-visibility, 2000 × 2000, as much known and changed"
    return compared(job, "1000 × 1000", ours.tolist(), theirs.tolist(), "ms")


def visibility_row(effort: Effort) -> Row:
    """Million rays a second of expected visibility on the same plan, 3 m far."""
    _, solid = rooms_plan()
    shape, rng = solid.shape, np.random.default_rng(0)
    state = np.where(solid, COVERED, 0).astype(np.uint8)
    state[rng.random(shape) < 0.5] |= UNEXPLORED | UNMAPPED
    state[solid] = COVERED
    free = np.flatnonzero(~solid)
    voxels = rng.choice(free, _PLACES).astype(np.int32)
    directions, counter = rays_around(30.0, np.zeros(1)), new_counter(state.size, shape)
    tree = grow_tree(directions, 30.0, shape)
    met = np.empty(tree.cells, np.int32)
    seen, weighed = np.empty(_PLACES), np.empty(_PLACES)

    def work() -> None:
        count_from(counter, state.reshape(-1), shape, voxels, tree, met, seen, weighed)

    work()
    rays = 1e-6 * _PLACES * len(directions)
    rates = [rays / timed(work).cpu_s for _ in range(effort.rounds)]
    job = "expected visibility, rays up to 30 voxels, 1000 × 1000"
    return alone(job, rates, "Mray/s", Goal("≥", 5.0, "Mray/s"))


def floor_row(effort: Effort, shape: tuple[int, int, int] = FLOOR) -> Row:
    """Seconds on the clock of a mission of three robots, until no frontier is left, on a cluttered floor."""
    del effort  # a minute: once is enough
    return mission_row("a cluttered floor", _floor(shape))


def mission_row(name: str, world: World) -> Row:
    """Seconds on the clock of a mission of three robots with lasers of 10 m, until no frontier is left."""
    mission_s(_floor(_WARM))  # compiles
    across, along, _ = world.grid.shape
    job = f"a mission of 3 robots in {name}, {across} × {along} cells, to no frontier"
    return alone(job, [mission_s(world)], "s", Goal("<", 60.0, "s"))


def _floor(shape: tuple[int, int, int]) -> World:
    return World(Grid(shape, _FLOOR_EDGE_M), cluttered(shape, _FLOOR_SHARE), "floor")


def mission_s(world: World) -> float:
    """Seconds on the clock of such a mission, with the settings of Sawhney's experiment."""
    cell = world_cell("cluttered", 3, "ptv")
    assert isinstance(cell.record, Run)
    settings = {"grid": world.grid, "sensor": {"max_range_m": 10.0}, "ending": {"time_limit_s": 1e5}}
    scenario = with_settings(scripted(cell.scenario), settings)
    env, explorer = EntropyExploreEnv(scenario, world=world), PerTimeVisibility(cell.record.exploring)
    started = time.perf_counter()
    explore_until_done(env, explorer, 0)
    return time.perf_counter() - started

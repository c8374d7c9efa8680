"""Robots in worlds, many missions at once: the arrays, how they are reset, and the one tick."""

from __future__ import annotations

import math
import os
from collections.abc import Iterable, Sequence
from concurrent.futures import ThreadPoolExecutor
from typing import TypeAlias

import numpy as np

from entropy_explore_env.belief.entropy import map_entropy_bits
from entropy_explore_env.belief.map_update import PRIOR_MEAN
from entropy_explore_env.belief.pooling import fresh_sums
from entropy_explore_env.errors import CallOrderError, WorldError
from entropy_explore_env.missions.navigation import plan_missions
from entropy_explore_env.missions.observation import ObservationLayout, observation_rules, observe_mission
from entropy_explore_env.missions.rules import rules_of
from entropy_explore_env.missions.state import MissionEnd, MissionState, check_memory, new_state
from entropy_explore_env.missions.tick import mask_missions, step_missions
from entropy_explore_env.randomness import Stream, check_seed, generator, splitmix_states
from entropy_explore_env.robots.navigator import footprints, new_navigators
from entropy_explore_env.robots.range_sensor import Scan, new_scan
from entropy_explore_env.scenario import Scenario
from entropy_explore_env.settings import Grid, gaussian_entropy_bits
from entropy_explore_env.validation import check_whole
from entropy_explore_env.worlds.given import checked_worlds, in_given_worlds, world_in_turn
from entropy_explore_env.worlds.load import make_world, with_world
from entropy_explore_env.worlds.world import World

_CHUNKS_PER_THREAD = 4
"""Missions differ in work; smaller chunks even it out."""
_ENDS = list(MissionEnd)
_PLACING_ATTEMPTS = 64
"""Random places tried for a robot before all are."""
Start: TypeAlias = tuple[int, int, int, World, np.ndarray]
"""Mission, seed, episode, world and (A, 5) start poses."""


class Missions:
    """E missions of one scenario, advanced together by one compiled call.

    A single mission is a batch of one. Results do not depend on how many missions there are, on
    the number of threads, or on what other missions do.

    Attributes:
        scenario: The task, its grid taken over from the world's file, or from the worlds given.
        given: Worlds to be in, in place of the scenario's; none where it has a recipe or a file.
        count: Number of missions E.
        state: All that changes, as arrays.
        worlds: The true world of each mission; None before its first reset.
        layout: What an observation is made of.
        observations: (E, A, F) float32 of the latest step or reset.
    """

    def __init__(
        self, scenario: Scenario, count: int = 1, threads: int | None = 1, given: Sequence[World] = ()
    ) -> None:
        """Make room for the missions; `reset` starts them.

        Args:
            scenario: The task.
            count: Number of missions E.
            threads: Threads that share the missions; None = one a processor.
            given: Worlds to be in, of one grid, whatever the split: a mission of seed s starts in number
                s mod N of them, and goes on to the next one with each episode.

        Raises:
            SettingError: A count is not a whole number ≥ 1, or all maps do not fit into memory.
            WorldError: The world's file cannot be used, or the given ones differ in their grids.
        """
        for name, value in (("missions", count), ("threads", 1 if threads is None else threads)):
            check_whole(name, value, 1)
        scenario = in_given_worlds(scenario, given) if given else with_world(scenario)
        check_memory(scenario, int(count))
        self.scenario, self.given = scenario, checked_worlds(given) if given else ()
        self.count = int(count)
        self.threads = min(self.count, threads or os.cpu_count() or 1)
        self.rules = rules_of(scenario)
        self.layout = ObservationLayout(scenario)
        self._parts = observation_rules(scenario, self.layout)
        self.state: MissionState = new_state(scenario, self.count, self.rules.cells)
        self._closed = np.zeros((self.count * int(self.rules.numbers["radii"][0]), 0), np.bool_)
        self.worlds: list[World | None] = [None] * self.count
        self.seeds = [0] * self.count
        self.episodes = [-1] * self.count
        self.observations = np.zeros((self.count, scenario.robots, self.layout.size), np.float32)
        self._make_working_space()
        self._pool: ThreadPoolExecutor | None = None

    def _make_working_space(self) -> None:
        """A scan a thread and, where robots plan, navigators; what they hold is nobody's state."""
        kinds = self.scenario.kinds
        sensors, robots = [kind.sensor for kind in kinds], [kind.robot for kind in kinds]
        rays = max(sensor.rays for sensor in sensors)
        longest_m = max(math.inf if robot.navigator == "planned" else robot.reach_m for robot in robots)
        self._scans: list[Scan] = [
            new_scan(self.grid, sensors, rays, self.scenario.robots, longest_m) for _ in range(self.threads)
        ]
        self._navigators = [new_navigators(self.scenario) for _ in range(self.threads)]
        planning = self._navigators[0]
        self._balls = footprints(planning, len(kinds)) if planning else None

    @property
    def grid(self) -> Grid:
        """Voxels of the workspace."""
        return self.scenario.grid

    @property
    def mean(self) -> np.ndarray:
        """(E, A, X, Y, Z) float32 expected coverage by each robot's belief; a view."""
        return self.state.mean.reshape(self.count, self.scenario.robots, *self.grid.shape)

    @property
    def precision(self) -> np.ndarray:
        """(E, A, X, Y, Z) float32 1/σ² by each robot's belief; a view."""
        return self.state.precision.reshape(self.count, self.scenario.robots, *self.grid.shape)

    def reset(self, mission: int, seed: int | None = None) -> None:
        """Start a mission anew: world, starts and random streams drawn, beliefs at the prior.

        Args:
            mission: Which of the E.
            seed: Of all its random streams. None goes on to the next episode of the last seed.

        Raises:
            SettingError: The seed is not a whole number ≥ 0.
            WorldError: The world has too little room for the team. Nothing has changed then.
        """
        self.reset_some([mission], [seed])

    def reset_some(self, missions: Iterable[int], seeds: Sequence[int | None]) -> None:
        """Start some missions anew: all of them, or none if one cannot be; see `reset`."""
        self.begin(self.draw(missions, seeds))

    def draw(self, missions: Iterable[int], seeds: Sequence[int | None]) -> list[Start]:
        """What missions would start with after a reset; nothing changes. See `reset`."""
        return [self._draw(mission, seed) for mission, seed in zip(missions, seeds, strict=True)]

    def begin(self, drawn: Iterable[Start]) -> None:
        """Start missions with what was drawn for them."""
        for start in drawn:
            self._begin(*start)

    def _draw(self, mission: int, seed: int | None) -> Start:
        if seed is not None or self.episodes[mission] < 0:
            number, episode = check_seed(seed), 0
        else:
            number, episode = self.seeds[mission], self.episodes[mission] + 1
        if self.given:
            world = world_in_turn(self.given, number, episode)
        else:
            world = make_world(self.scenario, generator(number, episode, Stream.WORLD))
        poses = start_poses(self.scenario, world, generator(number, episode, Stream.STARTS))
        return mission, number, episode, world, poses

    def _begin(self, mission: int, number: int, episode: int, world: World, poses: np.ndarray) -> None:
        """Put the mission into its world, with beliefs at the prior, and observe."""
        self.seeds[mission], self.episodes[mission] = number, episode
        if world.ceiling is not None and self.state.blocked is self.state.truth:
            self.state = self.state._replace(blocked=self.state.truth.copy())
        state = self.state
        if world.ceiling is not None and not self._closed.size and self._navigators[0]:
            self._closed = np.zeros((len(self._closed), self.grid.voxels), np.bool_)
        if world is not self.worlds[mission]:
            self.worlds[mission] = world
            state.truth[mission] = world.occupied.ravel()
            self._set_barriers(mission, world)
        for array in state[4:]:
            array[mission] = np.zeros((), array.dtype)
        state.mean[mission] = PRIOR_MEAN
        state.precision[mission] = self.rules.numbers["prior_precision"][0]
        if self.rules.cells is not None:
            state.pooled[mission] = fresh_sums(self.rules.cells)
        if self.scenario.track_truth:
            state.joint_mean[mission] = PRIOR_MEAN
            state.joint_precision[mission] = self.rules.numbers["prior_precision"][0]
            state.visible[mission] = world.visible(self.scenario).ravel()
        state.missions[mission]["reached_s"] = -1.0
        self._set_entropies(mission, world.visible_voxels(self.scenario))
        robots = state.robots[mission]
        for field in ("origin", "goal", "target", "scan_pose"):
            robots[field] = poses
        robots["deciding"] = True
        robots["i_min_bits"] = robots["next_i_min_bits"] = self.scenario.channel.i_min_bits
        robots["sensor_chance"][:, 0] = splitmix_states(number, episode, Stream.SENSOR, len(robots))
        robots["channel_chance"][:, 0] = splitmix_states(number, episode, Stream.CHANNEL, len(robots))
        state.heard[mission]["heard_s"] = state.heard[mission]["announced_s"] = -1.0
        state.mail[mission]["due_s"] = np.inf
        out = self.observations[mission]
        observe_mission(self.rules, self._parts, state, self._scans[0], mission, out)

    def _set_barriers(self, mission: int, world: World) -> None:
        """What is in the way of the team's bodies."""
        for robot in range(min(len(self.scenario.kinds), self.scenario.robots)):
            numbers, kind = self.rules.numbers[robot], self.scenario.kind_of(robot)
            row = mission * numbers["radii"] + numbers["barriers"]
            self.state.blocked[row] = world.layout(self.scenario, kind).collision_mask.ravel()
            if self._closed.size:
                self._closed[row] = world.no_fly_mask(kind.robot.body_radius_m).ravel()

    def _set_entropies(self, mission: int, visible_voxels: int) -> None:
        """H(0) by eq. 25, and H_th: voxels that can be seen at σ_end, the others at the prior."""
        prior = np.full((1, 1, 1), self.rules.numbers["prior_precision"][0], np.float32)
        voxel_bits = float(map_entropy_bits(prior))
        known_bits = gaussian_entropy_bits(self.scenario.ending.sigma_end)
        hidden = self.grid.voxels - visible_voxels
        clock = self.state.missions[mission]
        clock["entropy_start_bits"] = clock["joint_bits"] = self.grid.voxels * voxel_bits
        clock["entropy_end_bits"] = visible_voxels * known_bits + hidden * voxel_bits
        self.state.robots[mission]["entropy_bits"] = clock["entropy_start_bits"]

    def strategy_generator(self, mission: int) -> np.random.Generator:
        """The random stream of whoever chooses the actions in this mission's episode."""
        return generator(self.seeds[mission], self.episodes[mission], Stream.STRATEGY)

    def step(self, boxes: np.ndarray, numbers: np.ndarray) -> np.ndarray:
        """Advance every mission that is not over by one step.

        Args:
            boxes: (E, A, N) float64 continuous actions; ignored where actions are discrete.
            numbers: (E, A) int64 discrete actions; ignored where they are continuous.

        Returns:
            (E, A, F) float32 observations; overwritten by the next call.

        Raises:
            CallOrderError: A mission was never reset.
        """
        if min(self.episodes) < 0:
            raise CallOrderError("step before reset: call reset() first")
        if self.threads == 1:
            self._step_range(0, 0, self.count, boxes, numbers)
        else:
            self._step_threaded(boxes, numbers)
        return self.observations

    def _step_range(self, thread: int, first: int, last: int, boxes: np.ndarray, numbers: np.ndarray) -> None:
        for kind, navigator in self._navigators[thread].items():
            plan_missions(self.rules, self.state, self._closed, navigator, kind, boxes, numbers, first, last)
        step_missions(
            self.rules,
            self._parts,
            self.state,
            self._scans[thread],
            self._balls,
            boxes,
            numbers,
            first,
            last,
            self.observations,
        )

    def _step_threaded(self, boxes: np.ndarray, numbers: np.ndarray) -> None:
        """Share the missions among threads: each takes the next chunk as soon as it is free."""
        if self._pool is None:
            self._pool = ThreadPoolExecutor(self.threads, "missions")
        size = max(1, self.count // (self.threads * _CHUNKS_PER_THREAD))
        chunks = iter(range(0, self.count, size))

        def work(thread: int) -> None:
            for first in chunks:
                self._step_range(thread, first, min(first + size, self.count), boxes, numbers)

        for done in [self._pool.submit(work, thread) for thread in range(self.threads)]:
            done.result()

    def action_masks(self) -> np.ndarray:
        """(E, A, N) int8: 1 for each discrete action that makes sense by the robot's own belief."""
        actions = len(self.rules.moves) * len(self.rules.gazes)
        masks = np.empty((self.count, self.scenario.robots, actions), np.int8)
        mask_missions(self.rules, self.state, masks)
        return masks

    def over(self, mission: int) -> MissionEnd:
        """Why the mission is over, or MissionEnd.RUNNING."""
        return _ENDS[self.state.missions["end"][mission]]

    def close(self) -> None:
        """End the threads; the missions can still be stepped."""
        if self._pool is not None:
            self._pool.shutdown()
            self._pool = None

    def __getstate__(self) -> dict[str, object]:
        """All but the threads and their scratch space."""
        kept = dict(self.__dict__)
        del kept["_pool"], kept["_scans"], kept["_navigators"], kept["_balls"]
        return kept

    def __setstate__(self, kept: dict[str, object]) -> None:
        """Take the arrays back and make new scratch space."""
        self.__dict__.update(kept)
        self._make_working_space()
        self._pool = None


def start_poses(scenario: Scenario, world: World, rng: np.random.Generator) -> np.ndarray:
    """Draw where robots start: voxel centres with room, apart from each other, any yaw, level.

    Robots are placed one after the other, so a smaller team starts like the first of a larger one;
    where the scenario says so, near the first one.

    Args:
        scenario: The task.
        world: The true world.
        rng: The stream of starts.

    Returns:
        (A, 5) float64 poses.

    Raises:
        WorldError: The bodies find no room.
    """
    grid = world.grid
    radii_m = np.array([scenario.kind_of(robot).robot.body_radius_m for robot in range(scenario.robots)])
    poses = np.zeros((scenario.robots, 5))
    for robot in range(scenario.robots):
        starts = world.layout(scenario, scenario.kind_of(robot)).starts
        if robot > 0 and scenario.start_radius_m < np.inf:
            centres = grid.centre_of(np.stack(np.unravel_index(starts, grid.shape), axis=-1))
            starts = starts[np.linalg.norm(centres - poses[0, :3], axis=1) <= scenario.start_radius_m]
        apart_m = radii_m[robot] + radii_m[:robot] + 1e-3 * grid.voxel_size_m
        tried = starts[rng.integers(len(starts), size=_PLACING_ATTEMPTS)] if len(starts) else starts
        place = _first_apart(grid, tried, poses[:robot, :3], apart_m)
        if place is None:
            place = _first_apart(grid, rng.permutation(starts), poses[:robot, :3], apart_m)
        if place is None:
            nearest_m = float(apart_m.min()) if robot else 0.0
            allowed = f"at most {robot}, for whose bodies, {nearest_m:.3g} m apart, the world has room"
            raise WorldError("Scenario.robots", scenario.robots, allowed)
        poses[robot, :3] = place
        poses[robot, 3] = rng.uniform(-np.pi, np.pi)
    return poses


def _first_apart(grid: Grid, tried: np.ndarray, taken: np.ndarray, apart_m: np.ndarray) -> np.ndarray | None:
    """(3,) centre of the first of the voxels (N,) that is as far as (K,) asks from those taken (K, 3)."""
    centres = grid.centre_of(np.stack(np.unravel_index(tried, grid.shape), axis=-1))
    gaps = np.sqrt(((centres[:, None] - taken) ** 2).sum(axis=-1))
    clear = np.flatnonzero((gaps >= apart_m).all(axis=1))
    return centres[clear[0]] if len(clear) else None

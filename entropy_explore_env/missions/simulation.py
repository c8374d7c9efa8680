"""Robots in worlds, many missions at once: the arrays, how they are reset, and a step's compiled calls."""

from __future__ import annotations

import dataclasses
import math
import os
from collections.abc import Callable, Iterable, Sequence
from typing import NamedTuple

import numpy as np

from entropy_explore_env.belief.entropy import map_entropy_bits
from entropy_explore_env.belief.map_update import PRIOR_MEAN
from entropy_explore_env.belief.pooling import fresh_sums
from entropy_explore_env.belief.raycast import Crossing
from entropy_explore_env.compilation.announcement import end_of_step
from entropy_explore_env.compilation.kernels import entry_point
from entropy_explore_env.errors import ActionError, CallOrderError, SettingError
from entropy_explore_env.missions.faults import draw_faults
from entropy_explore_env.missions.fiducials import fiducial_places
from entropy_explore_env.missions.localization import begin_estimates
from entropy_explore_env.missions.memory import Batch, check_memory
from entropy_explore_env.missions.navigation import Planning, plan_missions
from entropy_explore_env.missions.observation.layout import ObservationLayout, candidate_offsets, part_offsets
from entropy_explore_env.missions.observation.mask import mask_missions
from entropy_explore_env.missions.observation.observe import Observed, observe_missions
from entropy_explore_env.missions.proposals import Proposing, propose_missions
from entropy_explore_env.missions.redecision import CHOICE
from entropy_explore_env.missions.reset_options import DRAWN, ResetOptions
from entropy_explore_env.missions.rules import rules_of
from entropy_explore_env.missions.starts import checked_starts, start_poses
from entropy_explore_env.missions.state import MissionEnd, MissionState, new_state
from entropy_explore_env.missions.state_ranges import FROM_WORLD, check_ranges
from entropy_explore_env.missions.threads import Threads
from entropy_explore_env.missions.tick import step_missions
from entropy_explore_env.missions.workspace import Workspace, new_workspace
from entropy_explore_env.randomness import Stream, check_seed, generator, splitmix_states
from entropy_explore_env.robots.navigator import new_navigators
from entropy_explore_env.robots.range_sensor import true_coverage
from entropy_explore_env.scenario import Scenario
from entropy_explore_env.settings import Grid, gaussian_entropy_bits
from entropy_explore_env.validation import check_instance, check_whole, is_whole
from entropy_explore_env.viewpoints.proposals.model import Proposer, new_proposers, thinned
from entropy_explore_env.viewpoints.proposals.records import Kind
from entropy_explore_env.worlds.given import checked_worlds, in_given_worlds, world_in_turn
from entropy_explore_env.worlds.load import make_world, require_unchanged, world_of_file
from entropy_explore_env.worlds.splits import draw_world_number
from entropy_explore_env.worlds.world import World

_CHUNKS_PER_THREAD = 4
"""Missions differ in work; smaller chunks even it out."""
_MOST_MISSIONS = 2**31 - 1
_ENDS = list(MissionEnd)


class Start(NamedTuple):
    """What a mission starts with."""

    mission: int
    seed: int
    episode: int
    """How many resets without a seed it is behind the seed's own."""
    world: World
    poses: np.ndarray
    """(A, 5) float64."""
    options: ResetOptions
    """What of it was given."""
    world_number: int | None
    """Of the world, where a recipe made it."""
    fiducials: np.ndarray
    """(F, 3) float64."""


class _Calls(NamedTuple):
    """The compiled calls of a step, bound to the arrays of their missions."""

    state: MissionState
    planning: Planning
    observed: Observed
    proposing: Proposing
    step: Callable[..., None] | None
    """None = not called yet, like the next one."""
    observe: Callable[..., None] | None


class Missions:
    """E missions of one scenario, advanced together by compiled calls.

    A single mission is a batch of one. Results do not depend on how many missions there are, on
    the number of threads, or on what other missions do.

    Attributes:
        scenario: The task, its grid taken over from the world's file, or from the worlds given.
        given: Worlds to be in, in place of the scenario's; none where it has a recipe or a file.
        count: Number of missions E.
        state: All that changes, as arrays.
        worlds: The true world of each mission; None before its first reset.
        world_numbers: (E,) int64, its number in each mission; -1 where no recipe made it.
        options: What was given to the latest reset of each mission, instead of drawing it.
        every_reset: What resets are given that say nothing of it, also where missions start by themselves.
        reward_function: Name of the function that rewards the robots in place of the scenario's reward, for
            records; empty = none. Missions themselves always reward by the scenario.
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
        check_whole("threads", 1 if threads is None else threads, 1)
        if not is_whole(count, 1, _MOST_MISSIONS):
            raise SettingError("missions", count, f"a whole number ≥ 1, at most {_MOST_MISSIONS}")
        check_instance("scenario", scenario, Scenario)
        if not isinstance(given, list | tuple):
            raise SettingError("given", given, "a sequence of Worlds")
        self._read = None if given else world_of_file(scenario)
        if given:
            scenario = in_given_worlds(scenario, given)
        elif self._read is not None:
            scenario = dataclasses.replace(scenario, grid=self._read.grid)
        self.threads = min(int(count), threads or os.cpu_count() or 1)
        check_memory(scenario, Batch(int(count), self.threads, tuple(given)))
        self.scenario, self.given = scenario, checked_worlds(given) if given else ()
        self.count = int(count)
        self.rules = rules_of(scenario)
        self.layout = ObservationLayout(scenario)
        self._offsets = part_offsets(scenario, self.layout)
        self._candidate_offsets = candidate_offsets(scenario, self.layout)
        self.state: MissionState = new_state(scenario, self.count, self.rules.cells)
        self._no_fly = np.zeros((self.count * int(self.rules.params["bodies"][0]), 0), np.bool_)
        self.worlds: list[World | None] = [None] * self.count
        self.world_numbers = np.full(self.count, -1, np.int64)
        self.options = [DRAWN] * self.count
        self.every_reset = DRAWN
        self.reward_function = ""
        self.seeds = [0] * self.count
        self.episodes = [-1] * self.count
        self.observations = np.zeros((self.count, scenario.robots, self.layout.size), np.float32)
        self._make_working_space()

    def _make_working_space(self) -> None:
        """Threads, scratch memory for each and, where robots plan, navigators; none of it is state."""
        self._pool = Threads(self.threads)
        self._calls: _Calls | None = None
        self._choices = np.zeros((self.count, self.scenario.robots), CHOICE)
        self._navigators = [new_navigators(self.scenario) for _ in range(self.threads)]
        proposed = self.scenario.action.kind == "candidates"
        self._proposers: list[list[Proposer]] = [
            new_proposers(self.scenario) if proposed else [] for _ in range(self.threads)
        ]
        self._work: list[Workspace] = [
            new_workspace(self.scenario, navigators) for navigators in self._navigators
        ]

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

    @property
    def estimates(self) -> np.ndarray | None:
        """(E, A) ESTIMATE, what robots believe of their poses; None = all know where they are."""
        return None if self.rules.localization is None else self.state.estimates

    def reset(self, mission: int, seed: int | None = None, options: ResetOptions = DRAWN) -> None:
        """Start a mission anew: world, starts and random streams drawn, beliefs at the prior.

        Args:
            mission: Which of the E.
            seed: Of all its random streams. None goes on to the next episode of the last seed.
            options: What is given instead of being drawn, in this reset only.

        Raises:
            SettingError: The seed is not a whole number ≥ 0, or robots cannot be where they were put.
            WorldError: The world has too little room for the team, or its file has changed since these
                missions were made. Nothing has changed then.
        """
        self.reset_some([self._checked(mission)], [seed], [options])

    def _checked(self, mission: int) -> int:
        """The number of a mission, if there is one."""
        if not is_whole(mission, 0, self.count - 1):
            raise SettingError("mission", mission, f"a whole number from 0 to {self.count - 1}")
        return int(mission)

    def reset_some(
        self,
        missions: Iterable[int],
        seeds: Sequence[int | None],
        options: Sequence[ResetOptions] | None = None,
    ) -> None:
        """Start some missions anew: all of them, or none if one cannot be; see `reset`."""
        self.begin(self.draw(missions, seeds, options))

    def draw(
        self,
        missions: Iterable[int],
        seeds: Sequence[int | None],
        options: Sequence[ResetOptions] | None = None,
    ) -> list[Start]:
        """What missions would start with after a reset; nothing changes. See `reset`."""
        given = [DRAWN] * len(seeds) if options is None else options
        return [
            self.draw_episode(mission, *self._episode(mission, seed), fixed)
            for mission, seed, fixed in zip(missions, seeds, given, strict=True)
        ]

    def begin(self, drawn: Iterable[Start]) -> None:
        """Start missions with what was drawn for them."""
        for start in drawn:
            self._begin(start)

    def start_episode(self, mission: int, seed: int, episode: int, options: ResetOptions = DRAWN) -> None:
        """Start a mission as an episode of a seed, without those before it; see `reset`."""
        self.begin([self.draw_episode(mission, seed, episode, options)])

    def _episode(self, mission: int, seed: int | None) -> tuple[int, int]:
        """Seed and episode of a mission after a reset."""
        if seed is not None or self.episodes[mission] < 0:
            return check_seed(seed), 0
        return self.seeds[mission], self.episodes[mission] + 1

    def draw_episode(self, mission: int, seed: int, episode: int, options: ResetOptions) -> Start:
        """What a mission would start with as an episode of a seed; nothing changes. See `reset`."""
        options = options.filled_up(self.every_reset)
        number = options.world_number
        if options.world is not None:
            world = options.world
        elif self.given:
            world = world_in_turn(self.given, seed, episode)
        elif self._read is not None:
            require_unchanged(self.scenario, self._read)
            world = self._read
        else:
            if number is None:
                number = draw_world_number(self.scenario.split, generator(seed, episode, Stream.WORLD))
            world = make_world(self.scenario, number)
        if options.starts is not None:
            poses = checked_starts(self.scenario, world, options.starts)
        else:
            poses = start_poses(self.scenario, world, generator(seed, episode, Stream.STARTS))
        fiducials = fiducial_places(self.scenario, world, seed, episode)
        return Start(mission, seed, episode, world, poses, options, number, fiducials)

    def _begin(self, start: Start) -> None:
        """Put the mission into its world, with beliefs at the prior, and observe."""
        mission, number, episode, world, poses, options, world_number, fiducials = start
        self.seeds[mission], self.episodes[mission] = number, episode
        self.options[mission] = options
        self.world_numbers[mission] = -1 if world_number is None else world_number
        differs = world.ceiling is not None or world.unreadable is not None
        if differs and self.state.collision is self.state.truth:
            self.state = self.state._replace(collision=self.state.truth.copy())
        state = self.state
        knows_ceiling = self._navigators[0] or self._proposers[0]
        if world.ceiling is not None and not self._no_fly.size and knows_ceiling:
            self._no_fly = np.zeros((len(self._no_fly), self.grid.voxels), np.bool_)
        if world is not self.worlds[mission]:
            self.worlds[mission] = world
            state.truth[mission] = true_coverage(world.occupied, world.unreadable)
            self._set_collision_masks(mission, world)
        for array in state[4:]:
            array[mission] = np.zeros((), array.dtype)
        state.mean[mission] = PRIOR_MEAN
        state.precision[mission] = self.rules.params["prior_precision"][0]
        state.pooled[mission] = fresh_sums(self.rules.cells)
        if self.scenario.track_truth:
            state.joint_mean[mission] = PRIOR_MEAN
            state.joint_precision[mission] = self.rules.params["prior_precision"][0]
            self._set_seen_goal(mission, world)
        for field in ("reached_s", "seen_s", "seen_m"):
            state.missions[mission][field] = -1.0
        self._set_entropies(mission, world.visible_voxels(self.scenario))
        robots = state.robots[mission]
        for field in ("origin", "goal", "target", "scan_pose"):
            robots[field] = poses
        robots["deciding"] = True
        robots["redecide_s"] = np.inf
        robots["i_min_bits"] = robots["next_i_min_bits"] = self.scenario.channel.i_min_bits
        robots["sensor_rng"][:, 0] = splitmix_states(number, episode, Stream.SENSOR, len(robots))
        robots["channel_rng"][:, 0] = splitmix_states(number, episode, Stream.CHANNEL, len(robots))
        state.heard[mission]["heard_s"] = state.heard[mission]["announced_s"] = -1.0
        state.in_flight[mission]["due_s"] = np.inf
        draw_faults(self.scenario, number, episode, state.faults[mission])
        remembering = state.experience[mission]
        remembering["candidates_rng"][:, 0] = splitmix_states(
            number, episode, Stream.CANDIDATES, len(remembering)
        )
        begin_estimates(number, episode, poses, state.estimates[mission])
        state.fiducials[mission] = fiducials
        self._observe(0, mission, mission + 1)

    def _set_collision_masks(self, mission: int, world: World) -> None:
        """What is in the way of the team's bodies."""
        for robot in range(min(len(self.scenario.kinds), self.scenario.robots)):
            params, kind = self.rules.params[robot], self.scenario.kind_of(robot)
            row = mission * params["bodies"] + params["body_number"]
            self.state.collision[row] = world.layout(self.scenario, kind).collision_mask.ravel()
            if self._no_fly.size:
                self._no_fly[row] = world.no_fly_mask(kind.robot.body_radius_m).ravel()

    def think_less(self, divisor: int) -> None:
        """Let so many times fewer viewpoints be drawn and refined as candidates from now on."""
        self._proposers = [[thinned(each, divisor) for each in thread] for thread in self._proposers]

    def take_no_fly_zones(self, source: Missions, rows: np.ndarray, at: np.ndarray) -> None:
        """Take over the no-fly zones of another batch's missions, and room for collision masks of their own.

        Args:
            source: Missions of the same scenario.
            rows: (N,) which of them.
            at: (N,) which of these missions they replace.
        """
        if source.state.collision is not source.state.truth and self.state.collision is self.state.truth:
            self.state = self.state._replace(collision=self.state.truth.copy())
        if source._no_fly.size and not self._no_fly.size:
            self._no_fly = np.zeros((len(self._no_fly), self.grid.voxels), np.bool_)
        if self._no_fly.size:
            masks = self._no_fly.reshape(self.count, -1, self.grid.voxels)
            masks[at] = 0
            if source._no_fly.size:
                masks[at] = source._no_fly.reshape(source.count, -1, self.grid.voxels)[rows]

    def _set_seen_goal(self, mission: int, world: World) -> None:
        """What can be seen, and how much of it has to be where that ends the mission."""
        clock, ending = self.state.missions[mission], self.scenario.ending
        visible = world.visible(self.scenario)
        self.state.visible[mission] = visible.ravel()
        clock["visible"], clock["visible_free"] = visible.sum(), (visible & ~world.occupied).sum()
        if ending.seen_share is not None:
            clock["explored_end"] = math.ceil(ending.seen_share * clock["visible"] - 1e-9)
        if ending.unseen_free_voxels is not None:
            clock["explored_free_end"] = clock["visible_free"] - ending.unseen_free_voxels

    def _set_entropies(self, mission: int, visible_voxels: int) -> None:
        """H(0) by eq. 25, and H_th: voxels that can be seen at σ_end, the others at the prior."""
        prior = np.full((1, 1, 1), self.rules.params["prior_precision"][0], np.float32)
        voxel_bits = float(map_entropy_bits(prior))
        known_bits = gaussian_entropy_bits(self.scenario.ending.sigma_end)
        hidden = self.grid.voxels - visible_voxels
        clock = self.state.missions[mission]
        clock["entropy_start_bits"] = clock["joint_bits"] = self.grid.voxels * voxel_bits
        clock["entropy_end_bits"] = visible_voxels * known_bits + hidden * voxel_bits
        self.state.robots[mission]["entropy_bits"] = clock["entropy_start_bits"]

    def strategy_generator(self, mission: int) -> np.random.Generator:
        """The random stream of whoever chooses the actions in this mission's episode.

        Raises:
            SettingError: There is no such mission.
            CallOrderError: The mission was never reset.
        """
        if self.episodes[self._checked(mission)] < 0:
            raise CallOrderError("strategy_generator before reset: call reset() first")
        return generator(self.seeds[mission], self.episodes[mission], Stream.STRATEGY)

    def step(self, continuous: np.ndarray, discrete: np.ndarray) -> np.ndarray:
        """Advance every mission that is not over by one step.

        Args:
            continuous: (E, A, N) actions; ignored where actions are numbers.
            discrete: (E, A) actions; ignored where they are continuous.

        Returns:
            (E, A, F) float32 observations; overwritten by the next call.

        Raises:
            CallOrderError: A mission was never reset.
            ActionError: The shapes are others.
        """
        if min(self.episodes) < 0:
            raise CallOrderError("step before reset: call reset() first")
        continuous, discrete = _for_kernels(continuous, np.float64), _for_kernels(discrete, np.int64)
        team = (self.count, self.scenario.robots)
        if continuous.ndim != 3 or continuous.shape[:2] != team or discrete.shape != team:
            raise ActionError(
                "actions", (continuous.shape, discrete.shape), f"shapes {team} (, N) and {team}"
            )
        if self._proposers[0]:
            continuous = self._chosen_viewpoints(discrete)
        if self.threads == 1:
            self._step_range(0, 0, self.count, continuous, discrete)
        else:
            self._step_threaded(continuous, discrete)
        end_of_step()
        return self.observations

    def _chosen_viewpoints(self, numbers: np.ndarray) -> np.ndarray:
        """(E, A, 5) the viewpoints of the candidates with these numbers (E, A)."""
        candidates = self.state.candidates["viewpoint"]
        if ((numbers < 0) | (numbers >= candidates.shape[2])).any():
            raise ActionError("actions", numbers, f"whole numbers from 0 to {candidates.shape[2] - 1}")
        chosen = np.take_along_axis(candidates, numbers[..., None, None], axis=2)[:, :, 0]
        return np.ascontiguousarray(chosen)

    def _step_range(
        self, thread: int, first: int, last: int, continuous: np.ndarray, discrete: np.ndarray
    ) -> None:
        calls, work = self._bound_calls(), self._work[thread]
        for kind, navigator in self._navigators[thread].items():
            plan_missions(calls.planning, navigator, kind, work.braking, continuous, discrete, first, last)
        arguments = (self.rules, self.state, self._choices, work, continuous, discrete, first, last)
        step = calls.step
        if step is None:
            step = entry_point(step_missions, *arguments)
            self._calls = calls._replace(step=step)
        step(*arguments)
        self._observe(thread, first, last)

    def _observe(self, thread: int, first: int, last: int) -> None:
        """Write the observations of the missions `first` … `last` - 1."""
        calls, scan = self._bound_calls(), self._work[thread].scan
        for kind, proposer in enumerate(self._proposers[thread]):
            propose_missions(
                calls.proposing, proposer, kind, self._candidate_offsets, first, last, self.observations
            )
        if not self.layout.size:
            return
        crossing = Crossing(scan.crossed[0], scan.entered)
        arguments = (self.rules, self._offsets, calls.observed, crossing, first, last, self.observations)
        observe = calls.observe
        if observe is None:
            observe = entry_point(observe_missions, *arguments)
            self._calls = calls._replace(observe=observe)
        observe(*arguments)

    def _bound_calls(self) -> _Calls:
        """What a step calls, for the arrays as they are: some are replaced when a world has a ceiling."""
        calls, state = self._calls, self.state
        if calls is None or calls.state is not state or calls.planning.no_fly is not self._no_fly:
            params, actions = self.rules.params, self.rules.actions
            shown = (state.missions, state.robots)
            maps, estimates = (state.mean, state.precision), self.estimates
            planning = Planning(params, actions, *shown, self._choices, *maps, self._no_fly, estimates)
            observed = Observed(*shown, state.heard, *maps, state.pooled, estimates)
            proposing = Proposing(
                params,
                *shown,
                state.heard,
                *maps,
                state.scan_utility_bits,
                state.candidates,
                state.experience,
                self._no_fly,
                estimates,
            )
            self._calls = calls = _Calls(state, planning, observed, proposing, None, None)
        return calls

    def _step_threaded(self, continuous: np.ndarray, discrete: np.ndarray) -> None:
        """Share the missions among threads: each takes the next chunk as soon as it is free."""
        size = max(1, self.count // (self.threads * _CHUNKS_PER_THREAD))
        chunks = iter(range(0, self.count, size))

        def work(thread: int) -> None:
            for first in chunks:
                self._step_range(thread, first, min(first + size, self.count), continuous, discrete)

        self._pool.run(work)

    def action_masks(self) -> np.ndarray:
        """(E, A, N) int8: 1 for each action by number that makes sense by the robot's own belief.

        Of candidates: for each that there is; for robots that do not decide, for the first one.
        """
        rules, state = self.rules, self.state
        if self._proposers[0]:
            running = state.missions["end"] == MissionEnd.RUNNING.code
            decides = state.robots["deciding"] & running[:, None]
            there = (state.candidates["kind"] != Kind.NONE) & decides[..., None]
            there[..., 0] = True
            return there.astype(np.int8)
        actions = len(rules.actions.moves) * len(rules.actions.gazes)
        masks = np.empty((self.count, self.scenario.robots, actions), np.int8)
        told = (state.missions, state.robots, self.estimates)
        mask_missions(rules.params, rules.actions, *told, state.mean, masks)
        return masks

    def over(self, mission: int) -> MissionEnd:
        """Why the mission is over, or MissionEnd.RUNNING."""
        return _ENDS[self.state.missions["end"][self._checked(mission)]]

    def close(self) -> None:
        """End the threads; the missions can still be stepped."""
        self._pool.close()

    def __getstate__(self) -> dict[str, object]:
        """All but the threads and their scratch space."""
        kept = dict(self.__dict__)
        del kept["_pool"], kept["_work"], kept["_navigators"], kept["_calls"], kept["_choices"]
        del kept["_proposers"]
        return kept

    def __setstate__(self, kept: dict[str, object]) -> None:
        """Take the arrays back and make new scratch space.

        Raises:
            RecordError: A number of the state is in no mission of the scenario.
        """
        self.__dict__.update(kept)
        begun = np.array(self.episodes) >= 0
        arrays = {name: array for name, array in self.state._asdict().items() if name not in FROM_WORLD}
        check_ranges(self.scenario, {name: array[begun] for name, array in arrays.items()})
        self._make_working_space()


def _for_kernels(actions: np.ndarray, dtype: type[np.generic]) -> np.ndarray:
    """Actions in the one kind of array for which a step is compiled: copied where they are of another."""
    try:
        array = np.ascontiguousarray(actions, dtype)
    except Exception:  # whatever was given in place of numbers
        raise ActionError("actions", actions, "arrays of numbers") from None
    return array if array.flags.writeable and array.flags.aligned else array.copy()

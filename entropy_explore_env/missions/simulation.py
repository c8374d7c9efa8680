"""Robots in worlds, many missions at once: the arrays, how they are reset, and how they step."""

from __future__ import annotations

import dataclasses
import os
from collections.abc import Iterable, Sequence

import numpy as np

from entropy_explore_env.compilation.announcement import end_of_step
from entropy_explore_env.errors import ActionError, CallOrderError, SettingError
from entropy_explore_env.missions.compiled_step import Arrays, CompiledStep
from entropy_explore_env.missions.endings import Returning
from entropy_explore_env.missions.episode import FixedWorlds, Start, draw_start, fill_start
from entropy_explore_env.missions.memory import Batch, check_memory
from entropy_explore_env.missions.observation.layout import ObservationLayout
from entropy_explore_env.missions.records import MissionEnd
from entropy_explore_env.missions.reset_options import DRAWN, ResetOptions
from entropy_explore_env.missions.rules import rules_of
from entropy_explore_env.missions.scan_log import ScanLog, new_scan_log
from entropy_explore_env.missions.state import FROM_WORLD, MissionState, new_state
from entropy_explore_env.missions.state_ranges import check_ranges
from entropy_explore_env.missions.world_changes import (
    WorldChange,
    changed_world,
    checked_change,
    rescore,
    robot_in_the_way,
)
from entropy_explore_env.randomness import Stream, check_seed, generator
from entropy_explore_env.robots.range_sensor import true_coverage
from entropy_explore_env.settings.grid import Grid
from entropy_explore_env.settings.scenario import Scenario
from entropy_explore_env.settings.validation import check_instance, is_number, is_whole
from entropy_explore_env.worlds.given import checked_worlds, in_given_worlds
from entropy_explore_env.worlds.load import require_unchanged, world_of_file
from entropy_explore_env.worlds.world import World

_MOST_MISSIONS = 2**31 - 1
_MOST_THREADS = 1024
_ENDS = list(MissionEnd)


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
        world_changes: Whether `set_world_block` was called for each mission since its reset.
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
        if threads is not None and not is_whole(threads, 1, _MOST_THREADS):
            raise SettingError("threads", threads, f"None, or a whole number from 1 to {_MOST_THREADS}")
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
        self.state: MissionState = new_state(scenario, self.count, self.rules.cells)
        self._no_fly = np.zeros((self.count * int(self.rules.params["bodies"][0]), 0), np.bool_)
        self.worlds: list[World | None] = [None] * self.count
        self.world_numbers = np.full(self.count, -1, np.int64)
        self.options = [DRAWN] * self.count
        self.every_reset = DRAWN
        self.reward_function = ""
        self._returning = Returning(self.count, scenario.robots) if scenario.ending.return_to_start else None
        self._changes: list[list[WorldChange]] = [[] for _ in range(self.count)]
        self.world_changes = [False] * self.count
        self.seeds = [0] * self.count
        self.episodes = [-1] * self.count
        self.observations = np.zeros((self.count, scenario.robots, self.layout.size), np.float32)
        self._make_compiled_step()

    def _make_compiled_step(self) -> None:
        """Make the threads and their memory; none of it is state."""
        self._compiled_step = CompiledStep(self.scenario, self.rules, self.layout, self.count, self.threads)

    def log_scans(self, most: int) -> ScanLog:
        """Return a log that the steps of all missions fill from now on, with the latest `most` scans."""
        log = new_scan_log(most, max(kind.sensor.rays for kind in self.scenario.kinds))
        self._compiled_step.work = [work._replace(log=log) for work in self._compiled_step.work]
        return log

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
        return self._compiled_step.estimates_of(self.state)

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

    def check_begun(self, call: str, mission: int = 0) -> None:
        """Raise a CallOrderError that names a call, unless a mission was reset before it."""
        if self.episodes[self._checked(mission)] < 0:
            raise CallOrderError(f"{call} before reset: call reset() first")

    def _checked(self, mission: int) -> int:
        """Return the number of a mission, if there is one."""
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
        """Return what missions would start with after a reset; nothing changes. See `reset`."""
        given = [DRAWN] * len(seeds) if options is None else options
        return [
            self.draw_episode(mission, *self._episode(mission, seed), fixed)
            for mission, seed, fixed in zip(missions, seeds, given, strict=True)
        ]

    def check_world_file(self) -> None:
        """Raise a WorldError if the world's file is not what it was when these missions were made."""
        if self._read is not None:
            require_unchanged(self.scenario, self._read)

    def begin(self, drawn: Iterable[Start]) -> None:
        """Start missions with what was drawn for them."""
        for start in drawn:
            self._begin(start)

    def _episode(self, mission: int, seed: int | None) -> tuple[int, int]:
        """Seed and episode of a mission after a reset."""
        if seed is not None or self.episodes[mission] < 0:
            return check_seed(seed), 0
        return self.seeds[mission], self.episodes[mission] + 1

    def draw_episode(self, mission: int, seed: int, episode: int, options: ResetOptions) -> Start:
        """Return what a mission would start with as an episode of a seed; nothing changes. See `reset`."""
        fixed = FixedWorlds(self.given, self._read)
        filled = options.filled_up(self.every_reset)
        return draw_start(self.scenario, fixed, mission, seed, episode, filled)

    def _begin(self, start: Start) -> None:
        """Put the mission into its world, with beliefs at the prior, and observe."""
        mission, world = start.mission, start.world
        self.seeds[mission], self.episodes[mission] = start.seed, start.episode
        self.options[mission] = start.options
        self._changes[mission], self.world_changes[mission] = [], False
        self.world_numbers[mission] = -1 if start.world_number is None else start.world_number
        differs = world.ceiling is not None or world.unreadable is not None
        if differs and self.state.collision is self.state.truth:
            self.state = self.state._replace(collision=self.state.truth.copy())
        if world.ceiling is not None and not self._no_fly.size and self._compiled_step.knows_ceiling:
            self._no_fly = np.zeros((len(self._no_fly), self.grid.voxels), np.bool_)
        if world is not self.worlds[mission]:
            self._set_world(mission, world)
        fill_start(self.scenario, self.rules, self.state, start)
        if self._returning is not None:
            self._returning.begin(self.state, mission, self.grid.voxels)
        self._compiled_step.observe(self._arrays(), mission, mission + 1)

    def _arrays(self) -> Arrays:
        """Return what a step reads and changes."""
        return Arrays(self.state, self._no_fly, self.observations)

    def _set_world(self, mission: int, world: World) -> None:
        """Put a mission into a world: its truth, and what is in the way of the team's bodies."""
        self.worlds[mission] = world
        self.state.truth[mission] = true_coverage(world.occupied, world.unreadable)
        for robot in range(min(len(self.scenario.kinds), self.scenario.robots)):
            params, kind = self.rules.params[robot], self.scenario.kind_of(robot)
            row = mission * params["bodies"] + params["body_number"]
            self.state.collision[row] = world.layout(self.scenario, kind).collision_mask.ravel()
            if self._no_fly.size:
                self._no_fly[row] = world.no_fly_mask(kind.robot.planning_radius_m).ravel()

    def set_world_block(
        self,
        mission: int,
        low_m: Sequence[float],
        high_m: Sequence[float],
        solid: bool = True,
        at_s: float | None = None,
    ) -> None:
        """Change the true world: the voxels whose centres lie in a box become solid, or free.

        Args:
            mission: Which of the E.
            low_m: The box's lower corner (x, y, z), map frame.
            high_m: Its upper corner.
            solid: Whether the voxels become solid.
            at_s: When, in simulated time: before the first step that begins then or later and finds no robot
                in the way. None = now.

        Raises:
            CallOrderError: The mission was never reset.
            SettingError: The box holds no voxel, the time has passed, or a robot is in the way now.
            WorldError: No free voxel would be left.
        """
        self.check_begun("set_world_block", mission)
        now_s = float(self.state.missions[mission]["time_s"])
        if at_s is not None and not (is_number(at_s) and now_s <= at_s < np.inf):
            raise SettingError("at_s", at_s, f"None, or finite seconds from {now_s:g} on")
        change = checked_change(self.grid, low_m, high_m, solid, now_s if at_s is None else float(at_s))
        if at_s is not None:
            self._changes[mission].append(change)
        elif (robot := robot_in_the_way(self.rules, self.state, mission, change)) is not None:
            raise SettingError("low_m, high_m", (low_m, high_m), f"a box that robot {robot} does not touch")
        else:
            self._change(mission, change)
        self.world_changes[mission] = True

    def _change(self, mission: int, change: WorldChange) -> None:
        """Change a mission's world now."""
        world = self.worlds[mission]
        assert world is not None
        before = self.state.truth[mission].copy()
        self._set_world(mission, changed_world(world, change))
        prior = float(self.rules.params["prior_precision"][0])
        more = rescore(self.state, mission, before, self.state.truth[mission], prior)
        if self.scenario.ending.unseen_free_voxels is not None:
            self.state.missions[mission]["explored_free_end"] += more
            if self._returning is not None:
                self._returning.free[mission] += more

    def _change_worlds(self) -> None:
        """Make the changes that are due and have no robot in their way."""
        for mission, changes in enumerate(self._changes):
            for change in list(changes):
                due = change.at_s <= self.state.missions[mission]["time_s"]
                if due and robot_in_the_way(self.rules, self.state, mission, change) is None:
                    changes.remove(change)
                    self._change(mission, change)

    def strategy_generator(self, mission: int) -> np.random.Generator:
        """Return the random stream of whoever chooses the actions in this mission's episode.

        Raises:
            SettingError: There is no such mission.
            CallOrderError: The mission was never reset.
        """
        self.check_begun("strategy_generator", mission)
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
        if self._compiled_step.proposes:
            continuous = self._chosen_viewpoints(discrete)
        if any(self._changes):
            self._change_worlds()
        self._compiled_step.step(self._arrays(), continuous, discrete)
        if self._returning is not None:
            self._returning.end(self.rules, self.state)
        end_of_step()
        return self.observations

    def _chosen_viewpoints(self, numbers: np.ndarray) -> np.ndarray:
        """Return the viewpoints (E, A, 5) of the candidates with these numbers (E, A)."""
        candidates = self.state.candidates["viewpoint"]
        if ((numbers < 0) | (numbers >= candidates.shape[2])).any():
            raise ActionError("actions", numbers, f"whole numbers from 0 to {candidates.shape[2] - 1}")
        chosen = np.take_along_axis(candidates, numbers[..., None, None], axis=2)[:, :, 0]
        return np.ascontiguousarray(chosen)

    def action_masks(self) -> np.ndarray:
        """Return (E, A, N) int8: 1 for each action by number that makes sense by the robot's own belief.

        Of candidates: for each that there is; for robots that do not decide, for the first one.
        """
        return self._compiled_step.action_masks(self.state)

    def over(self, mission: int) -> MissionEnd:
        """Return why the mission is over, or MissionEnd.RUNNING."""
        return _ENDS[self.state.missions["end"][self._checked(mission)]]

    def close(self) -> None:
        """End the threads; the missions can still be stepped."""
        self._compiled_step.close()

    def __getstate__(self) -> dict[str, object]:
        """Return all but the threads and their memory."""
        kept = dict(self.__dict__)
        del kept["_compiled_step"]
        return kept

    def __setstate__(self, kept: dict[str, object]) -> None:
        """Take the arrays back and make new threads.

        Raises:
            RecordError: A number of the state is in no mission of the scenario.
        """
        self.__dict__.update(kept)
        begun = np.array(self.episodes) >= 0
        arrays = {name: array for name, array in self.state._asdict().items() if name not in FROM_WORLD}
        check_ranges(self.scenario, {name: array[begun] for name, array in arrays.items()})
        self._make_compiled_step()


def _for_kernels(actions: np.ndarray, dtype: type[np.generic]) -> np.ndarray:
    """Return actions in the one kind of array for which a step is compiled; others are copied."""
    try:
        array = np.ascontiguousarray(actions, dtype)
    except Exception:  # whatever was given in place of numbers
        raise ActionError("actions", actions, "arrays of numbers") from None
    return array if array.flags.writeable and array.flags.aligned else array.copy()

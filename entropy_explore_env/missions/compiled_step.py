"""The compiled calls of a step, shared among threads, and the memory besides the state that they need."""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from entropy_explore_env.belief.raycast import Crossing
from entropy_explore_env.compilation.kernels import compile_ahead, entry_point
from entropy_explore_env.missions.navigation import Planning, plan_missions
from entropy_explore_env.missions.observation.layout import ObservationLayout, candidate_offsets, part_offsets
from entropy_explore_env.missions.observation.mask import mask_missions
from entropy_explore_env.missions.observation.observe import Observed, observe_missions
from entropy_explore_env.missions.proposals import Proposing, propose_missions
from entropy_explore_env.missions.records import MissionEnd
from entropy_explore_env.missions.redecision import CHOICE
from entropy_explore_env.missions.rules import Rules
from entropy_explore_env.missions.state import MissionState
from entropy_explore_env.missions.threads import Threads
from entropy_explore_env.missions.tick import step_missions
from entropy_explore_env.missions.workspace import Workspace, new_workspace
from entropy_explore_env.planner.model import Proposer, new_proposers
from entropy_explore_env.planner.records import Kind
from entropy_explore_env.prediction.predictor import predicting_of
from entropy_explore_env.robots.navigator import new_navigators
from entropy_explore_env.settings.scenario import Scenario

_CHUNKS_PER_THREAD = 4
"""Missions differ in work; smaller chunks even it out."""


class Arrays(NamedTuple):
    """What a step reads and changes."""

    state: MissionState
    no_fly: np.ndarray
    """(E·N, V) bool, or (E·N, 0) where no world has a ceiling; see Planning."""
    observations: np.ndarray
    """(E, A, F) float32."""


class _Calls(NamedTuple):
    """The compiled calls of a step, bound to the arrays of their missions."""

    arrays: Arrays
    planning: Planning
    observed: Observed
    proposing: Proposing
    step: Callable[..., None] | None
    """None = not called yet, like the next one."""
    observe: Callable[..., None] | None


class CompiledStep:
    """Steps and observations of E missions of one scenario; holds nothing that a mission depends on.

    Attributes:
        navigators: Of each thread, by the kind of robot: paths through beliefs. Empty where no robot plans.
        proposers: Of each thread, for each kind of robot: candidates as actions. Empty without them.
        work: Of each thread: scratch memory.
        predicting: Of each thread: what predictions need; None where none is observed.
    """

    def __init__(
        self, scenario: Scenario, rules: Rules, layout: ObservationLayout, count: int, threads: int
    ) -> None:
        """Make threads and, for each of them, the memory that it needs.

        Args:
            scenario: The task.
            rules: Its parameters for compiled code.
            layout: What an observation is made of.
            count: Number of missions E.
            threads: How many share them.
        """
        self._rules, self._count, self._threads = rules, count, threads
        self._observes = layout.size > 0
        self._offsets = part_offsets(scenario, layout)
        self._candidate_offsets = candidate_offsets(scenario, layout)
        self._pool = Threads(threads)
        self._calls: _Calls | None = None
        self._choices = np.zeros((count, scenario.robots), CHOICE)
        self.navigators = [new_navigators(scenario) for _ in range(threads)]
        proposed = scenario.action.kind == "candidates"
        self.proposers: list[list[Proposer]] = [
            new_proposers(scenario) if proposed else [] for _ in range(threads)
        ]
        self.work: list[Workspace] = [new_workspace(scenario, navigators) for navigators in self.navigators]
        self.predicting = [predicting_of(scenario.observation) for _ in range(threads)]

    @property
    def proposes(self) -> bool:
        """Whether actions are numbers of candidates."""
        return bool(self.proposers[0])

    @property
    def knows_ceiling(self) -> bool:
        """Whether some robot plans below a world's ceiling, so that it needs no-fly zones."""
        return bool(self.navigators[0]) or self.proposes

    def step(self, arrays: Arrays, continuous: np.ndarray, discrete: np.ndarray) -> None:
        """Advance and observe all missions: each thread takes the next chunk as soon as it is free.

        Args:
            arrays: Changed in place.
            continuous: (E, A, N) float64 actions.
            discrete: (E, A) int64 actions.
        """
        if self._threads == 1:
            self._step_range(arrays, 0, 0, self._count, continuous, discrete)
            return
        size = max(1, self._count // (self._threads * _CHUNKS_PER_THREAD))
        chunks = iter(range(0, self._count, size))

        def work(thread: int) -> None:
            for first in chunks:
                last = min(first + size, self._count)
                self._step_range(arrays, thread, first, last, continuous, discrete)

        self._pool.run(work)

    def _step_range(
        self,
        arrays: Arrays,
        thread: int,
        first: int,
        last: int,
        continuous: np.ndarray,
        discrete: np.ndarray,
    ) -> None:
        """Advance and observe the missions `first` … `last` - 1."""
        calls, work = self._bound_calls(arrays), self.work[thread]
        for kind, navigator in self.navigators[thread].items():
            plan_missions(calls.planning, navigator, kind, work.braking, continuous, discrete, first, last)
        arguments = (self._rules, arrays.state, self._choices, work, continuous, discrete, first, last)
        step = calls.step
        if step is None:
            step = entry_point(step_missions, *arguments)
            self._calls = calls._replace(step=step)
        step(*arguments)
        self.observe(arrays, first, last, thread)

    def observe(self, arrays: Arrays, first: int, last: int, thread: int = 0) -> None:
        """Write the observations of the missions `first` … `last` - 1."""
        calls, scan = self._bound_calls(arrays), self.work[thread].scan
        for kind, proposer in enumerate(self.proposers[thread]):
            propose_missions(
                calls.proposing, proposer, kind, self._candidate_offsets, first, last, arrays.observations
            )
        if not self._observes:
            return
        crossing = Crossing(scan.crossed[0], scan.entered)
        scratch = (crossing, self.predicting[thread])
        arguments = (self._rules, self._offsets, calls.observed, *scratch, first, last, arrays.observations)
        observe = calls.observe
        if observe is None:
            observe = entry_point(observe_missions, *arguments)
            self._calls = calls._replace(observe=observe)
        observe(*arguments)

    def _bound_calls(self, arrays: Arrays) -> _Calls:
        """Return what a step calls, for the arrays as they are: a world with a ceiling replaces some."""
        calls, state, no_fly = self._calls, arrays.state, arrays.no_fly
        if calls is None or calls.arrays.state is not state or calls.arrays.no_fly is not no_fly:
            params, actions = self._rules.params, self._rules.actions
            shown = (state.missions, state.robots)
            maps, estimates = (state.mean, state.precision), self.estimates_of(state)
            planning = Planning(params, actions, *shown, self._choices, *maps, no_fly, estimates)
            observed = Observed(*shown, state.heard, *maps, state.pooled, estimates)
            proposing = Proposing(params, state, no_fly, estimates)
            first = self._calls is None
            self._calls = calls = _Calls(arrays, planning, observed, proposing, None, None)
            if first:
                self._compile_ahead(calls)
        return calls

    def _compile_ahead(self, calls: _Calls) -> None:
        """Have the step compiled while missions start and strategies get ready."""
        choices, work, reach = self._choices, self.work[0], (0, self._count)
        actions = np.zeros((*choices.shape, 5)), np.zeros(choices.shape, np.int64)
        step = (self._rules, calls.arrays.state, choices, work, *actions, *reach)
        plans = [
            (plan_missions, (calls.planning, navigator, kind, work.braking, *actions, *reach))
            for kind, navigator in self.navigators[0].items()
        ]
        compile_ahead([(step_missions, step), *plans])

    def estimates_of(self, state: MissionState) -> np.ndarray | None:
        """Return (E, A) ESTIMATE, what robots believe of their poses; None = all know where they are."""
        return None if self._rules.localization is None else state.estimates

    def action_masks(self, state: MissionState) -> np.ndarray:
        """Return (E, A, N) int8; see `Missions.action_masks`."""
        if self.proposes:
            running = state.missions["end"] == MissionEnd.RUNNING.code
            decides = state.robots["deciding"] & running[:, None]
            there = (state.candidates["kind"] != Kind.NONE) & decides[..., None]
            there[..., 0] = True
            return there.astype(np.int8)
        actions = self._rules.actions
        masks = np.empty((*state.robots.shape, len(actions.moves) * len(actions.gazes)), np.int8)
        told = (state.missions, state.robots, self.estimates_of(state))
        mask_missions(self._rules.params, actions, *told, state.mean, masks)
        return masks

    def close(self) -> None:
        """End the threads; steps begin them again."""
        self._pool.close()

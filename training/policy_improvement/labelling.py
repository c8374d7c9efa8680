"""Stage 1: missions of the planner, and at some of their states the labels of roll-outs; a shard at a time.

Shards follow from the run's seed and their numbers, not from each other: a run that is stopped goes on with
the first one that is missing. Missions have seeds that no table, test or validation has.
"""

from __future__ import annotations

import hashlib
import time
from collections.abc import Callable
from pathlib import Path
from typing import NamedTuple

import numpy as np
import torch

from baselines.experiments.provenance import code_digest
from entropy_explore_env.missions.privileged import deciding, mission_times
from entropy_explore_env.scenario import Scenario
from training.candidate_network import CandidatePolicy
from training.policy import choose_actions
from training.policy_improvement.origin import Origin
from training.policy_improvement.rollouts import (
    PLANNER,
    BatchMissions,
    Branch,
    Outcomes,
    RollOutEffort,
    RollOuts,
    candidates_to_try,
)
from training.policy_improvement.shards import Labels, load_shard, save_shard, shard_file
from training.seeds import label_seeds

_KEYS = 2**62


class LabelSettings(NamedTuple):
    """What decides the labels, but for the code.

    Attributes:
        scenarios: Of the missions; shards are dealt to them in turn.
        missions: Of a shard.
        branches: B, candidates that are tried at a state, the planner's choice among them.
        draws: D, random numbers over which a label is averaged.
        effort: How far branches go, and how many viewpoints their planner draws.
        every: A decision of so many is labelled, on average.
        states: States whose branches run at once.
        seed: Of missions and draws.
        policy: Digest of the policy whose missions are labelled; empty = the planner's own.
    """

    scenarios: tuple[Scenario, ...]
    missions: int
    branches: int
    draws: int
    effort: RollOutEffort
    every: int
    states: int
    seed: int
    policy: str = ""

    @property
    def origin(self) -> Origin:
        """What labels with these settings come from."""
        described = hashlib.sha256(repr(self).encode()).hexdigest()
        return Origin(code_digest(__name__), described)

    def task_of(self, shard: int) -> int:
        """The number of the scenario of a shard."""
        return shard % len(self.scenarios)


Acting = Callable[[BatchMissions], np.ndarray]
"""From missions to the candidates (E, A) that their robots take."""


def planner_acts(batch: BatchMissions) -> np.ndarray:
    """The planner's choices."""
    return np.full((batch.missions.count, batch.scenario.robots), PLANNER, np.int64)


def policy_acts(policy: CandidatePolicy) -> Acting:
    """The likeliest candidates of a policy: in missions that it leads, labels say what it does wrong, too."""

    def acts(batch: BatchMissions) -> np.ndarray:
        missions = batch.missions
        seen, choosing = missions.observations, deciding(missions)
        actions = np.zeros(choosing.shape, np.int64)
        actions[choosing] = choose_actions(policy, seen[choosing], None)
        return actions

    return acts


def write_labels(
    settings: LabelSettings,
    folder: Path,
    shards: int,
    threads: int,
    acts: Acting = planner_acts,
    stopped: Callable[[], bool] = lambda: False,
    say: Callable[[str], None] = lambda line: None,
) -> int:
    """Write the shards that are missing.

    Args:
        settings: What decides the labels.
        folder: Of the shards.
        shards: How many there are to be.
        threads: Threads that share the missions; labels do not depend on them.
        acts: Who leads the missions that are labelled.
        stopped: Asked before each shard whether to stop.
        say: Told of each shard that was written.

    Returns:
        How many shards there are.

    Raises:
        LabelsError: A shard that is there cannot be used.
        RollOutError: A roll-out makes no headway.
    """
    for number in range(shards):
        file = shard_file(folder, number)
        if file.is_file():
            load_shard(file, settings.origin)
            continue
        if stopped():
            return number
        began = time.perf_counter()
        labels, seeds = label_missions(settings, number, threads, acts)
        save_shard(file, labels, settings.origin, seeds)
        took_s = time.perf_counter() - began
        states = len(labels.observations)
        say(f"{file.name}: {states} states of {settings.missions} missions in {took_s:.0f} s")
    return shards


def read_labels(settings: LabelSettings, folder: Path, shards: int) -> Labels:
    """All labels of some shards.

    Raises:
        LabelsError: A shard is missing or cannot be used.
    """
    return Labels.joined(
        [load_shard(shard_file(folder, number), settings.origin) for number in range(shards)]
    )


def label_missions(
    settings: LabelSettings, shard: int, threads: int, acts: Acting = planner_acts
) -> tuple[Labels, list[int]]:
    """Lead the missions of a shard to their ends, and label some of their states.

    Returns:
        The labels, and the missions' seeds.
    """
    return _Shard(settings, shard, threads).run(acts)


class _Shard:
    """The missions of a shard under way, and what was found so far."""

    def __init__(self, settings: LabelSettings, number: int, threads: int) -> None:
        self._settings = settings
        self._first = number * settings.missions
        self._seeds = label_seeds(settings.seed, number, settings.missions)
        self._rng = np.random.default_rng([settings.seed, number])
        self._task = settings.task_of(number)
        scenario = settings.scenarios[self._task]
        self._batch = BatchMissions(scenario, settings.missions, threads)
        self._batch.missions.reset_some(range(settings.missions), self._seeds)
        shape = (settings.states, settings.branches, settings.draws)
        self._rollouts = RollOuts(self._batch.scenario, shape, settings.effort, threads)
        self._observed: list[np.ndarray] = []
        self._tried: list[np.ndarray] = []
        self._states: list[tuple[int, float]] = []
        self._outcomes: list[Outcomes] = []
        self._moments: list[tuple[np.ndarray, int, float]] = []

    def run(self, acts: Acting) -> tuple[Labels, list[int]]:
        """The labels of all missions, and their seeds."""
        missions = self._batch.missions
        for going in self._batch.led(acts):
            self._note(going)
        self._run_branches()
        self._rollouts.close()
        self._batch.close()
        return self._labels(mission_times(missions)), self._seeds

    def _note(self, going: np.ndarray) -> None:
        """Take down this moment, and branch the missions of which a state is drawn."""
        missions, settings = self._batch.missions, self._settings
        choosing = deciding(missions) & going[:, None]
        told, clock_s = self._batch.told(), mission_times(missions)
        for mission in np.flatnonzero(going).tolist():
            numbers = told[mission, 0, self._batch.parts.size :]
            self._moments.append((numbers.copy(), mission, float(clock_s[mission])))
        drawn = choosing & (self._rng.uniform(size=choosing.shape) < 1.0 / settings.every)
        if not drawn.any():
            return
        features, exists = self._batch.features(), self._batch.exists()
        for mission, robot in np.argwhere(drawn).tolist():
            at = (mission, robot)
            tried = candidates_to_try(
                features[at], exists[at], self._batch.parts, settings.branches, self._rng
            )
            if len(tried) < 2:
                continue
            key = int(self._rng.integers(_KEYS))
            self._rollouts.add(self._batch, Branch(mission, robot, tried, key))
            padded = np.full(settings.branches, -1, np.int64)
            padded[: len(tried)] = tried
            self._tried.append(padded)
            self._observed.append(told[at].copy())
            self._states.append((mission, float(clock_s[mission])))
            if self._rollouts.full:
                self._run_branches()

    def _run_branches(self) -> None:
        self._outcomes.append(self._rollouts.run())

    def _labels(self, ends_s: np.ndarray) -> Labels:
        """What was found, when the missions have come to their ends."""
        settings, size = self._settings, self._batch.told().shape[2]
        seconds, ended, at_end = (np.concatenate(parts) for parts in zip(*self._outcomes, strict=True))
        mission = np.array([each for each, _ in self._states], np.int64)
        state_s = np.array([at_s for _, at_s in self._states])
        moment = np.array([each for _, each, _ in self._moments], np.int64)
        moment_s = np.array([at_s for _, _, at_s in self._moments])
        return Labels(
            np.array(self._observed, np.float32).reshape(-1, size),
            np.array(self._tried, np.int64).reshape(-1, settings.branches),
            seconds,
            ended,
            at_end,
            (ends_s[mission] - state_s).astype(np.float32),
            mission + self._first,
            np.full(len(mission), self._task, np.int64),
            np.array([numbers for numbers, _, _ in self._moments], np.float32),
            (ends_s[moment] - moment_s).astype(np.float32),
            moment + self._first,
            np.full(len(moment), self._task, np.int64),
        )


def weights_digest(policy: CandidatePolicy) -> str:
    """Digest of a policy's weights."""
    hasher = hashlib.sha256()
    for name, tensor in sorted(policy.state_dict().items()):
        hasher.update(name.encode() + tensor.detach().to(torch.float64).numpy().tobytes())
    return hasher.hexdigest()

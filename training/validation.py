"""How a policy does in missions that it does not learn from: their seeds, their worlds, and their figures.

Learning, validation and tables never share a seed:

| for | seeds |
| --- | --- |
| tables and tests | 0, 1, 2, … |
| validation | 2³² + 0, 1, 2, … |
| learning, and pairs of missions | ≥ 2⁶³, drawn for each run |
"""

from __future__ import annotations

import json
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import NamedTuple

import numpy as np
import torch
from stable_baselines3.common.policies import ActorCriticPolicy

from baselines.cli.mission_outputs import MissionLog, Outputs
from baselines.cli.task_options import TaskOptions, worlds_of
from baselines.experiments.mission import Surroundings, counted_time_s, run_mission, scripted
from entropy_explore_env.envs.parallel_env import EntropyExploreEnv
from entropy_explore_env.envs.vector_env import EntropyExploreVectorEnv
from entropy_explore_env.errors import SettingError
from entropy_explore_env.settings.changes import with_settings
from entropy_explore_env.settings.scenario import Scenario
from training.candidate_network import CandidatePolicy
from training.policy import LearnedPolicy, choose_actions, misfit

OWN = {"ending": {"time_limit_s": 2000.0}}
"""What training changes of named scenarios: longer missions would teach little and take all the time."""
_VALIDATION, _LEARNING = 2**32, 2**63
_PAIRS_KEY = 2


def validation_seeds(missions: int) -> list[int]:
    """Return the seeds of validation; every run has the same, so that runs compare."""
    return [_VALIDATION + mission for mission in range(missions)]


def pair_seeds(seed: int, part: int, pairs: int) -> list[int]:
    """Return the seeds of pairs of missions of a part of a search; those of learning, and never one twice."""
    return _drawn(seed, (_PAIRS_KEY, part), pairs)


def learning_seeds(seed: int, missions: int) -> list[int]:
    """Return the seeds of the missions that a run with this seed begins with."""
    return _drawn(seed, (0,), missions)


def _drawn(seed: int, key: tuple[int, ...], missions: int) -> list[int]:
    """Return the seeds of learning that follow from a run's seed and a key; others for every key."""
    sequence = np.random.SeedSequence(entropy=seed, spawn_key=key)
    return [_LEARNING + int(drawn) for drawn in sequence.generate_state(missions, np.uint64)]


class TrainingTask(NamedTuple):
    """Missions to learn from, or to validate a policy with."""

    scenario: Scenario
    surroundings: Surroundings = Surroundings()


def validation_task(
    options: TaskOptions, files: Sequence[str], learned: Scenario, training: TrainingTask
) -> TrainingTask:
    """Return what a policy is validated in: world files of its own, or the worlds that it learns in.

    Args:
        options: Of the run, which say how the files are read.
        files: World files of validation; none = the worlds of training.
        learned: The scenario of training, with the grid of its worlds.
        training: What the policy learns in.

    Raises:
        SettingError: The policy observes all of the map, and its size differs.
        WorldError: A world file cannot be used.
    """
    if not files:
        return TrainingTask(learned, training.surroundings)
    around = Surroundings(json.dumps(worlds_of(options, files)))
    there = EntropyExploreEnv(learned, **around.settings()).scenario
    if (differs := misfit(there, learned)) is not None:
        raise SettingError("validation_world", differs.given, f"worlds with {differs.what} {differs.trained}")
    return TrainingTask(learned, around)


@dataclass(frozen=True)
class Validation:
    """Means over the missions of a validation.

    Attributes:
        mean_s, median_s: Mission time; a mission that was cut off counts with the time limit.
        finished: Share of the missions that were mapped.
        bits_per_bit: Bits that teammates gained for each bit sent; None where nothing was sent.
        planner_ratio: Of a policy over candidates, the geometric mean of its mission times over those of the
            planner itself on the same starts; None of others.
    """

    mean_s: float
    median_s: float
    finished: float
    bits_per_bit: float | None
    planner_ratio: float | None = None


class Validator:
    """The same missions every time: worlds of the validation split, where robots decide whenever they can."""

    def __init__(self, scenario: Scenario, surroundings: Surroundings, missions: int, threads: int) -> None:
        """Make the missions.

        Args:
            scenario: The scenario of training.
            surroundings: World files and starts of the missions.
            missions: How many missions to run.
            threads: Threads that share them.
        """
        validation = with_settings(scenario, {"split": "validation", "decision_period_s": None})
        around = surroundings.settings()
        self._env = EntropyExploreVectorEnv(
            validation, missions, threads=threads, action_masks=False, **around
        )
        self._seeds = validation_seeds(missions)
        self._planner_s: np.ndarray | None = None

    def validate(
        self, policy: ActorCriticPolicy, stop: Callable[[], bool] = lambda: False
    ) -> Validation | None:
        """Run each mission to its end; the random state of training stays as it is.

        Args:
            policy: Chooses.
            stop: Asked at every step whether to stop before the end; the result is None then.
        """
        rng = torch.Generator().manual_seed(0)
        ended = self.run(lambda observations: choose_actions(policy, observations, rng), stop)
        if ended is None:
            return None
        times_s = self._times_s(ended)
        gained_per_sent = [each["bits_gained_per_bit_sent"] for each in ended]
        defined = [each for each in gained_per_sent if each is not None]
        return Validation(
            float(times_s.mean()),
            float(np.median(times_s)),
            float(np.mean([each["finished"] for each in ended])),
            float(np.mean(defined)) if defined else None,
            self._planner_ratio(times_s) if isinstance(policy, CandidatePolicy) else None,
        )

    def _times_s(self, ended: list[dict[str, float]]) -> np.ndarray:
        """Return the time (E,) that each mission counts with."""
        return np.array([counted_time_s(each, self._env.scenario) for each in ended])

    def _planner_ratio(self, times_s: np.ndarray) -> float:
        """Return the geometric mean of mission times (E,) over the planner's, which leads them once."""
        if self._planner_s is None:
            led = self.run(lambda observations: np.zeros(len(observations), np.int64))  # 0 = its own choice
            assert led is not None
            self._planner_s = self._times_s(led)
        return float(np.exp(np.log(times_s / self._planner_s).mean()))

    def run(
        self, choose: Callable[[np.ndarray], np.ndarray], stop: Callable[[], bool] = lambda: False
    ) -> list[dict[str, float]] | None:
        """Run each mission to its end.

        Args:
            choose: From observations of all robots (E·A, F) to their actions (E·A, ...).
            stop: Asked at every step whether to stop before the end; the result is None then.

        Returns:
            The figures of each mission.
        """
        env = self._env
        missions, robots = env.num_envs, env.scenario.robots
        observations, _ = env.reset(seed=self._seeds)
        figures: list[dict[str, float] | None] = [None] * missions
        while any(each is None for each in figures):
            if stop():
                return None
            actions = choose(observations.reshape(missions * robots, -1))
            shape = (missions, robots) if robots > 1 else (missions,)
            observations, _, _, _, infos = env.step(actions.reshape(shape + actions.shape[1:]))
            for mission in np.flatnonzero(infos.get("_figures", ())).tolist():
                figures[mission] = figures[mission] or infos["figures"][mission]
        return [each for each in figures if each is not None]

    def close(self) -> None:
        """End the threads."""
        self._env.close()


def draw_best_mission(run: Path, scenario: Scenario, surroundings: Surroundings) -> list[Path]:
    """Run a validation mission of the best policy and draw it.

    Args:
        run: Folder of the run; the files go into `best-mission` in it.
        scenario: The scenario of training.
        surroundings: World files and starts of the mission.

    Returns:
        The files.
    """
    changes = {"split": "validation", "track_truth": True, "action": {"kind": "continuous"}}
    env = EntropyExploreEnv(with_settings(scripted(scenario), changes), **surroundings.settings())
    with MissionLog(Outputs(json=True), run / "best-mission", recorded=False) as log:
        run_mission(env, LearnedPolicy(run), validation_seeds(1)[0], log.note, log.command)
        _, files = log.finish(str(run))
    return files

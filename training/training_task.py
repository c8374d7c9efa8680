"""What a policy learns in and is validated in: the scenario, and world files in place of its worlds."""

from __future__ import annotations

import json
from collections.abc import Sequence
from typing import NamedTuple

from baselines.cli.task_options import TaskOptions, worlds_of
from baselines.experiments.mission import Surroundings
from entropy_explore_env.envs.parallel_env import EntropyExploreEnv
from entropy_explore_env.errors import SettingError
from entropy_explore_env.scenario import Scenario
from training.policy import misfit


class TrainingTask(NamedTuple):
    """Missions to learn from, or to validate a policy with."""

    scenario: Scenario
    surroundings: Surroundings = Surroundings()


def validation_task(
    options: TaskOptions, files: Sequence[str], learned: Scenario, training: TrainingTask
) -> TrainingTask:
    """What a policy is validated in: world files of its own, or the worlds that it learns in.

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

"""A mission of a run's best policy, as a picture and an animation."""

from __future__ import annotations

from pathlib import Path

from baselines.cli.mission_outputs import MissionLog, Outputs, Wanted
from baselines.experiments.mission import Surroundings, run_mission, scripted
from entropy_explore_env.envs.parallel_env import EntropyExploreEnv
from entropy_explore_env.scenario import Scenario, with_settings
from training.policy import LearnedPolicy
from training.seeds import validation_seeds


def draw_best_mission(run: Path, scenario: Scenario, surroundings: Surroundings) -> list[Path]:
    """Run a validation mission of the best policy and draw it.

    Args:
        run: Folder of the run; the files go into `best-mission` in it.
        scenario: The scenario of training.
        surroundings: World files and starts of the mission.

    Returns:
        The files.
    """
    wanted = Wanted(Outputs(json=True), run / "best-mission", recorded=False)
    wanted.prepare()
    changes = {"split": "validation", "track_truth": True, "action": {"kind": "continuous"}}
    env = EntropyExploreEnv(with_settings(scripted(scenario), changes), **surroundings.settings())
    with MissionLog(wanted) as log:
        run_mission(env, LearnedPolicy(run), validation_seeds(1)[0], log.note, log.command)
        _, files = log.finish(str(run))
    return files

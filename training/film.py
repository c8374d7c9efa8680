"""A mission of a run's best policy, as a picture and an animation."""

from __future__ import annotations

from pathlib import Path

from baselines.cli.mission_outputs import MissionLog, Outputs, Wanted
from baselines.experiments.mission import run_mission, scripted
from entropy_explore_env.envs.parallel_env import EntropyExploreEnv
from entropy_explore_env.scenario import Scenario, with_settings
from training.policy import LearnedPolicy
from training.seeds import validation_seeds


def film_best(run: Path, scenario: Scenario) -> list[Path]:
    """Run a validation mission of the best policy and write what it looked like.

    Args:
        run: Folder of the run; `best-mission` in it gets the files.
        scenario: That the policy learned in.

    Returns:
        The files.
    """
    wanted = Wanted(Outputs(json=True), run / "best-mission", recorded=False)
    wanted.prepare()
    form = {"split": "validation", "track_truth": True, "action": {"kind": "continuous"}}
    env = EntropyExploreEnv(with_settings(scripted(scenario), form))
    with MissionLog(wanted) as log:
        run_mission(env, LearnedPolicy(run), validation_seeds(1)[0], log.note, log.command)
        _, written = log.finish(str(run))
    return written

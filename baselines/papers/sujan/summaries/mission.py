"""A mission, and how wrong its robots' maps are at a moment of it and at its end."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from baselines.experiments.mission import run_mission
from baselines.experiments.outcome import Record
from baselines.strategies import make_strategy
from entropy_explore_env.belief.raycast import STOP_AT_COVERED
from entropy_explore_env.envs.parallel_env import EntropyExploreEnv
from entropy_explore_env.reports.metrics import mission_figures


@dataclass(frozen=True)
class SharedMaps:
    """Runs a mission and records its figures and its maps.

    Attributes:
        moment_s: When the maps are looked at, besides at the end.
    """

    moment_s: float

    def __call__(self, env: EntropyExploreEnv, strategy: str, seed: int) -> Record:
        """Run the mission.

        Returns:
            Its figures; `bits_per_s` that the team sent; and `moment` and `end`, each what `map_errors` says,
            the former None if the mission ended before.
        """
        moment: list[Record] = []

        def note(env: EntropyExploreEnv) -> None:
            if not moment and env.missions.state.missions["time_s"][0] >= self.moment_s:
                moment.append(map_errors(env))

        run_mission(env, make_strategy(strategy), seed, note)
        figures = mission_figures(env.missions, 0)
        return {
            **figures,
            "bits_per_s": figures["bits_sent"] / figures["t_mission_s"],
            "moment": moment[0] if moment else None,
            "end": map_errors(env),
        }


def map_errors(env: EntropyExploreEnv) -> Record:
    """How wrong the maps of a mission are now, over the voxels that can be seen; a voxel unknown is ½.

    Returns:
        `error`: mean |expected - true coverage| of the robots' own maps, mean over the team; `known`: share
        of the voxels that a robot measured or heard of, mean over the team; `wrong`: share of those on the
        wrong side of ½; `joint_error`: the first, of the map that fuses all measurements of the team.
    """
    missions = env.missions
    world = missions.worlds[0]
    if world is None:
        raise ValueError("the mission was never reset")
    visible = world.visible(missions.scenario)
    truth = world.occupied[visible].astype(float)
    mean = missions.mean[0][:, visible].astype(float)
    known = missions.precision[0][:, visible] > np.float32(missions.scenario.sigma_prior**-2)
    flipped = ((mean > STOP_AT_COVERED) != (truth > STOP_AT_COVERED)) & known
    joint = missions.state.joint_mean[0].reshape(world.grid.shape)[visible].astype(float)
    return {
        "error": round(float(np.abs(mean - truth).mean()), 6),
        "known": round(float(known.mean()), 6),
        "wrong": round(float(flipped.sum() / max(known.sum(), 1)), 6),
        "joint_error": round(float(np.abs(joint - truth).mean()), 6),
    }

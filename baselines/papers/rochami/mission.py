"""A mission of RochaMI in which distances cost something."""

from __future__ import annotations

from dataclasses import dataclass

from baselines.experiments.mission import mission_record
from baselines.experiments.rows import Record
from baselines.strategies.rules.mutual_information import MutualInformation
from entropy_explore_env.envs.parallel_env import EntropyExploreEnv


@dataclass(frozen=True)
class Run:
    """Runs a mission of coordinated robots, whatever the strategy that the cell names, with a κ."""

    distance_cost: float

    def __call__(self, env: EntropyExploreEnv, strategy: str, seed: int) -> Record:
        """Run the mission."""
        return mission_record(env, MutualInformation(distance_cost=self.distance_cost), seed)

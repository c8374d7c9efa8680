"""A mission of RochaMI, with a coordination of its own."""

from __future__ import annotations

from dataclasses import dataclass

from baselines.experiments.mission import mission_record
from baselines.experiments.rows import Record
from baselines.strategies import make_strategy
from baselines.strategies.mutual_information.neighbourhood import MutualInformationConfig
from baselines.strategies.rules.mutual_information import MutualInformation
from entropy_explore_env.envs.parallel_env import EntropyExploreEnv


@dataclass(frozen=True)
class Run:
    """Runs a mission of a cell, with a coordination of its own where there is one."""

    coordination: MutualInformationConfig | None = None

    def __call__(self, env: EntropyExploreEnv, strategy: str, seed: int) -> Record:
        """Run the mission; the record of coordinated robots has their `decisions`."""
        made = make_strategy(strategy) if self.coordination is None else MutualInformation(self.coordination)
        record = mission_record(env, made, seed)
        if isinstance(made, MutualInformation):
            record["decisions"] = made.decisions
        return record

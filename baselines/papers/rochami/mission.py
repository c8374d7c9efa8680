"""A mission of RochaMI's experiment: with a coordination of its own, and with what the team covers."""

from __future__ import annotations

from dataclasses import dataclass

from baselines.experiments.mission import Record, record_mission
from baselines.papers.rochami.coverage import TeamCoverage
from baselines.strategies import make_strategy
from baselines.strategies.mutual_information.neighbourhood import MutualInformationConfig
from baselines.strategies.rules.mutual_information import MutualInformation
from entropy_explore_env.envs.parallel_env import EntropyExploreEnv


@dataclass(frozen=True)
class Run:
    """Runs a mission of a cell: with a coordination of its own, and with the team's coverage if wanted."""

    coordination: MutualInformationConfig | None = None
    covered: bool = False

    def __call__(self, env: EntropyExploreEnv, strategy: str, seed: int) -> Record:
        """Run the mission; its record has the `decisions` and, if wanted, H(T) and I in `coverage`."""
        coverage = TeamCoverage(env.missions) if self.covered else None
        made = make_strategy(strategy) if self.coordination is None else MutualInformation(self.coordination)
        record = record_mission(env, made, seed, None if coverage is None else coverage.note)
        if isinstance(made, MutualInformation):
            record["decisions"] = made.decisions
        return record if coverage is None else {**record, "coverage": coverage.series()}

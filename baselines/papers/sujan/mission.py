"""A mission of Sujan's planar experiment: what was mapped and driven, scan by scan."""

from __future__ import annotations

from dataclasses import dataclass

from baselines.experiments.mission import run_mission
from baselines.experiments.outcome import Record
from baselines.strategies import make_strategy
from baselines.strategies.rules.next_best_view import NextBestView, NextBestViewConfig
from entropy_explore_env.envs.parallel_env import EntropyExploreEnv
from entropy_explore_env.reports.metrics import mission_figures


@dataclass(frozen=True)
class Run:
    """Runs a mission of a cell, with settings of its own for `next-best-view` where there are some."""

    config: NextBestViewConfig | None = None

    def __call__(self, env: EntropyExploreEnv, strategy: str, seed: int) -> Record:
        """Run the mission.

        Returns:
            The mission's figures, and before the first and after each of the team's scans `mapped`, the share
            mapped of what can be seen, and `driven_m_by_scan`, the way of all robots.
        """
        mapped, driven_m = [0.0], [0.0]

        def note(env: EntropyExploreEnv) -> None:
            robots, clock = env.missions.state.robots[0], env.missions.state.missions[0]
            share = float(clock["explored_visible"] / clock["visible"])
            missing = int(robots["scans"].sum()) + 1 - len(mapped)
            mapped.extend([round(share, 5)] * missing)
            driven_m.extend([round(float(robots["distance_m"].sum()), 2)] * missing)

        made = make_strategy(strategy) if self.config is None else NextBestView(self.config)
        run_mission(env, made, seed, note)
        return {**mission_figures(env.missions, 0), "mapped": mapped, "driven_m_by_scan": driven_m}

"""A mission of a robot that drifts: how wrong it is about its place, its map and its way, scan by scan."""

from __future__ import annotations

from dataclasses import dataclass

from baselines.experiments.mission import run_mission
from baselines.experiments.outcome import Record
from baselines.strategies.rules.next_best_view import NextBestView, NextBestViewConfig
from entropy_explore_env.envs.parallel_env import EntropyExploreEnv
from entropy_explore_env.reports.metrics import mission_figures


@dataclass(frozen=True)
class Run:
    """Runs a mission of a cell with `next-best-view`, whatever the strategy that the cell names.

    Without what lets robots that drift back off from what blocks them (`planner.back_off`): the paper's
    have nothing of the kind.
    """

    config: NextBestViewConfig

    def __call__(self, env: EntropyExploreEnv, strategy: str, seed: int) -> Record:
        """Run the mission.

        Returns:
            The mission's figures, and after each scan `error_m`, of the place, `driven_m_by_scan`, `time_s`,
            `mapped`, the share mapped of what can be seen, and `wrong`, the share of that map on the wrong
            side of ½.
        """
        series: dict[str, list[float]] = {
            name: [] for name in ("error_m", "driven_m_by_scan", "time_s", "mapped", "wrong")
        }

        def note(env: EntropyExploreEnv) -> None:
            figures = mission_figures(env.missions, 0, floor=False)
            if figures["scans"] == len(series["mapped"]):
                return
            joint = figures["joint"]
            found = {
                "error_m": figures["localization"]["mean_error_m"],
                "driven_m_by_scan": figures["distance_m"],
                "time_s": figures["t_mission_s"],
                "mapped": joint["explored"],
                "wrong": joint["wrong"],
            }
            for name, number in found.items():
                series[name].append(round(float(number), 4))

        run_mission(env, NextBestView(self.config), seed, note, backs_off=False)
        return {**mission_figures(env.missions, 0, floor=False), **series}

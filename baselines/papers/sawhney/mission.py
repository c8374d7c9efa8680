"""A mission of Sawhney's experiment: run until no frontier is left, with the times to explored shares.

Explored is, in plans, the share of the voxels that can be seen from where robots can be; over terrain the
share of all columns whose surface a robot has mapped. Every robot receives everything at once.

A robot that waits for its team scans in place meanwhile. It leaves when that scan is done: up to a scan
later than the last robot arrives.
"""

from __future__ import annotations

import io
import tempfile
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path

import numpy as np
from matplotlib import cbook

from baselines.experiments.mission import run_mission
from baselines.experiments.rows import Record
from baselines.strategies.allocation import ExplorationConfig
from baselines.strategies.rules.per_time_visibility import PerTimeVisibility
from entropy_explore_env.envs.parallel_env import EntropyExploreEnv
from entropy_explore_env.reports.metrics import joint_figures, mission_figures
from entropy_explore_env.settings.scenario import Scenario
from entropy_explore_env.writing import write_atomically

MARKS = (0.5, 0.9, 0.95, 0.99)
"""Explored shares at which the time is taken."""
CEILING_M = 4.0
"""Height of the exposure surface above the ground."""
_FOLDER = tempfile.TemporaryDirectory(prefix="entropy_explore_env-")
ACROSS, UP = 400.0, 50.0
"""Scales of the model."""
_METRES_PER_DEGREE = 111_195.0
"""Along a meridian."""
_KEPT = ("seed", "scans", "distance_m", "blocked_moves", "robots")


@dataclass(frozen=True)
class Run:
    """Runs a mission of a cell.

    Attributes:
        exploring: Of the robots.
        over_model: Whether the model of real ground takes the place of the cell's world.
    """

    exploring: ExplorationConfig
    over_model: bool = False

    def __call__(self, env: EntropyExploreEnv, strategy: str, seed: int) -> Record:
        """Run the mission.

        Returns:
            `t50_s`, `t90_s`, `t95_s`, `t99_s`, `t_none_s`: when so much was explored, and when no frontier
            was left; the time limit where that never happened; `finished`: whether none was left; and counts.
        """
        del strategy
        env = _over_model(env.scenario) if self.over_model else env
        explorer = PerTimeVisibility(self.exploring)
        times_s, shares = explore_until_done(env, explorer, seed)
        figures = mission_figures(env.missions, 0)
        limit_s = env.scenario.ending.time_limit_s
        finished, end_s = all(explorer.idle), times_s[-1]
        reached = {f"t{100 * mark:.0f}_s": _reached(times_s, shares, mark, limit_s) for mark in MARKS}
        return {
            **{name: figures[name] for name in _KEPT},
            **reached,
            "t_none_s": round(float(end_s), 3) if finished else limit_s,
            "finished": finished,
            "explored": round(float(shares[-1]), 5),
        }


def explore_until_done(
    env: EntropyExploreEnv, explorer: PerTimeVisibility, seed: int
) -> tuple[Sequence[float], Sequence[float]]:
    """Run a mission until all robots find nothing unexplored, or it is cut off.

    Returns:
        Times and explored shares after the reset and each step.
    """
    times_s, shares = [0.0], [0.0]

    def note(actions: Mapping[str, object]) -> bool:
        del actions
        view = env.view(env.deciding_agents()[0])
        joint = None if view.ceiling is not None else joint_figures(env.missions, 0)
        times_s.append(view.time_s)
        shares.append(explorer.mapped_share() if joint is None else float(joint["explored"] or 0.0))
        return all(explorer.idle)

    run_mission(env, explorer, seed, before_step=note)
    return times_s, shares


def _reached(times_s: Sequence[float], shares: Sequence[float], mark: float, limit_s: float) -> float:
    """Return the first time with this share."""
    there = np.flatnonzero(np.asarray(shares) >= mark)
    return round(float(times_s[there[0]]), 3) if len(there) else limit_s


@lru_cache(maxsize=1)
def _over_model(scenario: Scenario) -> EntropyExploreEnv:
    """Return an environment over the model of real ground, kept for the next mission."""
    return EntropyExploreEnv(scenario, world={"path": model_file(), "ceiling_m": CEILING_M})


@lru_cache(maxsize=1)
def model_file() -> str:
    """Return the path of a model of real ground to fly over, a height map that `load_world` reads.

    It is written for this process from the elevations of Jacksboro, Tennessee, that come with matplotlib.
    30 × 32 km become 1 : 400, as wide as the other terrains; 840 m become 1 : 50, as high as they are. The
    ridges of the fault stand out as they do in pictures of it, eight times as steep as they are.
    """
    with np.load(
        cbook.get_sample_data("jacksboro_fault_dem.npz", asfileobj=False), allow_pickle=False
    ) as dem:
        elevation_m, middle = dem["elevation"] / UP, 0.5 * np.radians(dem["ymin"] + dem["ymax"])
        spacing_m = np.array([dem["dx"] * np.cos(middle), dem["dy"]]) * _METRES_PER_DEGREE / ACROSS
    buffer = io.BytesIO()
    np.savez_compressed(buffer, elevation=elevation_m, spacing_m=spacing_m)
    path = Path(_FOLDER.name) / "jacksboro.npz"
    write_atomically(path, buffer.getvalue())
    return str(path)

"""Pictures of running missions: what a Frame shows of a mission, and when one is drawn."""

from __future__ import annotations

import importlib.util
from pathlib import Path

import numpy as np
from gymnasium import logger

from entropy_explore_env.errors import SettingError, did_you_mean
from entropy_explore_env.missions.faults import failing
from entropy_explore_env.missions.localization import pose_errors
from entropy_explore_env.missions.simulation import Missions
from entropy_explore_env.reports.animation import Window
from entropy_explore_env.reports.projection import shares_left
from entropy_explore_env.reports.recording import DrivenPaths, believed_poses_now, poses_now
from entropy_explore_env.reports.rendering import Frame, draw_frame
from entropy_explore_env.worlds.given import GIVEN
from entropy_explore_env.worlds.recipes.catalogue import RECIPES

RENDER_MODES = ("human", "rgb_array")
FRAMES_PER_S = 10


def offered_modes() -> list[str]:
    """Return the render modes that can be had with what is installed: a window needs the extra `render`."""
    try:
        window = importlib.util.find_spec("pygame") is not None
    except ImportError:
        window = False
    return [mode for mode in RENDER_MODES if window or mode != "human"]


def check_render_mode(render_mode: str | None) -> None:
    """Raise a SettingError unless the mode is None or known."""
    if render_mode is not None and (not isinstance(render_mode, str) or render_mode not in RENDER_MODES):
        allowed = "None, " + " or ".join(RENDER_MODES) + did_you_mean(render_mode, RENDER_MODES)
        raise SettingError("render_mode", render_mode, allowed)


def entropy_share(missions: Missions, mission: int, robot: int) -> np.ndarray:
    """Return (X, Y, Z) float32, each voxel's share of entropy that is left: 1 at the prior, 0 at σ_end."""
    known, prior = (float(missions.rules.params[name][0]) for name in ("end_precision", "prior_precision"))
    return shares_left(missions.precision[mission, robot], prior, known)


def remaining_share(missions: Missions, mission: int) -> np.ndarray:
    """Return (A,), the share of the bits asked of each robot's map that is left, from 1 to 0."""
    clock = missions.state.missions[mission]
    start, end = clock["entropy_start_bits"], clock["entropy_end_bits"]
    return (missions.state.robots[mission]["entropy_bits"] - end) / (start - end)


def world_name(missions: Missions, mission: int) -> str:
    """Return the name of a mission's world: the scenario's, that of its file, or of the given World."""
    name, world = missions.scenario.world, missions.worlds[mission]
    if name == GIVEN and world is not None:
        return world.name
    return missions.scenario.name if name in RECIPES else Path(name).stem


class Painter:
    """Follows one of some missions and draws it; does nothing without a render mode."""

    def __init__(self, render_mode: str | None, number: int = 0) -> None:
        """Take the mode (None, `human` or `rgb_array`) and the number of the mission to follow."""
        self._mode, self._number = render_mode, number
        self._window: Window | None = None
        self._mission: tuple[int, int] | None = None
        self._times: list[float] = []
        self._shares: list[np.ndarray] = []
        self._paths = DrivenPaths(0)

    def watch(self, missions: Missions) -> None:
        """Record the moment after a reset or a step; mode `human` shows it at once."""
        if self._mode is None:
            return
        time_s = float(missions.state.missions[self._number]["time_s"])
        mission = (missions.seeds[self._number], missions.episodes[self._number])
        if mission != self._mission or time_s == 0.0:
            self._mission = mission
            self._times, self._shares = [], []
            self._paths = DrivenPaths(missions.scenario.robots, self._number)
        if not self._times or time_s > self._times[-1]:  # otherwise only other missions advanced
            self._times.append(time_s)
            self._shares.append(remaining_share(missions, self._number))
            self._paths.update(missions)
        if self._mode == "human":
            if self._window is None:
                self._window = Window(frames_per_s=float(FRAMES_PER_S))
            self._window.show(self.paint(missions))

    def picture(self, missions: Missions) -> np.ndarray | None:
        """Return the picture of this moment, (480, 640, 3) uint8, in mode `rgb_array`; otherwise None.

        Without a mode a warning says how to get one.

        Raises:
            CallOrderError: The mission was not reset yet.
        """
        if self._mode is None:
            logger.warn("render() shows nothing: give the environment render_mode='rgb_array' or 'human'")
        if self._mode != "rgb_array":
            return None
        missions.check_begun("render", self._number)
        return self.paint(missions)

    def __getstate__(self) -> dict[str, object]:
        """Return all but the window, which cannot be copied; a copy opens a window of its own."""
        return {**self.__dict__, "_window": None}

    def paint(self, missions: Missions) -> np.ndarray:
        """Draw this moment of the mission, (480, 640, 3) uint8; see `frame`."""
        return draw_frame(self.frame(missions))

    def frame(self, missions: Missions) -> Frame:
        """Return what a picture shows of this moment: the belief of robot_0, and the whole team.

        Robots that drift are drawn where they believe they are, which is the map's frame, with an ellipse of
        two standard deviations and a line to where they are; the paths are those that they truly drove.

        Args:
            missions: The curves and the driven paths show the moments at which they were watched.
        """
        robots = missions.state.robots[self._number]
        time_s = float(missions.state.missions[self._number]["time_s"])
        poses = believed_poses_now(missions, self._number)
        drifts, estimates = missions.scenario.drifts, missions.state.estimates[self._number]
        shares = np.stack(self._shares) if self._shares else np.zeros((0, len(robots)))
        stopped = failing(missions.state.faults[self._number], time_s)["stopped"]  # (0,) without faults
        summaries = missions.scenario.channel.content == "summaries"
        sent = ("bits", "bits_sent") if summaries else ("rays", "measurements_sent")
        status = (
            f"time {time_s:,.0f} s",
            f"entropy left {max(remaining_share(missions, self._number).min(), 0.0):.1%}",
            f"scans {robots['scans'].sum():,}",
            f"{sent[0]} sent {robots[sent[1]].sum():,}",
            f"driven {robots['distance_m'].sum():,.1f} m",
            *((f"pose error {max(pose_errors(estimates))[0]:.2f} m at most",) if drifts else ()),
            *((f"stopped {stopped.sum()} of {len(robots)}",) if missions.scenario.faults.happen else ()),
        )
        return Frame(
            entropy_share=entropy_share(missions, self._number, 0),
            coverage=missions.mean[self._number, 0],
            voxel_size_m=missions.grid.voxel_size_m,
            origin_m=np.asarray(missions.grid.origin_m),
            positions_m=poses[:, :3],
            gazes_rad=poses[:, 3:],
            targets_m=robots["target"][:, :3],
            paths_m=self._paths.to_now(missions) if self._times else [],
            curve_s=np.asarray(self._times),
            curve_share=shares,
            title=f"{world_name(missions, self._number)}: belief of robot_0",
            status=status,
            stopped=tuple(np.flatnonzero(stopped).tolist()),
            kinds=len(missions.scenario.kinds),
            covariances_m2=estimates["covariance"][:, :3, :3],
            true_m=poses_now(missions, self._number)[:, :3] if drifts else np.zeros((0, 3)),
            fiducials_m=missions.state.fiducials[self._number],
        )

    def close(self) -> None:
        """Close the window, if there is one."""
        if self._window is not None:
            self._window.close()
            self._window = None

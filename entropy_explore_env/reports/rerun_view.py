"""A mission on a timeline for Rerun's viewer, an `.rrd`: simulated seconds; map frame, metres, z up.

Entities: `world/entropy/*` and `world/coverage/*`, the belief of robot_0 by blocks of voxels; of each robot
`world/robots/*` (pose), `world/paths/*`, `world/cones/*` (field of view of the latest scan) and
`world/shared/*` (rays that it sent to teammates); `entropy_left/*` and `shared_measurements` as curves. A
block is written again only when much of it has changed: the file grows with new information, not with time.
"""

from __future__ import annotations

import math
import os
import tempfile
from pathlib import Path
from types import TracebackType
from typing import Any

import numpy as np

from entropy_explore_env.errors import imported
from entropy_explore_env.missions.simulation import Missions
from entropy_explore_env.reports.colours import COLOURS, robot_colour
from entropy_explore_env.reports.painting import entropy_share, remaining_share, world_name
from entropy_explore_env.reports.projection import KNOWN_BELOW
from entropy_explore_env.reports.recording import DrivenPaths, poses_now
from entropy_explore_env.robots.channel import select_measurements
from entropy_explore_env.robots.range_sensor import Return, sensor_model
from entropy_explore_env.robots.rotations import directions_of, quaternion_of, ray_directions
from entropy_explore_env.settings.sensor import RangeSensor

TIMELINE = "simulated"
MAX_CELLS = 300_000
"""Larger worlds are shown by cells of several voxels."""
_BLOCK = 8
"""Cells along the edge of a block."""
_CHANGED = 0.1
"""A block is written again when this share of its cells changed."""
_VOXELS_EVERY_S = 1.0
_LEVELS = 16
"""Levels of entropy that are distinguished."""
_UNKNOWN = 127
_PART = 64
"""Points of a path that are written together."""


class RerunView:
    """Writes the first of some missions to a file; as a context manager it removes an unfinished file."""

    def __init__(self, missions: Missions, path: Path) -> None:
        """Start a recording of a mission that has just been reset.

        Args:
            missions: To follow.
            path: The file, an `.rrd`; it appears when the recording is finished.

        Raises:
            MissingExtraError: rerun-sdk is not installed.
            OSError: The folder cannot be written to.
        """
        rr = imported("rerun", "rerun-sdk", "viewer")
        self.path, self._missions, self._rr = path, missions, rr
        name = f"{world_name(missions, 0)}, seed {missions.seeds[0]}"
        together = rr.ChunkBatcherConfig(flush_tick=3600.0, flush_num_bytes=1 << 22)
        self._stream = rr.RecordingStream("entropy_explore_env", recording_id=name, batcher_config=together)
        handle, temporary = tempfile.mkstemp(dir=path.parent, prefix=f".{path.name}.")
        os.close(handle)
        self._temporary: Path | None = Path(temporary)
        self._stream.save(temporary, default_blueprint=_blueprint())
        self._stream.set_log_time_enabled(False)
        self._stream.set_log_tick_enabled(False)
        self._voxels = _Cells(missions.grid.shape)
        self._due_s = 0.0
        robots = missions.scenario.robots
        self._scans = np.zeros(robots, np.int64)
        self._sent = np.zeros(robots, np.int64)
        self._driven, self._passed = DrivenPaths(robots), [0] * robots
        self._paths: list[list[np.ndarray]] = [[] for _ in range(robots)]
        self._log_static()

    def __enter__(self) -> RerunView:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        if self._temporary is not None:
            self._stream.disconnect()
            self._temporary.unlink(missing_ok=True)

    def finish(self) -> None:
        """Write the rest; the file exists and is complete when this returns."""
        assert self._temporary is not None
        self._log_voxels(least=0.0)
        self._stream.flush()
        self._stream.disconnect()
        with self._temporary.open("rb+") as file:
            os.fsync(file.fileno())
        self._temporary.chmod(0o644)
        self._temporary.replace(self.path)
        self._temporary = None

    def note(self) -> None:
        """Write this moment, after the reset or a step."""
        rr, missions = self._rr, self._missions
        time_s = float(missions.state.missions[0]["time_s"])
        self._stream.set_time(TIMELINE, duration=time_s)
        poses, left = poses_now(missions, 0), remaining_share(missions, 0)
        robots = missions.state.robots[0]
        self._driven.update(missions)
        for robot, (x, y, z, yaw, pitch) in enumerate(poses.tolist()):
            quaternion = rr.Quaternion(xyzw=quaternion_of(yaw, pitch))
            pose = rr.Transform3D(translation=(x, y, z), quaternion=quaternion)
            self._stream.log(f"world/robots/robot_{robot}", pose)
            for position_m in [*self._driven.passed_m[robot][self._passed[robot] :], poses[robot, :3]]:
                self._log_path(robot, position_m)
            self._passed[robot] = len(self._driven.passed_m[robot])
            self._stream.log(f"entropy_left/robot_{robot}", rr.Scalars(float(left[robot])))
        sent = int(robots["measurements_sent"].sum())
        self._stream.log("shared_measurements", rr.Scalars(float(sent)))
        for robot in np.flatnonzero(robots["scans"] > self._scans):
            self._log_scan(int(robot))
        self._scans, self._sent = robots["scans"].copy(), robots["measurements_sent"].copy()
        if time_s >= self._due_s:
            self._log_voxels(least=_CHANGED)
            self._due_s = time_s + _VOXELS_EVERY_S

    def _log_static(self) -> None:
        """Log what does not change: axes, the workspace's edges, bodies and colours."""
        rr, missions = self._rr, self._missions
        grid, robots = missions.grid, missions.scenario.robots
        half = 0.5 * grid.size_m
        centre = np.asarray(grid.origin_m) + half
        edges = rr.Boxes3D(centers=[centre], half_sizes=[half], colors=[(120, 120, 120)])
        self._stream.log("world", rr.ViewCoordinates.RIGHT_HAND_Z_UP, static=True)
        self._stream.log("world/workspace", edges, static=True)
        for robot in range(robots):
            body_m = missions.scenario.kind_of(robot).robot.body_radius_m
            radius = max(body_m, 0.25 * grid.voxel_size_m)
            colour = robot_colour(robot)
            body = rr.Points3D([(0.0, 0.0, 0.0)], radii=[radius], colors=[colour])
            self._stream.log(f"world/robots/robot_{robot}/body", body, static=True)
            line = rr.SeriesLines(colors=[colour], names=[f"robot_{robot}"])
            self._stream.log(f"entropy_left/robot_{robot}", line, static=True)

    def _log_path(self, robot: int, position_m: np.ndarray) -> None:
        """Add a point to a robot's path, and write the part of the path that it belongs to."""
        path = self._paths[robot]
        if path and np.array_equal(path[-1], position_m):
            return
        path.append(position_m.copy())
        part = max(len(path) - 2, 0) // _PART
        points = np.stack(path[part * _PART :])  # starts at the last point of the part before
        strip = self._rr.LineStrips3D([points], colors=[robot_colour(robot)])
        self._stream.log(f"world/paths/robot_{robot}/{part:04}", strip)

    def _log_scan(self, robot: int) -> None:
        """Log the field of view of a robot's latest scan, and the rays that were sent."""
        rr, missions, colour = self._rr, self._missions, robot_colour(robot)
        own, sensor = missions.state.robots[0, robot], missions.scenario.kind_of(robot).sensor
        pose, depth_m = own["scan_pose"], max(float(own["depth_m"]), missions.grid.voxel_size_m)
        cone = [pose[:3] + depth_m * edge for edge in cone_edges(sensor, pose[3], pose[4])]
        self._stream.log(f"world/cones/robot_{robot}", rr.LineStrips3D(cone, colors=[colour]))
        ends = np.zeros((0, 3))
        if own["measurements_sent"] > self._sent[robot]:
            ends = shared_ends_m(missions, robot)
        rays = np.stack([np.broadcast_to(pose[:3], ends.shape), ends], axis=1)
        self._stream.log(f"world/shared/robot_{robot}", rr.LineStrips3D(rays, colors=[colour]))

    def _log_voxels(self, least: float) -> None:
        """Write the blocks of which at least this share of cells changed, and at least one cell."""
        rr, grid, cells = self._rr, self._missions.grid, self._voxels
        edge_m = grid.voxel_size_m * cells.stride
        for block, voxels, levels, covered in cells.changed(self._missions, least):
            centres = np.asarray(grid.origin_m) + (voxels + 0.5) * edge_m
            known = levels != _UNKNOWN
            shades = COLOURS["entropy"][levels[known] * 255 // _LEVELS]
            points = rr.Points3D(centres[known], radii=[0.2 * edge_m], colors=shades)
            self._stream.log(f"world/entropy/{block}", points)
            boxes = rr.Boxes3D(
                centers=centres[covered],
                half_sizes=[(0.5 * edge_m,) * 3],
                colors=[(90, 96, 110)],
                fill_mode="solid",
            )
            self._stream.log(f"world/coverage/{block}", boxes)


class _Cells:
    """The cells of the world as they were written last."""

    def __init__(self, shape: tuple[int, int, int]) -> None:
        self.stride = next(
            n for n in range(1, 2048) if math.prod(-(-edge // n) for edge in shape) <= MAX_CELLS
        )
        self._shape = tuple(-(-edge // self.stride) for edge in shape)
        self._levels = np.full(self._shape, _UNKNOWN, np.int8)
        self._covered = np.zeros(self._shape, np.bool_)

    def changed(
        self, missions: Missions, least: float
    ) -> list[tuple[str, np.ndarray, np.ndarray, np.ndarray]]:
        """Return the blocks to write: name, cells (N, 3), levels of entropy (N,) and whether covered (N,)."""
        levels, covered = self._seen(missions)
        differs = (levels != self._levels) | (covered != self._covered)
        blocks = []
        for corner in np.argwhere(_block_sums(differs) > 0):
            part = tuple(slice(first, first + _BLOCK) for first in corner * _BLOCK)
            if differs[part].mean() >= least:
                self._levels[part], self._covered[part] = levels[part], covered[part]
                cells = np.argwhere(np.ones(levels[part].shape, np.bool_)) + corner * _BLOCK
                name = "_".join(map(str, corner))
                blocks.append((name, cells, levels[part].ravel().astype(np.int64), covered[part].ravel()))
        return blocks

    def _seen(self, missions: Missions) -> tuple[np.ndarray, np.ndarray]:
        """Return each cell's level of entropy, int8, _UNKNOWN where little is known; which are covered."""
        share = entropy_share(missions, 0, 0)
        covered = (share < KNOWN_BELOW) & (missions.mean[0, 0] > 0.5)
        if self.stride > 1:
            starts = [np.arange(0, edge, self.stride) for edge in share.shape]
            counts = np.ones(1, np.float32)
            for axis, first in enumerate(starts):
                share = np.add.reduceat(share, first, axis=axis)
                covered = np.logical_or.reduceat(covered, first, axis=axis)
                sizes = np.diff(first, append=missions.grid.shape[axis]).astype(np.float32)
                counts = np.multiply.outer(counts, sizes)
            share = share / counts[0]
        levels = np.where(share < KNOWN_BELOW, np.rint(share * _LEVELS), _UNKNOWN)
        return levels.astype(np.int8), covered


def _block_sums(cells: np.ndarray) -> np.ndarray:
    """Return how many cells of each block are True."""
    counts = cells.astype(np.int32)
    for axis, edge in enumerate(cells.shape):
        counts = np.add.reduceat(counts, np.arange(0, edge, _BLOCK), axis=axis)
    return counts


def cone_edges(sensor: RangeSensor, yaw: float, pitch: float) -> list[np.ndarray]:
    """Return polylines (N, 3) around the view of a sensor at (0, 0, 0), 1 m away: outline and edges."""
    model = sensor_model(sensor)
    yaws = np.linspace(model.yaw_offsets[0], model.yaw_offsets[-1], 17) + yaw
    low, high = (directions_of(yaws, pitch + model.pitch_offsets[end]) for end in (-1, 0))
    sides = [np.stack([arc[0], np.zeros(3), arc[-1]]) for arc in (low, high)]
    return [low, *sides[:1]] if len(model.pitch_offsets) == 1 else [low, high, *sides]


def shared_ends_m(missions: Missions, robot: int) -> np.ndarray:
    """Return the end points (N, 3) float64 of what a robot sent of its latest scan, best first."""
    scenario, state = missions.scenario, missions.state
    own, sensor = state.robots[0, robot], scenario.kind_of(robot).sensor
    model = sensor_model(sensor)
    measured = state.scan_returned[0, robot, : sensor.rays] != int(Return.NOTHING)
    utility = np.where(measured, state.scan_utility_bits[0, robot, : sensor.rays], -1.0)
    order = np.zeros(len(utility), np.int64)
    burst = min(scenario.channel.burst, sensor.rays)
    chosen = order[: select_measurements(utility, burst, float(own["i_min_bits"]), order)]
    directions = ray_directions(model.yaw_offsets, model.pitch_offsets, *own["scan_pose"][3:])
    rays = directions * state.scan_range_m[0, robot, : sensor.rays][:, None]
    return own["scan_pose"][:3] + rays[chosen]


def _blueprint() -> Any:  # noqa: ANN401 - Rerun's
    """Return how the viewer opens: entropy beside coverage, the curves below."""
    import rerun.blueprint as rrb

    views = [
        rrb.Spatial3DView(origin="/world", name=name, contents=["+ /world/**", f"- /world/{hidden}/**"])
        for name, hidden in (("entropy of robot_0's belief", "coverage"), ("coverage", "entropy"))
    ]
    curves = [
        rrb.TimeSeriesView(origin="/entropy_left", name="entropy left"),
        rrb.TimeSeriesView(origin="/shared_measurements", name="shared measurements"),
    ]
    maps, series = rrb.Horizontal(*views), rrb.Horizontal(*curves)
    return rrb.Blueprint(rrb.Vertical(maps, series, row_shares=[3, 1]), collapse_panels=True)

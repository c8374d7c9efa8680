"""Where an Explorer plans: a workspace that follows the map, or a scenario's own grid."""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence

import numpy as np

from entropy_explore_env.belief.entropy import map_entropy_bits
from entropy_explore_env.belief.replacement import replace_region
from entropy_explore_env.errors import CallOrderError, SettingError
from entropy_explore_env.explorer.canvas import Canvas, grid_of
from entropy_explore_env.explorer.given_maps import Patch, box_of
from entropy_explore_env.explorer.workspace import Workspace
from entropy_explore_env.robots.rotations import turned_by
from entropy_explore_env.settings.grid import Grid
from entropy_explore_env.settings.scenario import Scenario
from entropy_explore_env.settings.sensor import RangeSensor

_MARGIN = 32
"""Voxels of unknown space that lie around what is known at least; fewer where the sensor sees less far."""


class Ground:
    """A belief in a canvas that grows, and its entropy.

    Attributes:
        begun: How many canvases there were: with each one, numbers of voxels change.
        shift: (3,) int64, where the first voxel of the canvas before lies in this one; None = it lies between
            voxels, or there was none.
        entropy_bits: Entropy of the belief.
    """

    def __init__(self, task: Scenario, fixed: bool) -> None:
        """Take a task; where its grid is fixed, there is a canvas at once."""
        self._task, self._fixed = task, fixed
        self._prior = float(np.float32(task.sigma_prior**-2))
        self._voxel_bits = float(map_entropy_bits(np.full((1, 1, 1), self._prior, np.float32)))
        self._workspace: Workspace | None = None
        self.begun, self.entropy_bits = 0, 0.0
        self.shift: np.ndarray | None = None
        if fixed:
            self._begin(Canvas(task.grid, 0.0, self._prior), 0.0, fixed=True)

    @property
    def workspace(self) -> Workspace:
        """The canvas, and how to plan in it.

        Raises:
            CallOrderError: Neither a map nor a scan was given.
        """
        if self._workspace is None:
            raise CallOrderError("there is no map yet: call set_map() or add_scan() first")
        return self._workspace

    @property
    def _canvas(self) -> Canvas | None:
        return None if self._workspace is None else self._workspace.canvas

    def _begin(
        self, canvas: Canvas, known_bits: float, fixed: bool = False, shift: np.ndarray | None = None
    ) -> None:
        """Plan in another canvas, of which this many bits are known."""
        self.shift = None if self._workspace is None else shift
        task = self._task if fixed else dataclasses.replace(self._task, grid=canvas.grid)
        self._workspace, self.begun, self._fixed = Workspace(canvas, task), self.begun + 1, fixed
        self.entropy_bits = canvas.grid.voxels * self._voxel_bits - known_bits

    @property
    def flat(self) -> bool:
        """Whether the canvas is one voxel high, or would be for a scan without a map."""
        return self._task.planar if self._canvas is None else self._canvas.grid.flat

    def _stays_level(self, layers: int) -> bool:
        """Return whether the canvas is as high as the maps, above whose floor robots stay in a plane."""
        return layers == 1 or any(kind.robot.motion == "planar" for kind in self._task.kinds)

    def _with_margin(
        self, box: tuple[np.ndarray, np.ndarray], layers: int, times: int
    ) -> tuple[np.ndarray, np.ndarray]:
        """Return a box of known voxels, with unknown ones around it."""
        reach = max(kind.sensor.max_range_m for kind in self._task.kinds) / self._task.grid.voxel_size_m
        margin = np.full(3, times * int(min(np.ceil(reach), _MARGIN)))
        low, high = box[0] - margin, box[1] + margin
        if self._stays_level(layers):
            low[2], high[2] = min(0, int(box[0][2])), layers
        return low, high

    def room_for(self, patch: Patch) -> np.ndarray:
        """Let the canvas hold what is known of a map; return its first voxel (3,) in the canvas.

        Raises:
            SettingError: Nothing is known of it, it lies too far from the map before, or it has other
                dimensions.
        """
        shape, box, canvas = patch.shape, patch.box, self._canvas
        (x, y, yaw_rad), flat = patch.corner, shape[2] == 1
        if box is None:
            raise SettingError("grid", "nothing but unknown voxels", "a map of which something is known")
        if canvas is not None and flat != canvas.grid.flat:
            raise SettingError("grid", shape, "a map of as many dimensions as before")
        place = turned_by(np.array([x, y, 0.0 if flat else patch.bottom_m]), -yaw_rad)
        if canvas is not None and flat:
            place[2] = canvas.grid.origin_m[2]
        low = canvas.offset_of(place) if canvas is not None and canvas.yaw_rad == yaw_rad else None
        if canvas is not None and low is not None:
            layers = max(canvas.grid.shape[2], int(low[2]) + shape[2])
            try:
                return low - self._grow(canvas, (low + box[0], low + box[1]), layers)
            except SettingError:
                if (np.abs(low) <= canvas.grid.shape).all():
                    raise
                above = np.abs(low).argmax() == 2
                name, value = ("bottom_m", patch.bottom_m) if above else ("origin", patch.corner)
                allowed = "a corner near enough for one grid to hold this map and what was known before"
                raise SettingError(name, value, allowed) from None
        edge_m, (first, last) = self._task.grid.voxel_size_m, self._with_margin(box, shape[2], 2)
        grid = grid_of(last - first, edge_m, place + first * edge_m)
        self._begin(Canvas(grid, yaw_rad, self._prior), 0.0)
        return -first

    def _grow(self, canvas: Canvas, box: tuple[np.ndarray, np.ndarray], layers: int) -> np.ndarray:
        """Let a canvas hold a box of voxels; return the first voxel (3,) of the new one in the old one.

        A scenario's own grid stays as it is for what lies in it: its boundary is a wall.
        """
        if canvas.holds(*box) and (self._fixed or canvas.holds(*self._with_margin(box, layers, 1))):
            return np.zeros(3, np.int64)
        known = box_of(canvas.known)
        if known is not None:
            box = np.minimum(box[0], known[0]), np.maximum(box[1], known[1])
        low, high = self._with_margin(box, layers, 2)
        known_bits = canvas.grid.voxels * self._voxel_bits - self.entropy_bits
        self._begin(canvas.grown(low, high), known_bits, shift=-low)
        return low

    def room_for_scan(self, pose: np.ndarray, sensor: RangeSensor) -> None:
        """Let the canvas hold all that a scan from a pose (5,), map frame, may cross.

        Raises:
            SettingError: The sensor's range has no end.
        """
        if self._fixed:
            return
        if not np.isfinite(sensor.max_range_m):
            raise SettingError("RangeSensor.max_range_m", sensor.max_range_m, "finite, unless a map is set")
        canvas, edge_m = self._canvas, self._task.grid.voxel_size_m
        if canvas is None:
            high = 0 if self._task.planar else int(np.ceil((sensor.max_range_m + pose[2]) / edge_m))
            grid = Grid((1, 1, max(high, 0) + 1), edge_m, (float(pose[0]), float(pose[1]), 0.0))
            canvas = Canvas(grid, 0.0, self._prior)
        around, layers = int(np.ceil(sensor.max_range_m / edge_m)) + 1, canvas.grid.shape[2]
        at = canvas.grid.voxel_of(turned_by(pose, -canvas.yaw_rad)[:3])
        low, high_corner = at - around, at + around + 1
        if self._stays_level(layers):
            low[2], high_corner[2] = 0, layers
        if canvas.holds(low, high_corner):
            return
        if self._workspace is None:
            self.entropy_bits = canvas.grid.voxels * self._voxel_bits
        self._grow(canvas, (low, high_corner), layers)

    def write(self, low: np.ndarray, patch: Patch, boxes: np.ndarray) -> tuple[float, np.ndarray]:
        """Replace what is believed where a map lies, which begins in the canvas's voxel `low`.

        Args:
            low: (3,) int64.
            patch: The map.
            boxes: (B, 2, 3) int64, first and last voxels of boxes.

        Returns:
            Bits that this took from the belief, and (B,) those inside each box.
        """
        canvas, gains, bits = self.workspace.canvas, np.zeros(len(boxes)), 0.0
        belief = canvas.mean.reshape(-1), canvas.precision.reshape(-1)
        for x, mean, precision in patch.parts():
            at = low + np.array([x, 0, 0])
            bits += float(replace_region(belief, canvas.grid.shape, at, (mean, precision), boxes, gains))
        self.entropy_bits -= bits
        return bits, gains


def boxes_around(places: Sequence[np.ndarray | None], reaches_m: Sequence[float], grid: Grid) -> np.ndarray:
    """Return (B, 2, 3) int64, first and last voxels within a reach of places; of None all voxels."""
    boxes = np.zeros((len(places), 2, 3), np.int64)
    boxes[:, 1] = grid.shape
    for number, (place, reach_m) in enumerate(zip(places, reaches_m, strict=True)):
        if place is not None:
            around = int(min(reach_m / grid.voxel_size_m, float(sum(grid.shape)))) + 1
            at = grid.voxel_of(place[:3])
            boxes[number] = at - around, at + around
    return boxes

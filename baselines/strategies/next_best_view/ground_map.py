"""The ground as a rover knows it: an elevation map, completed, and its interest in columns (Sujan, sect. 2).

Arrays (X, Y) hold a number for each column of voxels. Unknown columns have the mean height of their
neighbours (fig. 7), with a standard deviation of a voxel edge, ours.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Literal

import numpy as np
from scipy.ndimage import distance_transform_edt

from baselines.strategies.next_best_view.elevation_view import Camera, Ground, fill_visibility
from baselines.strategies.next_best_view.expected_view import window_in_reach
from entropy_explore_env.belief.elevation import ElevationMap, completed, elevation_map
from entropy_explore_env.frontiers.knowledge import voxel_of
from entropy_explore_env.robots.knowledge import RobotKnowledge

EdgeForm = Literal["line", "polygon"]
WHEEL_M = 0.2
"""Diameter of a wheel: a higher step is no part of the plateau, and the polygon is this near to its edge."""
_UNKNOWN_SIGMA = 1.0
"""Of heights that are not measured, in voxel edges."""
_COMPLETION_M = 0.05
"""Precision of completed heights."""
_HALF_DIAGONAL = 0.5 * math.sqrt(2.0)
_MARGIN = 1.0
"""Columns that a rover keeps from those that may not carry it: at the edge a map can be a column wrong."""


@dataclass
class Look:
    """A scan that was expected to show something, and what it showed."""

    expected: float
    """New columns, the sum of P_V over unknown ones."""
    obtained: int = 0
    """Columns that were unknown before it."""


def column_of(view: RobotKnowledge, pose: np.ndarray) -> tuple[int, int]:
    """Return the column of a pose, the nearest one for poses outside."""
    x, y, _ = np.unravel_index(voxel_of(view, pose), view.scenario.grid.shape)
    return int(x), int(y)


def camera_of(view: RobotKnowledge) -> Camera:
    """Return the view of a rover's sensor."""
    sensor = view.kind.sensor
    yaw, pitch = sensor.field_of_view_rad
    return Camera(0.5 * yaw, 0.5 * pitch, sensor.max_range_m / view.scenario.grid.voxel_size_m)


class GroundMap:
    """What one rover keeps of the ground from one decision to the next; paths lead over it.

    Attributes:
        known: Elevation map at the latest decision.
        traversal_cost: (V,) float32, 1 where the rover may stand by it, else inf.
        interest: (X, Y) float64, eq. 9.
        looks: Scans that were chosen for what they should show, in order.
    """

    body_reach = 0
    """Voxels that the body extends beyond its own: columns are safe for all of it."""

    def __init__(self, view: RobotKnowledge) -> None:
        """Begin where a rover stands."""
        self.traversal_cost = np.full(view.scenario.grid.voxels, np.float32(np.inf))
        shape = view.scenario.grid.shape[:2]
        self.known = measured(view)
        self.interest = np.ones(shape)
        self.looks: list[Look] = []
        self._stood = np.zeros(shape, bool)
        """Columns on which the body has stood."""
        self._height_m = np.full(shape, math.nan)
        """Completed within the window at the latest decision, NaN before the first."""
        self._window = slice(0, None), slice(0, None)
        """Columns that can be seen from known ones, and one more."""
        self._visibility: np.ndarray | None = None
        """(X, Y) P_V from the goal, of a look that is expected to show something."""
        self._stand(view)

    def update(self, view: RobotKnowledge, form: EdgeForm | None) -> ElevationMap:
        """Bring the map up to date with a rover's belief; return the elevation map before.

        Args:
            view: Of the rover.
            form: How the edge of its plateau is taken, behind which it stays; None = only what carries it
                counts.
        """
        before, self.known = self.known, measured(view)
        self._stand(view)
        carrying = self.known.known | self._stood
        self._window = window = window_in_reach(carrying, camera_of(view).reach)
        heights = np.where(self._stood & ~self.known.known, _ground_m(view), self.known.height_m)
        if np.isnan(self._height_m).all():
            self._height_m[:] = heights[carrying].min()
        begin = self._height_m[window]
        self._height_m[window] = completed(heights[window], carrying[window], _COMPLETION_M, begin)
        costs = self.traversal_cost.reshape(view.scenario.grid.shape)
        layer = view.scenario.layer_of(view.kind.robot)
        costs[:, :, layer] = np.where(self.safe(view, form), np.float32(1.0), np.float32(np.inf))
        self.traversal_cost[voxel_of(view, view.pose)] = 1.0
        return before

    def open_start(self, voxel: int) -> list[int]:
        """Return no voxels: where a rover stands counts as safe."""
        return []

    def close(self, voxels: list[int]) -> None:
        """Change nothing; see `open_start`."""

    def safe(self, view: RobotKnowledge, form: EdgeForm | None) -> np.ndarray:
        """Return (X, Y) bool, in the middle of which columns the rover may stand; see `update`."""
        from baselines.strategies.next_best_view.edge import behind_line, find_edge, inside_polygon

        edge_m, window = view.scenario.grid.voxel_size_m, self._window
        wheel = WHEEL_M / edge_m
        above_m = self.known.height_m[window] - _ground_m(view)
        level = (above_m > -edge_m) & (above_m <= WHEEL_M)  # the highest voxel is that of the ground
        carrying = (level & self.known.known[window]) | self._stood[window]
        if form is not None:
            x, y = column_of(view, view.pose)
            here = x - window[0].start, y - window[1].start
            edge = find_edge(self._height_m[window], here, WHEEL_M, wheel, wheel)
            polygon = form == "polygon"
            within = inside_polygon(edge.polygon, carrying.shape) if polygon else behind_line(edge, here)
            carrying &= within | self._stood[window]
        safe = np.zeros(self._stood.shape, bool)
        safe[window] = safe_columns(carrying, view.kind.robot.planning_radius_m / edge_m + _MARGIN)
        return safe

    def ground(self, view: RobotKnowledge) -> Ground:
        """Return the elevation map in voxel edges above the workspace's floor."""
        grid, known = view.scenario.grid, self.known
        sigma = np.where(known.known, known.sigma_m / grid.voxel_size_m, _UNKNOWN_SIGMA)
        height = (self._height_m - grid.origin_m[2]) / grid.voxel_size_m
        return Ground(height, sigma, known.measurements, self.interest)

    def expect(self, view: RobotKnowledge, pose: np.ndarray) -> None:
        """Note what a look from a pose (5,), in voxel edges, should show."""
        self._visibility = np.empty(self.interest.shape)
        fill_visibility(self.ground(view), camera_of(view), pose, self._visibility)
        self.looks.append(Look(float(self._visibility[~self.known.known].sum())))

    def expect_nothing(self) -> None:
        """Forget the look that was expected last: it will not be taken."""
        self._visibility = None

    def learn(self, before: ElevationMap, decay: float) -> None:
        """Compare what the latest look showed with what it should have, and lose interest (eq. 9).

        Args:
            before: The elevation map before it.
            decay: β.
        """
        if self._visibility is None:
            return
        self.looks[-1].obtained = int((self.known.known & ~before.known).sum())
        silent = self.known.measurements <= before.measurements
        self.interest[silent] *= np.exp(-decay * self._visibility[silent])
        self._visibility = None

    def _stand(self, view: RobotKnowledge) -> None:
        """Note the columns that the body covers where it is: they carry it."""
        here = view.scenario.grid.in_grid_units(view.pose)[:2]
        radius = view.kind.robot.body_radius_m / view.scenario.grid.voxel_size_m
        low = np.maximum(np.floor(here - radius).astype(int), 0)
        high = np.floor(here + radius).astype(int) + 1
        beside = self._stood[low[0] : high[0], low[1] : high[1]]
        x, y = np.ogrid[: beside.shape[0], : beside.shape[1]]
        gaps = [
            np.maximum(np.abs(at + 0.5 - to) - 0.5, 0.0) for at, to in zip((x, y), here - low, strict=True)
        ]
        beside |= gaps[0] ** 2 + gaps[1] ** 2 < radius**2


def measured(view: RobotKnowledge) -> ElevationMap:
    """Return the elevation map of a rover's belief."""
    scenario = view.scenario
    sigma_min = view.kind.sensor.sigma_min
    return elevation_map(view.mean, view.precision, scenario.grid, scenario.sigma_prior, sigma_min)


def _ground_m(view: RobotKnowledge) -> float:
    """Return the height of the ground that carries a rover."""
    layer = view.scenario.ground_layer_of(view.kind.robot)
    assert layer is not None  # rules for rovers have checked it
    return float(view.scenario.grid.origin_m[2] + (layer + 1) * view.scenario.grid.voxel_size_m)


def safe_columns(carrying: np.ndarray, body_radius: float) -> np.ndarray:
    """Return (X, Y) bool, in the middle of which columns all of a body's circle is carried.

    Args:
        carrying: (X, Y) bool, which columns are known to carry the rover.
        body_radius: In columns.
    """
    gaps = np.asarray(distance_transform_edt(np.pad(carrying, 1)))[1:-1, 1:-1]
    return gaps >= body_radius + _HALF_DIAGONAL

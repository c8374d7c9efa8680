"""The truth: which voxels of a workspace are solid, where a body fits, what can be seen at all."""

from __future__ import annotations

import enum
import math
from dataclasses import dataclass
from functools import cached_property
from typing import cast

import numpy as np
from scipy import ndimage
from scipy.spatial import ConvexHull

from entropy_explore_env.errors import WorldError
from entropy_explore_env.scenario import Scenario
from entropy_explore_env.settings import Grid, RobotKind


class Barrier(enum.IntEnum):
    """Why a body cannot be in a voxel."""

    NONE = 0
    """It can."""
    SOLID = 1
    """It would touch something solid, or leave the workspace."""
    GROUND = 2
    """It would touch what is solid in a world with a ceiling: the terrain."""
    CEILING = 3
    """It would reach above the ceiling."""


@dataclass(frozen=True, eq=False, repr=False)
class World:
    """A true world. The boundary of the grid is a wall.

    Attributes:
        grid: Its voxels.
        occupied: (X, Y, Z) bool, read-only; whether a voxel is solid.
        name: Where it came from.
        ceiling: (X, Y) int32, read-only, or None: in each column the first layer that is closed to
            robots, though not to rays (an exposure surface over terrain); Z = none.
        yaw_rad: How the grid's frame is turned against the frame of the file that it came from.
    """

    grid: Grid
    occupied: np.ndarray
    name: str
    ceiling: np.ndarray | None = None
    yaw_rad: float = 0.0

    def __post_init__(self) -> None:
        """Check the arrays and make them read-only."""
        kinds = {"grid": (Grid, "a Grid"), "occupied": (np.ndarray, "a NumPy array"), "name": (str, "a text")}
        for name, (kind, allowed) in kinds.items():
            if not isinstance(getattr(self, name), kind):
                raise WorldError(f"World.{name}", getattr(self, name), allowed)
        if self.occupied.shape != self.grid.shape or self.occupied.dtype != np.bool_:
            found = f"{self.occupied.shape} {self.occupied.dtype}"
            raise WorldError("World.occupied", found, f"{self.grid.shape} bool")
        if self.occupied.all():
            raise WorldError("World.occupied", self.name, "at least one free voxel")
        self.occupied.setflags(write=False)
        if self.ceiling is not None:
            if self.ceiling.shape != self.grid.shape[:2] or self.ceiling.dtype != np.int32:
                found = f"{self.ceiling.shape} {self.ceiling.dtype}"
                raise WorldError("World.ceiling", found, f"{self.grid.shape[:2]} int32")
            if self.ceiling.min() < 0 or self.ceiling.max() > self.grid.shape[2]:
                found = f"{self.ceiling.min()} … {self.ceiling.max()}"
                raise WorldError("World.ceiling", found, f"layers from 0 to {self.grid.shape[2]}")
            self.ceiling.setflags(write=False)

    def __repr__(self) -> str:
        """Its name and voxels, not their content."""
        x, y, z = self.grid.shape
        return f"World({self.name!r}, {x} × {y} × {z} voxels of {self.grid.voxel_size_m:g} m)"

    def barriers(self, body_radius_m: float) -> np.ndarray:
        """Where the centre of a ball-shaped body cannot be, judged at voxel centres.

        Args:
            body_radius_m: Radius of the body in metres.

        Returns:
            (X, Y, Z) uint8, a Barrier each. With a radius of at most half a voxel they are the solid
            voxels, and those from the ceiling on. A body that meets several things meets the ground
            first, then the ceiling, then the boundary.
        """
        solid = self._touching(self.occupied, body_radius_m, boundary=True)
        if self.ceiling is None:
            return solid.view(np.uint8)
        barriers = solid.astype(np.uint8)
        barriers[self.closed(body_radius_m)] = Barrier.CEILING
        barriers[self._touching(self.occupied, body_radius_m, boundary=False)] = Barrier.GROUND
        return barriers

    def closed(self, body_radius_m: float) -> np.ndarray:
        """(X, Y, Z) bool, where a ball-shaped body would reach above the ceiling, whatever else it meets."""
        if self.ceiling is None:
            return np.zeros(self.grid.shape, bool)
        return closed_by(self.ceiling, self.grid.shape[2], body_radius_m / self.grid.voxel_size_m)

    def _touching(self, closed: np.ndarray, body_radius_m: float, boundary: bool) -> np.ndarray:
        """(X, Y, Z) bool: a body in the voxel's centre meets a closed voxel, or leaves the workspace."""
        return _swollen(closed, body_radius_m / self.grid.voxel_size_m, boundary)

    @cached_property
    def _layouts(self) -> dict[tuple[float, int | None, int, tuple[float, float, float] | None], Layout]:
        return {}

    def layout(self, scenario: Scenario, kind: RobotKind | None = None) -> Layout:
        """Where robots of a scenario can start and go, and what they can see; worked out once.

        Args:
            scenario: The task.
            kind: Of the robots; None = the first.

        Raises:
            WorldError: No voxel has room for a robot.
        """
        robot, sensor = (scenario.robot, scenario.sensor) if kind is None else (kind.robot, kind.sensor)
        height, level = scenario.layer_of(robot), None
        if height is not None and not scenario.grid.flat:
            steepest = 0.5 * (sensor.rows - 1) * sensor.angular_step_rad
            level = robot.sensor_height_m, steepest, sensor.max_range_m
        key = (robot.body_radius_m, height, sensor.voxels_behind, level)
        if key not in self._layouts:
            self._layouts[key] = self._laid_out(*key)
        return self._layouts[key]

    def visible(self, scenario: Scenario) -> np.ndarray:
        """(X, Y, Z) bool, which voxels some robot of the team can see at all."""
        first, *others = (self.layout(scenario, kind).visible for kind in scenario.kinds)
        return np.logical_or.reduce([first, *others]) if others else first

    def visible_voxels(self, scenario: Scenario) -> int:
        """How many voxels some robot of the team can see at all."""
        if len(scenario.kinds) == 1:
            return self.layout(scenario).visible_voxels
        return int(self.visible(scenario).sum())

    def _laid_out(
        self,
        body_radius_m: float,
        height: int | None,
        voxels_behind: int,
        level: tuple[float, float, float] | None,
    ) -> Layout:
        barriers = self.barriers(body_radius_m)
        room = barriers == Barrier.NONE
        if height is not None:
            room[:, :, :height] = room[:, :, height + 1 :] = False
        starts = _largest_component(room)
        if not starts.any():
            allowed = f"a world with room for a body of radius {body_radius_m} m"
            if height is not None and not self.grid.flat:
                allowed += f" in layer {height}, where planar robots stay"
            raise WorldError("world", self.name, allowed)
        labels, _ = connected_parts(~self.occupied)
        seen = np.isin(labels, np.unique(labels[starts]))
        if voxels_behind:
            seen |= ndimage.binary_dilation(seen, iterations=voxels_behind) & self.occupied
        if level is not None:
            seen &= self._within_view(np.any(starts, axis=2), *level)
        return Layout(barriers, np.flatnonzero(starts), seen)

    def _within_view(
        self, floor: np.ndarray, sensor_height_m: float, steepest_rad: float, max_range_m: float
    ) -> np.ndarray:
        """Which voxels a sensor that looks level can have in its field of view, obstacles left aside.

        A voxel that is dz above or below the sensor is in view from |dz|/tan φ away, φ the steepest ray: it
        is seen if some place is so far away, and some no farther than the range. Robots' places hang
        together, so one of them is both.

        Args:
            floor: (X, Y) bool, where robots can be.
            sensor_height_m: Above the workspace's floor.
            steepest_rad: Largest angle of a ray above the horizon.
            max_range_m: Of the sensor.

        Returns:
            (X, Y, Z) bool.
        """
        edge_m = self.grid.voxel_size_m
        places = np.argwhere(floor)
        corners = places[ConvexHull(places).vertices] if _spans_plane(places) else places
        x, y = np.indices(self.grid.shape[:2])
        farthest = np.zeros(self.grid.shape[:2])
        for i, j in corners:
            np.maximum(farthest, np.hypot(x - i, y - j), out=farthest)
        nearest = np.asarray(ndimage.distance_transform_edt(~floor))
        rises = np.abs((np.arange(self.grid.shape[2]) + 0.5) * edge_m - sensor_height_m) - 0.5 * edge_m
        needed = np.maximum(rises, 0.0) / max(math.tan(steepest_rad), 1e-9) / edge_m
        reach = max_range_m / edge_m
        return (farthest[:, :, None] >= needed) & (np.maximum(nearest[:, :, None], needed) <= reach)


def _spans_plane(places: np.ndarray) -> bool:
    """Whether (N, 2) points do not lie on one line."""
    return len(places) > 2 and int(np.linalg.matrix_rank(places - places[0])) == 2


@dataclass(frozen=True, eq=False)
class Layout:
    """What a kind of robot can do in a world.

    Attributes:
        barriers: (X, Y, Z) uint8, a Barrier each: whether its body fits into the voxel, or why not.
        starts: (N,) flat indices of the voxels where it may start: the largest connected part.
        visible: (X, Y, Z) bool, which voxels can be seen from there at all: the free space that hangs
            together with it, and the skin of the solid voxels around; for robots that look level only
            what their sensor's field of view can hold.
    """

    barriers: np.ndarray
    starts: np.ndarray
    visible: np.ndarray

    @cached_property
    def visible_voxels(self) -> int:
        """How many voxels can be seen at all."""
        return int(self.visible.sum())


def closed_by(ceiling: np.ndarray, layers: int, body_radius: float) -> np.ndarray:
    """Where a ball-shaped body in a voxel's centre would reach above a ceiling.

    Args:
        ceiling: (X, Y) int32, in each column the first closed layer.
        layers: Z.
        body_radius: In voxel edges.

    Returns:
        (X, Y, Z) bool.
    """
    return _swollen(np.arange(layers) >= ceiling[:, :, None], body_radius, boundary=False)


def _swollen(closed: np.ndarray, radius: float, boundary: bool) -> np.ndarray:
    """(X, Y, Z) bool: a ball in the voxel's centre meets a closed voxel; radius in voxel edges."""
    if radius <= 0.5 + 1e-9:
        return closed
    if 2.0 * radius > max(closed.shape):
        return np.full(closed.shape, boundary or closed.any())
    reach = math.ceil(radius - 0.5)
    height = 0 if closed.shape[2] == 1 else reach
    offsets = np.ogrid[-reach : reach + 1, -reach : reach + 1, -height : height + 1]
    gaps = [np.maximum(np.abs(axis) - 0.5, 0.0) for axis in offsets]
    ball = gaps[0] ** 2 + gaps[1] ** 2 + gaps[2] ** 2 < radius**2 - 1e-9
    walled = np.pad(closed, [(reach, reach), (reach, reach), (height, height)], constant_values=boundary)
    swollen = ndimage.binary_dilation(walled, ball)
    inside = tuple(slice(pad, pad + n) for pad, n in zip((reach, reach, height), closed.shape, strict=True))
    return np.asarray(swollen[inside])


def connected_parts(room: np.ndarray) -> tuple[np.ndarray, int]:
    """Face-connected parts of a (X, Y, Z) bool array: their numbers, from 1, by voxel, and how many."""
    return cast("tuple[np.ndarray, int]", ndimage.label(room))


def _largest_component(room: np.ndarray) -> np.ndarray:
    """The largest face-connected part of a (X, Y, Z) bool array."""
    labels, parts = connected_parts(room)
    if parts <= 1:
        return room
    sizes = np.bincount(labels.ravel())
    sizes[0] = 0
    return labels == int(sizes.argmax())

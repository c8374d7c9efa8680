"""The true world: which voxels are solid, where a robot's body fits, which voxels can be observed at all."""

from __future__ import annotations

import enum
import math
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np
from scipy import ndimage

from entropy_explore_env.errors import WorldError
from entropy_explore_env.settings.grid import Grid
from entropy_explore_env.settings.robot_kind import RobotKind
from entropy_explore_env.settings.scenario import Scenario
from entropy_explore_env.settings.validation import check_instance, is_number
from entropy_explore_env.worlds.components import connected_components, largest_component


class Collision(enum.IntEnum):
    """What a body collides with whose centre is in a voxel."""

    NONE = 0
    """Nothing: the body fits."""
    SOLID = 1
    """A solid voxel, or the boundary of the workspace."""
    GROUND = 2
    """A solid voxel of a world with a ceiling: the terrain."""
    CEILING = 3
    """The ceiling: the body would reach into the no-fly zone."""
    EDGE = 4
    """Nothing, but no ground carries all of the body."""


@dataclass(frozen=True, eq=False, repr=False)
class World:
    """A true world. The boundary of the grid is a wall.

    Attributes:
        grid: The voxel grid.
        occupied: (X, Y, Z) bool, read-only; whether a voxel is solid. A copy, unless the array that was given
            is read-only already.
        name: Of the recipe or the file that it was made from.
        ceiling: (X, Y) int32, read-only and copied likewise, or None: in each column the lowest layer of the
            no-fly zone, which robots must not enter and rays may cross (an exposure surface over terrain);
            Z = no such layer.
        yaw_rad: Rotation of the grid's frame against the frame of the file.
        unknown: (X, Y, Z) bool, read-only and copied likewise, or None: of which solid voxels the file says
            nothing. Pictures show them; to robots they are solid as all others.
        unreadable: (X, Y, Z) bool, read-only and copied likewise, or None: which solid voxels give no return
            to a range sensor (poor texture, glass, black paint). A ray that ends at one measures nothing,
            other than one that ends in the open, which frees what it crossed. No robot can observe them, so
            that endings leave them out.

    Worlds compare and hash by identity: to compare what they hold, compare their arrays.
    """

    grid: Grid
    occupied: np.ndarray
    name: str
    ceiling: np.ndarray | None = None
    yaw_rad: float = 0.0
    unknown: np.ndarray | None = None
    unreadable: np.ndarray | None = None

    def __post_init__(self) -> None:
        """Check the arrays and keep read-only copies of them."""
        kinds = {"grid": (Grid, "a Grid"), "occupied": (np.ndarray, "a NumPy array"), "name": (str, "a text")}
        for name, (kind, allowed) in kinds.items():
            if not isinstance(getattr(self, name), kind):
                raise WorldError(f"World.{name}", getattr(self, name), allowed)
        if self.occupied.shape != self.grid.shape or self.occupied.dtype != np.bool_:
            found = f"{self.occupied.shape} {self.occupied.dtype}"
            raise WorldError("World.occupied", found, f"{self.grid.shape} bool")
        if self.occupied.all():
            raise WorldError("World.occupied", self.name, "at least one free voxel")
        object.__setattr__(self, "occupied", _kept(self.occupied))
        for name in ("unknown", "unreadable"):
            self._keep_some_solid(name, getattr(self, name))
        masks = [mask for mask in (self.unknown, self.unreadable) if mask is not None]
        if len(masks) == 2 and (masks[0] & masks[1]).any():
            raise WorldError("World.unreadable", self.name, "no voxels that are unknown")
        if not is_number(self.yaw_rad) or not math.isfinite(self.yaw_rad):
            raise WorldError("World.yaw_rad", self.yaw_rad, "a finite number")
        if self.ceiling is not None:
            if not isinstance(self.ceiling, np.ndarray):
                raise WorldError("World.ceiling", self.ceiling, "a NumPy array, or None")
            if self.ceiling.shape != self.grid.shape[:2] or self.ceiling.dtype != np.int32:
                found = f"{self.ceiling.shape} {self.ceiling.dtype}"
                raise WorldError("World.ceiling", found, f"{self.grid.shape[:2]} int32")
            if self.ceiling.min() < 0 or self.ceiling.max() > self.grid.shape[2]:
                found = f"{self.ceiling.min()} … {self.ceiling.max()}"
                raise WorldError("World.ceiling", found, f"layers from 0 to {self.grid.shape[2]}")
            object.__setattr__(self, "ceiling", _kept(self.ceiling))

    def _keep_some_solid(self, name: str, given: object) -> None:
        """Check a mask of some solid voxels, if there is one, and keep a read-only copy of it."""
        if given is None:
            return
        mask = given if isinstance(given, np.ndarray) else np.zeros(0)
        if mask.shape != self.grid.shape or mask.dtype != np.bool_:
            raise WorldError(f"World.{name}", given, f"an array {self.grid.shape} bool, or None")
        if (mask & ~self.occupied).any():
            raise WorldError(f"World.{name}", self.name, "solid voxels only")
        object.__setattr__(self, name, _kept(mask))

    def __setstate__(self, kept: dict[str, object]) -> None:
        """Take the fields back; arrays that were pickled are read-only again."""
        self.__dict__.update(kept)
        for array in (self.occupied, self.ceiling, self.unknown, self.unreadable):
            if array is not None:
                array.setflags(write=False)

    def __repr__(self) -> str:
        """Return its name and voxels, not their content."""
        x, y, z = self.grid.shape
        return f"World({self.name!r}, {x} × {y} × {z} voxels of {self.grid.voxel_size_m:g} m)"

    def collision_mask(self, body_radius_m: float, ground_layer: int | None = None) -> np.ndarray:
        """Return where the centre of a spherical body cannot be, judged at voxel centres.

        Args:
            body_radius_m: Radius of the body in metres; up to half a voxel, the body fits wherever its
                voxel is free.
            ground_layer: Layer of the ground that must carry the body's circle; None = it needs none.

        Returns:
            (X, Y, Z) uint8, a Collision each. Where a body collides with several things, the first of
            ground, ceiling, boundary and edge counts.

        Raises:
            WorldError: The radius is no finite number ≥ 0.
        """
        radius = self._in_voxels(body_radius_m)
        solid = _inflated(self.occupied, radius, boundary=True)
        if self.ceiling is None and ground_layer is None:
            return solid.view(np.uint8)
        mask = solid.astype(np.uint8)
        if self.ceiling is not None:
            mask[self.no_fly_mask(body_radius_m)] = Collision.CEILING
            mask[_inflated(self.occupied, radius, boundary=False)] = Collision.GROUND
        if ground_layer is not None:
            missing = _inflated(~self.occupied[:, :, ground_layer : ground_layer + 1], radius, boundary=False)
            mask[(mask == Collision.NONE) & missing] = Collision.EDGE
        return mask

    def no_fly_mask(self, body_radius_m: float) -> np.ndarray:
        """Return (X, Y, Z) bool, where a spherical body would reach above the ceiling, solid voxels or not.

        Raises:
            WorldError: The radius is no finite number ≥ 0.
        """
        radius = self._in_voxels(body_radius_m)
        if self.ceiling is None:
            return np.zeros(self.grid.shape, bool)
        return no_fly_mask(self.ceiling, self.grid.shape[2], radius)

    def _in_voxels(self, body_radius_m: float) -> float:
        """Return a body's radius in voxel edges."""
        if not is_number(body_radius_m) or not 0 <= body_radius_m < math.inf:
            raise WorldError("body_radius_m", body_radius_m, "a finite number ≥ 0")
        return body_radius_m / self.grid.voxel_size_m

    @cached_property
    def _layouts(self) -> dict[tuple[float, int | None, int | None, int, _PlaneView | None], Layout]:
        return {}

    def layout(self, scenario: Scenario, kind: RobotKind | None = None) -> Layout:
        """Return where robots of a scenario can start and drive, and what they can observe; computed once.

        Args:
            scenario: The task.
            kind: Of the robots; None = the scenario's first.

        Raises:
            WorldError: No voxel has room for a robot.
            SettingError: It is no Scenario, or no RobotKind.
        """
        check_instance("scenario", scenario, Scenario)
        if kind is not None:
            check_instance("kind", kind, RobotKind)
        robot, sensor = (scenario.robot, scenario.sensor) if kind is None else (kind.robot, kind.sensor)
        layer, plane_view = scenario.layer_of(robot), None
        if layer is not None and not scenario.grid.flat:
            half_rad = 0.5 * (sensor.rows - 1) * sensor.angular_step_rad
            steepest_rad = half_rad if scenario.looks_level(robot) else 0.5 * math.pi
            plane_view = _PlaneView(robot.sensor_height_m, steepest_rad, sensor.max_range_m)
        ground = scenario.ground_layer_of(robot)
        key = (robot.body_radius_m, layer, ground, sensor.voxels_behind, plane_view)
        if key not in self._layouts:
            self._layouts[key] = self._compute_layout(*key)
        return self._layouts[key]

    def visible(self, scenario: Scenario) -> np.ndarray:
        """Return (X, Y, Z) bool, which voxels some robot of the team can observe at all."""
        check_instance("scenario", scenario, Scenario)
        first, *more = (self.layout(scenario, kind).visible for kind in scenario.kinds)
        return np.logical_or.reduce([first, *more]) if more else first

    def visible_voxels(self, scenario: Scenario) -> int:
        """Return how many voxels some robot of the team can observe at all."""
        check_instance("scenario", scenario, Scenario)
        if len(scenario.kinds) == 1:
            return self.layout(scenario).visible_voxels
        return int(self.visible(scenario).sum())

    def _compute_layout(
        self,
        body_radius_m: float,
        layer: int | None,
        ground_layer: int | None,
        voxels_behind: int,
        plane_view: _PlaneView | None,
    ) -> Layout:
        collision_mask = self.collision_mask(body_radius_m, ground_layer)
        fits = collision_mask == Collision.NONE
        if layer is not None:
            fits[:, :, :layer] = fits[:, :, layer + 1 :] = False
        starts = largest_component(fits)
        if not starts.any():
            expected, cures = f"room for a body with a radius of {body_radius_m} m", "--robot.body-radius-m"
            if layer is not None and not self.grid.flat:
                height_m = (layer + 0.5) * self.grid.voxel_size_m
                expected += f" at the height of the sensor, {height_m:.3g} m"
                cures += ", --robot.sensor-height-m"
            if ground_layer is not None:
                expected += ", with ground below it"
                cures += ", --robot.above-ground-m"
            raise WorldError("world", self.name, f"{expected}; see {cures} and --voxel-size-m")
        labels, _ = connected_components(~self.occupied)
        visible = np.isin(labels, np.unique(labels[starts]))
        if voxels_behind:
            within = None if self.unreadable is None else ~self.unreadable
            behind = ndimage.binary_dilation(visible, iterations=voxels_behind, mask=within)
            visible |= behind & self.occupied
        if plane_view is not None:
            visible &= self._within_view(np.any(starts, axis=2), plane_view)
        return Layout(collision_mask, np.flatnonzero(starts), visible)

    def _within_view(self, positions: np.ndarray, view: _PlaneView) -> np.ndarray:
        """Return which voxels a sensor in a plane can have in its field of view, occlusions disregarded.

        A voxel that is dz above or below the sensor is in view from |dz|/tan φ away, φ the steepest ray. It
        is visible if some position is at least so far away, and some position within range. The positions
        are connected, so then one position is both. A sensor that looks straight down sees all within range.

        Args:
            positions: (X, Y) bool, where robots can be.
            view: The sensor's.

        Returns:
            (X, Y, Z) bool.
        """
        from scipy.spatial import ConvexHull  # takes a tenth of the time to import the package

        edge_m = self.grid.voxel_size_m
        indices = np.argwhere(positions)
        corners = indices[ConvexHull(indices).vertices] if _spans_plane(indices) else indices
        x, y = np.indices(self.grid.shape[:2])
        farthest = np.zeros(self.grid.shape[:2])
        for i, j in corners:
            np.maximum(farthest, np.hypot(x - i, y - j), out=farthest)
        nearest = np.asarray(ndimage.distance_transform_edt(~positions))
        centres_m = (np.arange(self.grid.shape[2]) + 0.5) * edge_m
        rises_m = np.maximum(np.abs(centres_m - view.sensor_height_m) - 0.5 * edge_m, 0.0)
        range_ = view.max_range_m / edge_m
        if view.steepest_rad >= 0.5 * math.pi:
            return np.hypot(nearest[:, :, None], rises_m / edge_m) <= range_
        needed = rises_m / max(math.tan(view.steepest_rad), 1e-9) / edge_m
        return (farthest[:, :, None] >= needed) & (np.maximum(nearest[:, :, None], needed) <= range_)


def _kept(array: np.ndarray) -> np.ndarray:
    """Return the array itself if nothing can write through it, else a read-only copy."""
    if array.flags.writeable:
        array = array.copy()
        array.setflags(write=False)
    return array


class _PlaneView(NamedTuple):
    """The field of view of a sensor that stays in a plane.

    Attributes:
        sensor_height_m: Above the workspace's floor.
        steepest_rad: Largest angle of a ray above the horizon.
        max_range_m: Of the sensor.
    """

    sensor_height_m: float
    steepest_rad: float
    max_range_m: float


def _spans_plane(points: np.ndarray) -> bool:
    """Return whether (N, 2) points do not lie on one line."""
    return len(points) > 2 and int(np.linalg.matrix_rank(points - points[0])) == 2


@dataclass(frozen=True, eq=False)
class Layout:
    """Where one kind of robot can be in a world, and what it can observe.

    Attributes:
        collision_mask: (X, Y, Z) uint8, a Collision each: whether its body fits, or what it collides with.
        starts: (N,) flat indices of the voxels where it may start: the largest connected component of
            those in which it fits.
        visible: (X, Y, Z) bool, the voxels that can be observed from there at all: the free space that is
            connected to the starts, and the surface of the solid voxels around it; for robots in a
            plane only what can be in its field of view.
    """

    collision_mask: np.ndarray
    starts: np.ndarray
    visible: np.ndarray

    @cached_property
    def visible_voxels(self) -> int:
        """How many voxels can be observed at all."""
        return int(self.visible.sum())


def box_around(mask: np.ndarray) -> tuple[slice, ...]:
    """Return the smallest box that holds all of a mask (X, Y, Z), which is not empty."""
    found = [np.flatnonzero(mask.any(axis=tuple({0, 1, 2} - {axis}))) for axis in range(3)]
    return tuple(slice(int(along[0]), int(along[-1]) + 1) for along in found)


def part_of(world: World, box: tuple[slice, ...]) -> World:
    """Return the part of a world in a box of voxels, which stays where it was."""
    edge_m = world.grid.voxel_size_m
    x, y, z = (low + part.start * edge_m for low, part in zip(world.grid.origin_m, box, strict=True))
    occupied = world.occupied[box]
    a, b, c = occupied.shape
    ceiling = world.ceiling
    if ceiling is not None:
        ceiling = np.clip(ceiling[box[:2]] - box[2].start, 0, c)
    masks = (world.unknown, world.unreadable)
    unknown, unreadable = (None if mask is None else mask[box] for mask in masks)
    grid = Grid((a, b, c), edge_m, (x, y, z))
    return World(grid, occupied, world.name, ceiling, world.yaw_rad, unknown, unreadable)


def no_fly_mask(ceiling: np.ndarray, layers: int, body_radius: float) -> np.ndarray:
    """Return where a spherical body in a voxel's centre would reach above a ceiling.

    Args:
        ceiling: (X, Y) int32, in each column the lowest layer of the no-fly zone.
        layers: Z.
        body_radius: In voxel edges.

    Returns:
        (X, Y, Z) bool.
    """
    return _inflated(np.arange(layers) >= ceiling[:, :, None], body_radius, boundary=False)


def _inflated(mask: np.ndarray, radius: float, boundary: bool) -> np.ndarray:
    """Return a mask inflated by the radius of a spherical body.

    Args:
        mask: (X, Y, Z) bool.
        radius: In voxel edges.
        boundary: Whether all outside the grid counts as part of the mask.

    Returns:
        (X, Y, Z) bool: whether a sphere around the voxel's centre overlaps a voxel of the mask.
    """
    if radius <= 0.5 + 1e-9:
        return mask
    if 2.0 * radius > max(mask.shape):
        return np.full(mask.shape, boundary or mask.any())
    reach = math.ceil(radius - 0.5)
    gaps = np.maximum(np.abs(np.arange(-reach, reach + 1)) - 0.5, 0.0).astype(np.float32)
    outside = 0.0 if boundary else math.inf
    squared = np.where(mask, np.float32(0.0), np.float32(math.inf))  # distances to the mask, edge by edge
    for axis in range(2 if mask.shape[2] == 1 else 3):
        along = tuple(len(gaps) if each == axis else 1 for each in range(3))
        squared = ndimage.grey_erosion(
            squared, structure=-(gaps**2).reshape(along), mode="constant", cval=outside
        )
    return squared < radius**2 - 1e-9

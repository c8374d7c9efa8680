"""Fiducials of a mission: where they are, and which of them a scan sights."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from entropy_explore_env.belief.raycast import OPEN, STOP_AT_COVERED, Line, cast_range
from entropy_explore_env.compilation.kernels import inlined_kernel, lean_kernel
from entropy_explore_env.errors import WorldError
from entropy_explore_env.missions.localization import keep_in_workspace
from entropy_explore_env.randomness import Stream, generator
from entropy_explore_env.robots.localization import correct_estimate, sighting_error
from entropy_explore_env.robots.pose_covariance import in_field_of_view
from entropy_explore_env.robots.range_sensor import body_distance
from entropy_explore_env.settings.scenario import Scenario

if TYPE_CHECKING:
    from entropy_explore_env.worlds.world import World

_ON_FACE = 0.49
"""How far from a voxel's middle a drawn fiducial is, in edges: on the surface beside it, and still free."""
_NEAREST_M = 1e-6
"""A fiducial nearer than this has no direction."""


def fiducial_places(scenario: Scenario, world: World, seed: int, episode: int) -> np.ndarray:
    """Return where a mission's fiducials are, drawn or given.

    Drawn ones are on surfaces of voxels that robots can see: of a team that stays in planes, in these planes.

    Returns:
        (F, 3) float64, metres, map frame; none where no robot drifts.

    Raises:
        WorldError: One that is given is in something solid, or there are fewer surfaces than that.
    """
    settings, grid = scenario.fiducials, world.grid
    none = np.zeros((0, 3))
    if not settings.count:
        return none
    if settings.positions_m:
        places = np.array(settings.positions_m, np.float64)
        if grid.flat:
            places[:, 2] = grid.centre_of(np.zeros(3))[2]
        voxels = np.clip(grid.voxel_of(places), 0, np.asarray(grid.shape) - 1)
        inside = world.occupied[tuple(voxels.T)]
        if inside.any():
            place = settings.positions_m[int(np.argmax(inside))]
            raise WorldError(
                "Fiducials.positions_m", place, "a place in free space: it is in something solid"
            )
        return places if scenario.drifts else none
    if not scenario.drifts:
        return none
    voxels, faces = _surfaces(scenario, world)
    if len(voxels) < settings.number:
        allowed = f"at most {len(voxels)}, the free voxels beside something solid that robots can see"
        raise WorldError("Fiducials.number", settings.number, allowed)
    drawn = generator(seed, episode, Stream.FIDUCIALS).permutation(len(voxels))[: settings.number]
    return grid.centre_of(voxels[drawn]) + _ON_FACE * grid.voxel_size_m * faces[drawn]


def _surfaces(scenario: Scenario, world: World) -> tuple[np.ndarray, np.ndarray]:
    """Return (N, 3) free voxels beside solid ones, and (N, 3) directions to the first such face (C order)."""
    solid = np.pad(world.occupied, 1, constant_values=True)
    free = world.visible(scenario) & ~world.occupied
    if scenario.in_planes:
        layers = {scenario.layer_of(kind.robot) for kind in scenario.kinds}
        for layer in range(free.shape[2]):
            free[:, :, layer] &= layer in layers
    towards = np.zeros((*free.shape, 3))
    found = np.zeros(free.shape, np.bool_)
    for axis in range(2 if scenario.in_planes else 3):
        for side in (-1, 1):
            beside = np.roll(solid, -side, axis)[1:-1, 1:-1, 1:-1] & free & ~found
            towards[beside, axis] = side
            found |= beside
    voxels = np.argwhere(found)
    return voxels, towards[found]


@lean_kernel
def sight_fiducials(localization, params, index, sensor, scene, pose):
    """Correct a robot's estimate by the fiducials that it sights in a scan, by number."""
    if localization is None:  # known while compiling: nothing of the rest is compiled
        return
    estimate, own = localization.estimates[index], localization.params[index]
    for number in range(len(localization.fiducials)):
        fiducial = localization.fiducials[number]
        away = way_to(estimate.place, fiducial)
        if not in_sight(own, sensor.params[0], scene, pose, away):
            continue
        seen = measured_way(own, estimate, away)
        expected = (
            away[0] - estimate.error[0],
            away[1] - estimate.error[1],
            away[2] - estimate.error[2],
        )
        correct_estimate(estimate, seen, expected, own.range_sigma_m, own.bearing_sigma_rad)
    keep_in_workspace(estimate, params)


@inlined_kernel
def way_to(place, other):
    """Return the way (x, y, z) from one place to another."""
    return other[0] - place[0], other[1] - place[1], other[2] - place[2]


@lean_kernel
def measured_way(own, estimate, away):
    """Return (x, y, z) of a landmark truly `away`, as a robot measures it, turned by the yaw it believes."""
    error = sighting_error(away, own.range_sigma_m, own.bearing_sigma_rad, estimate.sighting_rng)
    x, y, z = away[0] + error[0], away[1] + error[1], away[2] + error[2]
    along, across = math.cos(estimate.error[3]), math.sin(estimate.error[3])
    return along * x - across * y, across * x + along * y, z


@lean_kernel
def in_sight(params, sensor, scene, pose, away):
    """Return whether a scan sights a landmark that is `away`: in range, in view, nothing before it.

    `params` are LOCALIZATION_PARAMS, `sensor` SENSOR_PARAMS of the robot.
    """
    x, y, z = away
    distance = math.sqrt(x * x + y * y + z * z)
    if distance > params.range_m or distance < max(sensor.min_range_m, _NEAREST_M):
        return False
    if not in_field_of_view(params, pose.yaw, pose.pitch, away):
        return False
    direction = x / distance, y / distance, z / distance
    line = Line(pose.start, direction, distance / scene.voxel_size_m)
    _, _, end = cast_range(scene.occupied, scene.size, line, STOP_AT_COVERED)
    return end == OPEN and body_distance(pose.start, direction, scene.bodies) >= line.length

"""Where robots start: drawn in a world's free space, or given and checked. Map frame, metres, radians."""

from __future__ import annotations

import math

import numpy as np

from entropy_explore_env.errors import SettingError, WorldError
from entropy_explore_env.settings.grid import Grid
from entropy_explore_env.settings.scenario import Scenario
from entropy_explore_env.worlds.world import Collision, World

_PLACING_ATTEMPTS = 64
"""Random places tried for a robot before all are."""
_APART = 1e-3
"""Bodies start at least this far apart, in voxel edges."""
_ROUNDING = 1e-6
"""Given poses of planar robots may be this far from their plane and from level."""


def start_poses(scenario: Scenario, world: World, rng: np.random.Generator) -> np.ndarray:
    """Draw where robots start: voxel centres with room, apart from each other, any yaw, level.

    Robots are placed one after the other, so a smaller team starts like the first of a larger one;
    where the scenario says so, near the first one.

    Args:
        rng: The stream of starts.

    Returns:
        (A, 5) float64 poses.

    Raises:
        WorldError: The bodies find no room.
    """
    grid = world.grid
    poses = np.zeros((scenario.robots, 5))
    for robot in range(scenario.robots):
        starts = world.layout(scenario, scenario.kind_of(robot)).starts
        if robot > 0 and scenario.start_radius_m < np.inf:
            centres = grid.centre_of(np.stack(np.unravel_index(starts, grid.shape), axis=-1))
            starts = starts[np.linalg.norm(centres - poses[0, :3], axis=1) <= scenario.start_radius_m]
        apart_m = _distances_apart_m(scenario, robot)
        tried = starts[rng.integers(len(starts), size=_PLACING_ATTEMPTS)] if len(starts) else starts
        place = _first_apart(grid, tried, poses[:robot, :3], apart_m)
        if place is None:
            place = _first_apart(grid, rng.permutation(starts), poses[:robot, :3], apart_m)
        if place is None:
            nearest_m = float(apart_m.min()) if robot else 0.0
            allowed = f"at most {robot}, for whose bodies, {nearest_m:.3g} m apart, the world has room"
            raise WorldError("Scenario.robots", scenario.robots, allowed)
        poses[robot, :3] = place
        poses[robot, 3] = rng.uniform(-np.pi, np.pi)
    return poses


def _distances_apart_m(scenario: Scenario, robot: int) -> np.ndarray:
    """Return the (robot,) least distances between the centre of a robot and those of the robots before it."""
    radii_m = np.array([scenario.kind_of(mate).robot.body_radius_m for mate in range(robot + 1)])
    return radii_m[robot] + radii_m[:robot] + _APART * scenario.grid.voxel_size_m


def _first_apart(grid: Grid, tried: np.ndarray, taken: np.ndarray, apart_m: np.ndarray) -> np.ndarray | None:
    """Return the (3,) centre of the first of the voxels (N,) that is (K,) apart from those taken (K, 3)."""
    centres = grid.centre_of(np.stack(np.unravel_index(tried, grid.shape), axis=-1))
    gaps = np.sqrt(((centres[:, None] - taken) ** 2).sum(axis=-1))
    clear = np.flatnonzero((gaps >= apart_m).all(axis=1))
    return centres[clear[0]] if len(clear) else None


def checked_starts(scenario: Scenario, world: World, starts: np.ndarray) -> np.ndarray:
    """Start poses that were given, if robots can be there.

    A body fits where the collision mask at its centre's voxel is free, as while driving. It need not be in
    the largest component of the free space, which the mission's threshold counts. `start_radius_m` does not
    matter.

    Args:
        starts: (A, 5) float64, finite: x, y, z, yaw, pitch.

    Returns:
        (A, 5) float64: yaws brought into [-π, π], planar robots exactly in their plane and level.

    Raises:
        SettingError: A pose is outside the workspace, in something solid or too near to another robot, looks
            up or down by more than π/2, or a planar robot is not in its plane or not level.
        WorldError: No voxel has room for a robot.
    """
    poses = starts.copy()
    beyond = np.abs(poses[:, 3]) > np.pi
    poses[beyond, 3] = (poses[beyond, 3] + np.pi) % (2.0 * np.pi) - np.pi
    for robot, pose in enumerate(poses):
        _settle_in_plane(scenario, robot, pose)
        _check_place(scenario, world, robot, pose)
        gaps_m = np.linalg.norm(poses[:robot, :3] - pose[:3], axis=1)
        apart_m = _distances_apart_m(scenario, robot)
        if (gaps_m < apart_m).any():
            mate = int(np.argmax(gaps_m < apart_m))
            allowed = f"a place at least {apart_m[mate]:.6g} m from that of robot_{mate}"
            raise SettingError(f"starts[{robot}]", starts[robot].tolist(), allowed)
    return poses


def _settle_in_plane(scenario: Scenario, robot: int, pose: np.ndarray) -> None:
    """Put a planar robot's pose (5,) exactly into its plane; refuse other heights, and steep looks."""
    height_m = scenario.plane_m(robot)
    if height_m is None:
        if abs(pose[4]) > math.pi / 2:
            raise SettingError(f"starts[{robot}]", pose.tolist(), "a pitch from -π/2 to π/2")
        return
    level = scenario.looks_level(scenario.kind_of(robot).robot)
    steepest = _ROUNDING if level else math.pi / 2
    if abs(pose[2] - height_m) > _ROUNDING or abs(pose[4]) > steepest:
        allowed = f"z = {height_m:.6g} and pitch {'= 0' if level else 'from -π/2 to π/2'}"
        raise SettingError(f"starts[{robot}]", pose.tolist(), f"{allowed}, where this planar robot stays")
    pose[2] = height_m
    if level:
        pose[4] = 0.0


def _check_place(scenario: Scenario, world: World, robot: int, pose: np.ndarray) -> None:
    """Refuse a pose (5,) outside the workspace or where the body does not fit."""
    grid, name = world.grid, f"starts[{robot}]"
    low, high = np.asarray(grid.origin_m), np.asarray(grid.origin_m) + grid.size_m
    if (pose[:3] < low).any() or (pose[:3] >= high).any():
        allowed = f"a place from {low.tolist()} to {high.tolist()} m, the workspace"
        raise SettingError(name, pose.tolist(), allowed)
    voxel = tuple(np.minimum(grid.voxel_of(pose[:3]), np.asarray(grid.shape) - 1).tolist())
    collision = Collision(int(world.layout(scenario, scenario.kind_of(robot)).collision_mask[voxel]))
    if collision is not Collision.NONE:
        hit = {
            Collision.SOLID: "hits something solid or the boundary",
            Collision.GROUND: "hits the ground",
            Collision.EDGE: "has no ground below",
        }
        what = hit.get(collision, "hits the ceiling")
        allowed = f"a place where the body fits: in voxel {voxel} it {what}"
        raise SettingError(name, pose.tolist(), allowed)

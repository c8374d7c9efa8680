"""Landmarks of robots' own maps in a mission: which a scan adds, and which it sights again."""

from __future__ import annotations

import math

import numpy as np

from entropy_explore_env.belief.fields import Belief, occupancy_probability
from entropy_explore_env.belief.measurement_model import Return
from entropy_explore_env.belief.raycast import OBSTACLE, STOP_AT_COVERED, Line, cast_range
from entropy_explore_env.belief.voxel_index import flat_index, grid_index
from entropy_explore_env.compilation.kernels import inlined_kernel, lean_kernel
from entropy_explore_env.missions.fiducials import in_sight, measured_way, way_to
from entropy_explore_env.missions.localization import keep_in_workspace
from entropy_explore_env.missions.poses import copy_numbers
from entropy_explore_env.robots.landmarks import correct_by_landmark
from entropy_explore_env.robots.pose_covariance import length

_HIT = int(Return.HIT)
_BEFORE = 0.02
"""How far before the surface that a ray hit its landmark is, in edges: not behind it from elsewhere."""
_WITHIN = 0.05
"""How far behind the end of a ray its voxel is looked up, in edges."""


@lean_kernel
def sight_landmarks(localization, params, index, sensor, scene, pose, matrices):
    """Correct a robot's estimate by the landmarks of its own map that it sights in a scan, by number.

    Args:
        matrices: (2, 4, 4) float64, scratch space; None = robots choose none.
    """
    if localization is None or matrices is None:  # known while compiling: nothing of the rest is compiled
        return
    landmarks = localization.landmarks[index]
    estimate, own = localization.estimates[index], localization.params[index]
    for number in range(len(landmarks)):
        landmark = landmarks[number]
        if not landmark.used:
            continue
        away = way_to(estimate.place, landmark.place)
        if in_sight(own, sensor.params[0], scene, pose, away):
            sigmas = own.range_sigma_m, own.bearing_sigma_rad
            correct_by_landmark(estimate, landmark, measured_way(own, estimate, away), sigmas, matrices)
    keep_in_workspace(estimate, params)


@lean_kernel
def choose_landmark(localization, params, index, scene, scan, belief, matrices):
    """Choose the best landmark among what a scan hit, if one is good enough, and keep it.

    A robot keeps the best ones that it met, a distance apart. Where all its places are taken, a better one
    replaces the worst.

    Args:
        scan: Scan, fused into the belief.
        belief: (mean, precision), (V,) float32 each, of the robot.
        matrices: As of `sight_landmarks`.
    """
    if localization is None or matrices is None:  # known while compiling: nothing of the rest is compiled
        return
    landmarks = localization.landmarks[index]
    estimate, own = localization.estimates[index], localization.params[index]
    slot = worst_landmark(landmarks)
    most = own.landmark_score
    if landmarks[slot].used:
        most = max(most, landmarks[slot].score)
    chosen, prior = -1, np.float32(params.prior_precision)
    here = estimate.scan_pose
    for number in range(len(scan.rays)):
        ray = scan.rays[number]
        if ray.returned != _HIT:
            continue
        point = (
            here[0] + ray.direction[0] * ray.range_m,
            here[1] + ray.direction[1] * ray.range_m,
            here[2] + ray.direction[2] * ray.range_m,
        )
        if not apart(landmarks, slot, point, own.landmarks_apart_m):
            continue
        voxel = voxel_behind(params, point, ray.direction)
        score = landmark_score(Belief(belief[0], belief[1], scene.size), prior, voxel)
        if score > most:
            chosen, most = number, score
    if chosen >= 0 and place_landmark(own, estimate, scene, params, scan.rays[chosen], landmarks[slot]):
        landmarks[slot].score = most


@inlined_kernel
def worst_landmark(landmarks):
    """Return the first free place, or the number of the landmark with the lowest score."""
    worst = 0
    for number in range(len(landmarks)):
        if not landmarks[number].used:
            return number
        if landmarks[number].score < landmarks[worst].score:
            worst = number
    return worst


@lean_kernel
def apart(landmarks, slot, point, apart_m):
    """Return whether a point is so far from all landmarks but the one that it would replace."""
    for number in range(len(landmarks)):
        landmark = landmarks[number]
        if number != slot and landmark.used and length(way_to(landmark.believed, point)) < apart_m:
            return False
    return True


@lean_kernel
def voxel_behind(params, point, direction):
    """Return the number of the voxel in the workspace that begins where a ray has ended.

    Args:
        point: (x, y, z) of its end, metres.
        direction: (3,) of the ray.
    """
    edge = params.voxel_size_m
    x = int((point[0] - params.origin_m[0]) / edge + _WITHIN * direction[0])
    y = int((point[1] - params.origin_m[1]) / edge + _WITHIN * direction[1])
    z = int((point[2] - params.origin_m[2]) / edge + _WITHIN * direction[2])
    size = params.size
    return flat_index(
        (size[0], size[1], size[2]),
        min(max(x, 0), size[0] - 1),
        min(max(y, 0), size[1] - 1),
        min(max(z, 0), size[2] - 1),
    )


@lean_kernel
def place_landmark(own, estimate, scene, params, ray, landmark):
    """Fill in a landmark where a ray truly hits something, and where the robot sees it.

    Args:
        own: LOCALIZATION_PARAMS of the robot.
        ray: RAY, in the direction that the robot believes.
        landmark: LANDMARK, filled in but for its score.

    Returns:
        Whether the ray hits something solid, and not the workspace's boundary.
    """
    along, across = math.cos(estimate.error[3]), -math.sin(estimate.error[3])
    x, y, z = ray.direction[0], ray.direction[1], ray.direction[2]
    direction = along * x - across * y, across * x + along * y, z
    low, edge, place = params.origin_m, params.voxel_size_m, estimate.place
    start = (place[0] - low[0]) / edge, (place[1] - low[1]) / edge, (place[2] - low[2]) / edge
    reach = float(scene.size[0] + scene.size[1] + scene.size[2])
    far, _, end = cast_range(scene.occupied, scene.size, Line(start, direction, reach), STOP_AT_COVERED)
    if end != OBSTACLE or far <= _BEFORE:
        return False
    far_m = (far - _BEFORE) * edge
    away = direction[0] * far_m, direction[1] * far_m, direction[2] * far_m
    seen = measured_way(own, estimate, away)
    for axis in range(3):
        landmark.place[axis] = place[axis] + away[axis]
        landmark.seen_from[axis] = place[axis] + estimate.error[axis]
        landmark.believed[axis] = landmark.seen_from[axis] + seen[axis]
    for row in range(4):
        copy_numbers(estimate.covariance[row], landmark.covariance[row], 4)
    landmark.sightings, landmark.used = 0, True
    return True


LARGEST = 3
"""Radius of the largest window and shell, in voxels."""
_OCCUPIED = 0.5


@lean_kernel
def landmark_score(belief, prior, voxel):
    """Return how good a landmark a voxel of a robot's own map makes, from 0 to 2 (Sujan, eq. 17).

        FEF = f1(P(x)) + f3(H(x)),   f1 ~ P(x) / r,   f3 ~ H(x) · w

    P is how certainly the voxel is occupied, r the radius up to which the certainty around it descends, H the
    depth contrast and w the window up to which that does not fall. The paper leaves both open ("may be
    approximated with some heuristics"); f2, the visual contrast, needs images. Ours:

    - Certainty of a voxel is |2 P_occ - 1|, 0 where it was never measured. Shells are the surfaces of cubes;
      r is the number of the last shell whose mean certainty is below that of the one before.
    - H is how far the share of free voxels in a window is from ½, twice: near 0 at a flat wall, ½ at a
      right-angled corner, near 1 at a post; what is unknown is not free. w counts from 1 to `LARGEST`, and
      is divided by it.

    Args:
        prior: Precision of a voxel that was never measured, float32.
    """
    x, y, z = grid_index(belief.size, voxel)
    if belief.precision[voxel] <= prior:
        return 0.0
    occupied = occupancy_probability(float(belief.mean[voxel]), float(belief.precision[voxel]))
    if occupied <= _OCCUPIED:
        return 0.0
    certainty, radius, descends = 2.0 * occupied - 1.0, 1, True
    free, voxels, contrast, window, grows = 0, 1, 0.0, 0, True
    for shell in range(1, LARGEST + 1):
        total, count = 0.0, 0
        for i in range(max(x - shell, 0), min(x + shell, belief.size[0] - 1) + 1):
            for j in range(max(y - shell, 0), min(y + shell, belief.size[1] - 1) + 1):
                for k in range(max(z - shell, 0), min(z + shell, belief.size[2] - 1) + 1):
                    if max(abs(i - x), abs(j - y), abs(k - z)) != shell:
                        continue
                    near = flat_index(belief.size, i, j, k)
                    count += 1
                    voxels += 1
                    if belief.precision[near] <= prior:
                        continue
                    p = occupancy_probability(float(belief.mean[near]), float(belief.precision[near]))
                    total += abs(2.0 * p - 1.0)
                    free += int(p < _OCCUPIED)
        mean = total / count if count > 0 else 0.0
        if descends and count > 0 and mean < certainty:
            radius, certainty = shell, mean
        else:
            descends = False
        here = abs(2.0 * free / voxels - 1.0) if free > 0 else 0.0
        if grows and here >= contrast:
            contrast, window = here, shell
        else:
            grows = False
    return occupied / radius + contrast * window / LARGEST

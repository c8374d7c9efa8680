"""What is expected to be seen of a height field from above: V of Sawhney 2009 in 3-D (sects. 3.3-3.4).

Points are the columns of a TerrainMap. Unexplored ground is assumed to slope down from the mean height z_av
of the ground around the place: z = (1 - dist / range) z_av above the workspace's floor. A column is seen if a
ray from the place meets its top: along every direction the steepest slope to the columns passed is the
horizon. Grid units: heights are in layers.

In all functions `terrain` is the TerrainMap, `model` a ViewModel, `eye` a place (x, y, z) and `average` z_av
there; `counter` and `marking` are as in `visibility`.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from entropy_explore_env.belief.voxel_index import grid_index
from entropy_explore_env.compilation.kernels import inlined_kernel, lean_kernel
from entropy_explore_env.frontiers.blocks import NONE
from entropy_explore_env.frontiers.visibility import count_point, start_count
from entropy_explore_env.frontiers.voxel_states import UNEXPLORED


class ViewModel(NamedTuple):
    """How columns are seen from candidates; lengths in columns and layers."""

    reach: float
    """Of the sensor, > 0."""
    min_tangent: float
    """Tangent of the smallest angle below the horizon at which the sensor sees."""
    patch: int
    """Half the width of the patch whose mean ground is z_av."""
    gamma: float
    """γ of the height factor; negative = no height factor."""
    unit: float
    """Metres a layer, in the height factor."""
    highest: float
    """The greatest z_f - z_av of a candidate."""


@lean_kernel
def mean_ground(terrain, x, y, patch):
    """Return z_av: mean ground of the mapped columns within `patch` of one along both axes; 0 = none."""
    total, count = 0.0, 0
    for i in range(max(x - patch, 0), min(x + patch, terrain.size[0] - 1) + 1):
        for j in range(max(y - patch, 0), min(y + patch, terrain.size[1] - 1) + 1):
            if terrain.ground[i, j] != NONE:
                total += terrain.ground[i, j]
                count += 1
    return total / count if count > 0 else 0.0


@inlined_kernel
def height_at(terrain, x, y, eye, average, reach):
    """Return the height of a column: its ground if mapped, else extrapolated (sect. 3.4), 0 out of reach."""
    if terrain.ground[x, y] != NONE:
        return np.float64(terrain.ground[x, y])
    dx, dy = x + 0.5 - eye[0], y + 0.5 - eye[1]
    return max((1.0 - math.sqrt(dx * dx + dy * dy) / reach) * average, 0.0)


@lean_kernel
def count_below(counter, terrain, eye, average, azimuths, model, marking):
    """Count the unexplored columns that are seen from a place along (D, 2) float64 unit vectors.

    No column is seen from outside the map.
    """
    number, points, weighed = start_count(counter), 0, 0.0
    size, reach = terrain.size, model.reach
    if not (0.0 <= eye[0] < size[0] and 0.0 <= eye[1] < size[1]):
        return points, weighed
    for direction in azimuths:
        x, y = int(eye[0]), int(eye[1])
        step_x, step_y = 1 if direction[0] > 0.0 else -1, 1 if direction[1] > 0.0 else -1
        gap_x = 1.0 / abs(direction[0]) if direction[0] != 0.0 else math.inf
        gap_y = 1.0 / abs(direction[1]) if direction[1] != 0.0 else math.inf
        face_x = (x + 1 - eye[0] if step_x > 0 else eye[0] - x) * gap_x if gap_x < math.inf else math.inf
        face_y = (y + 1 - eye[1] if step_y > 0 else eye[1] - y) * gap_y if gap_y < math.inf else math.inf
        enters, horizon = 0.0, -math.inf
        while enters <= reach:
            leaves = min(face_x, face_y)
            drop = eye[2] - height_at(terrain, x, y, eye, average, reach)
            if drop <= 0.0:
                break  # it hides the tops of all lower columns behind it
            slope = -drop / leaves
            column = x * size[1] + y
            near = enters * enters + drop * drop <= reach * reach
            if slope > horizon and near and drop >= model.min_tangent * enters:
                if terrain.columns.state[column] & UNEXPLORED and counter.stamp[column] != number:
                    counter.stamp[column] = number
                    points += 1
                    weighed += count_point(counter, column, marking)
            horizon = max(horizon, slope)
            enters = leaves
            if face_x <= face_y:
                x, face_x = x + step_x, face_x + gap_x
            else:
                y, face_y = y + step_y, face_y + gap_y
            if not (0 <= x < size[0] and 0 <= y < size[1]):
                break
    return points, weighed


@lean_kernel
def count_columns_in_ball(counter, terrain, eye, average, model, marking):
    """Count the naive V: unexplored columns whose tops, extrapolated, lie in a ball, seen or not."""
    points, weighed, size, reach = 0, 0.0, terrain.size, model.reach
    for x in range(max(int(eye[0] - reach - 0.5), 0), min(int(eye[0] + reach + 1.0), size[0])):
        for y in range(max(int(eye[1] - reach - 0.5), 0), min(int(eye[1] + reach + 1.0), size[1])):
            column = x * size[1] + y
            dx, dy = x + 0.5 - eye[0], y + 0.5 - eye[1]
            dz = eye[2] - height_at(terrain, x, y, eye, average, reach)
            near = dx * dx + dy * dy + dz * dz <= reach * reach
            if near and terrain.columns.state[column] & UNEXPLORED:
                points += 1
                weighed += count_point(counter, column, marking)
    return points, weighed


@lean_kernel
def count_columns_from(counter, terrain, voxels, azimuths, model, seen, weighed):
    """Count the columns seen from (K,) int32 voxels into (K,) numbers and weights; see `count_below`."""
    for place in range(len(voxels)):
        x, y, z = grid_index(terrain.size, voxels[place])
        eye, average = (x + 0.5, y + 0.5, z + 0.5), mean_ground(terrain, x, y, model.patch)
        found = count_below(counter, terrain, eye, average, azimuths, model, False)
        seen[place], weighed[place] = found


@lean_kernel
def fill_height_factors(terrain, voxels, model, factors):
    """Fill in (z_f - z_av)^γ z_f^(1 - γ) of (K,) voxels, metres above the workspace's floor (sect. 3.3).

    It is 0 for places so high above the ground that little of it can be seen, which are no candidates.
    """
    gamma = model.gamma
    for place in range(len(voxels)):
        x, y, z = grid_index(terrain.size, voxels[place])
        height = z + 0.5
        above = height - mean_ground(terrain, x, y, model.patch)
        factor = 1.0 if gamma < 0.0 else max(above, 1e-3) ** gamma * height ** (1.0 - gamma) * model.unit
        factors[place] = 0.0 if above > model.highest else factor

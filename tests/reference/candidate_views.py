"""What a scan from a viewpoint should see, ray by ray and voxel by voxel: slow, and without kernels."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from typing import NamedTuple

import numpy as np

from entropy_explore_env.settings.sensor import RangeSensor, centred_angles
from tests.reference import rocha04

Voxel = tuple[int, int, int]
SEEN_BITS = 0.1
KNOWN_RATIO = 2.0
FACES = ((-1, 0, 0), (1, 0, 0), (0, -1, 0), (0, 1, 0), (0, 0, -1), (0, 0, 1))


class Map(NamedTuple):
    """What a robot believes, and how its scans are imagined."""

    mean: np.ndarray
    """(X, Y, Z)."""
    precision: np.ndarray
    prior: float
    """1/σ² of a voxel that was never measured."""
    edge_m: float
    stop: float
    """Probability that an unknown voxel stops a ray; beside a covered one the same."""

    def is_unknown(self, voxel: Voxel) -> bool:
        """Whether it is in the map, uncovered and unknown."""
        inside = all(0 <= i < n for i, n in zip(voxel, self.mean.shape, strict=True))
        return inside and self.mean[voxel] <= 0.5 and self.precision[voxel] < KNOWN_RATIO * self.prior


def added_precision(believed: Map, sensor: RangeSensor, viewpoint: np.ndarray) -> dict[Voxel, float]:
    """What all rays of the sensor should add to the precision of each voxel that they cross."""
    added: dict[Voxel, float] = {}
    start, size = tuple(viewpoint[:3].tolist()), believed.mean.shape
    longest = sensor.max_range_m / believed.edge_m
    for yaw in centred_angles(sensor.columns, sensor.angular_step_rad):
        for pitch in centred_angles(sensor.rows, sensor.angular_step_rad):
            direction = rocha04.gaze(viewpoint[3] + yaw, viewpoint[4] + pitch)
            ray = rocha04.trace(
                lambda v: believed.mean[v] > 0.5, start, direction, size, longest, sensor.voxels_behind
            )
            range_m = ray.length * believed.edge_m
            if ray.end != rocha04.OPEN and range_m < sensor.min_range_m:
                continue
            gain = rocha04.measured_sigma(range_m, sensor.sigma_min, sensor.sigma_slope_per_m) ** -2
            share = 1.0
            for number, voxel in enumerate(ray.voxels):
                added[voxel] = added.get(voxel, 0.0) + gain * share
                if believed.precision[voxel] < KNOWN_RATIO * believed.prior:
                    share *= 1.0 - believed.stop
                elif number > 0:
                    share *= 1.0 - min(2.0 * float(believed.mean[voxel]), 1.0)
                if share < 1e-3:
                    break
    return added


class View(NamedTuple):
    """What is expected of a scan."""

    bits: float
    """But for what lies in announced views."""
    all_bits: float
    again_bits: float
    """Of a second scan, but for what lies in announced views."""
    shared_bits: list[float]
    """In each announced view."""
    seen: set[Voxel]
    margin: float
    """How near, in bits, a voxel comes to counting as seen or not."""


def view_from(
    believed: Map, sensor: RangeSensor, viewpoint: np.ndarray, cones: Iterable[Mapping[str, np.ndarray]]
) -> View:
    """What a scan from a viewpoint should bring, and which voxels it should see."""
    cones = list(cones)
    bits, all_bits, again, shared, seen, margin = 0.0, 0.0, 0.0, [0.0] * len(cones), set(), math.inf
    for voxel, gain in added_precision(believed, sensor, viewpoint).items():
        precision = float(believed.precision[voxel])
        gained = 0.5 * math.log2(1.0 + gain / precision)
        inside = [_in_cone(cone, voxel) for cone in cones]
        shared = [s + gained * i for s, i in zip(shared, inside, strict=True)]
        all_bits += gained
        if not any(inside):
            bits += gained
            again += 0.5 * math.log2(1.0 + gain / (precision + gain))
        if gained >= SEEN_BITS:
            seen.add(voxel)
        margin = min(margin, abs(gained - SEEN_BITS))
    return View(bits, all_bits, again, shared, seen, margin)


def _in_cone(cone: Mapping[str, np.ndarray], voxel: Voxel) -> bool:
    away = np.array(voxel) + 0.5 - cone["apex"]
    length = float(np.linalg.norm(away))
    return (
        length <= float(cone["radius"])
        and float(away @ cone["gaze"]) >= length * float(cone["cosine"]) - 1e-9
    )


def slivers(believed: Map, seen: set[Voxel]) -> int:
    """Faces of unknown voxels seen to unknown ones that are left, behind which nothing unknown is left."""
    count = 0
    for voxel in seen:
        if not believed.is_unknown(voxel):
            continue
        for step in FACES:
            beside = tuple(int(n) for n in np.add(voxel, step))
            behind = tuple(int(n) for n in np.add(beside, step))
            left = believed.is_unknown(beside) and beside not in seen
            count += left and not (believed.is_unknown(behind) and behind not in seen)
    return count


def remaining_blocks(believed: Map, end_precision: float, edge: int) -> dict[Voxel, float]:
    """Remaining bits of the uncovered voxels of each block that has any."""
    blocks: dict[Voxel, float] = {}
    for voxel in np.ndindex(*believed.mean.shape):
        left = 0.5 * math.log2(end_precision / float(believed.precision[voxel]))
        if left > 0.0 and believed.mean[voxel] <= 0.5:
            block = (voxel[0] // edge, voxel[1] // edge, voxel[2] // edge)
            blocks[block] = blocks.get(block, 0.0) + left
    return blocks

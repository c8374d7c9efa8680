"""The belief of Bhattacharya 2010, sect. 5.3: occupancy probabilities of cells, and the broadcast in phases.

A sensor at distance r from a cell is right with probability s(r) = s_n + (r/R)² (s_f - s_n); a reading z of
a cell says u = z s + (1 - z)(1 - s); readings are fused by their mean, p = Σ u / Σ 1. Entropies are in nats,
e = -p ln p - (1 - p) ln(1 - p) (eq. 9 with the sign that it lacks), and pass a 3 × 3 minimum filter. This
belief serves the reproduction alone: the library's is a Gaussian a voxel.
"""

from __future__ import annotations

import math

import numpy as np
from scipy import ndimage
from scipy.special import entr

from entropy_explore_env.belief.entropy import LN2
from entropy_explore_env.belief.raycast import (
    OBSTACLE,
    ONE_BEHIND,
    OPEN_END,
    Crossing,
    Line,
    cast_ray,
    longest_crossing,
    point,
)
from entropy_explore_env.compilation.kernels import lean_kernel

NEAR, FAR = 0.99, 0.9
"""s_n and s_f: the sensor's confidence right beside the robot, and at the end R of its range."""
_RAYS_A_CELL = 1.5
"""Rays at the end of the range, for each cell of its circle."""

Scan = tuple[np.ndarray, np.ndarray]
"""(N,) cells, each once, and (N,) float32 what was read of them, u."""


class Readings:
    """A robot's buffer: what it read of cells since the buffer was cleared.

    Attributes:
        total: (V,) float32, Σ u of each cell.
        times: (V,) int32, Σ 1.
    """

    def __init__(self, cells: int) -> None:
        """Make room for a map of this many cells."""
        self.total, self.times = np.zeros(cells, np.float32), np.zeros(cells, np.int32)

    def clear(self) -> None:
        """Clear the buffer."""
        self.total[:], self.times[:] = 0.0, 0

    def add(self, scan: Scan) -> None:
        """Add a scan."""
        cells, read = scan
        self.total[cells] += read
        self.times[cells] += 1


class GridBelief:
    """A robot's belief of the cells of a plan; arrays by number of the cell, C order.

    Attributes:
        probability: (V,) float32, p, that a cell is occupied; ½ at first.
        entropy: (X, Y, 1) float32 nats, after the minimum filter.
        version: Counts the fusions.
    """

    def __init__(self, shape: tuple[int, int, int]) -> None:
        """Begin with nothing known of X × Y × 1 cells."""
        cells = math.prod(shape)
        self.shape, self.version = shape, 0
        self.probability = np.full(cells, 0.5, np.float32)
        self.entropy = np.full(shape, LN2, np.float32)
        self._raw, self._readings = np.full(cells, LN2, np.float32), Readings(cells)

    @property
    def occupied(self) -> np.ndarray:
        """(X, Y, 1) bool, believed occupied: p > ½."""
        return (self.probability > 0.5).reshape(self.shape)

    def fuse(self, cells: np.ndarray, total: np.ndarray, times: np.ndarray | int) -> None:
        """Fuse readings, and filter the entropies again where they may have changed.

        Args:
            cells: (N,) numbers of cells, each once.
            total: (N,) float32, Σ u of each.
            times: (N,) int32, Σ 1.
        """
        if len(cells) == 0:
            return
        kept = self._readings
        kept.total[cells] += total
        kept.times[cells] += times
        p = kept.total[cells].astype(np.float64) / kept.times[cells]
        self.probability[cells] = p
        self._raw[cells] = entr(p) + entr(1.0 - p)
        self._filter(*np.divmod(cells, self.shape[1]))
        self.version += 1

    def _filter(self, x: np.ndarray, y: np.ndarray) -> None:
        """Fill in the least of 3 × 3 cells, in the box around these cells and one cell around it."""
        inner = [slice(max(at.min() - 1, 0), at.max() + 2) for at in (x, y)]
        outer = [slice(max(each.start - 1, 0), each.stop + 1) for each in inner]
        least = ndimage.minimum_filter(self._raw.reshape(self.shape[:2])[tuple(outer)], 3, mode="nearest")
        taken = tuple(
            slice(one.start - other.start, one.stop - other.start)
            for one, other in zip(inner, outer, strict=True)
        )
        self.entropy[(*inner, 0)] = least[taken]

    def fuse_readings(self, readings: Readings) -> None:
        """Fuse a teammate's buffer."""
        cells = np.flatnonzero(readings.times)
        self.fuse(cells, readings.total[cells], readings.times[cells])

    def fuse_scan(self, scan: Scan) -> None:
        """Fuse a scan."""
        self.fuse(*scan, 1)


class Scanner:
    """Reads the cells of a true plan that can be seen from a cell, each once; no noise."""

    def __init__(self, occupied: np.ndarray, range_cells: float) -> None:
        """Look at a plan (X, Y, 1) bool, up to a range R in cells."""
        self._shape, self._range = occupied.shape, float(range_cells)
        self._truth = occupied.astype(np.float32).reshape(-1)
        rays = math.ceil(2.0 * math.pi * range_cells * _RAYS_A_CELL)
        angles = np.arange(rays) * (2.0 * math.pi / rays)
        self._rays = np.stack([np.cos(angles), np.sin(angles), np.zeros(rays)], axis=1)
        places = longest_crossing(*occupied.shape, range_cells, 1)
        self._crossing = Crossing(np.empty(places, np.int32), np.empty(places, np.int64))

    def scan(self, cell: int) -> Scan:
        """Return what is seen from the centre of a cell."""
        read = np.zeros(self._truth.size, np.float32)
        _scan(self._truth, self._shape, cell, self._rays, self._range, self._crossing, read)
        cells = np.flatnonzero(read)
        return cells, read[cells]


@lean_kernel
def _scan(
    truth: np.ndarray,
    shape: tuple[int, int, int],
    cell: int,
    rays: np.ndarray,
    reach: float,
    crossing: Crossing,
    read: np.ndarray,
) -> None:
    """Cast the rays; fill in (V,) float32, u of each cell that is seen, where it is 0."""
    at_x, at_y = cell // shape[1], cell % shape[1]
    start = (at_x + 0.5, at_y + 0.5, 0.5)
    for ray in range(len(rays)):
        line = Line(start, point(rays[ray]), reach)
        _, n, end = cast_ray(truth, shape, line, 0.5, OPEN_END, ONE_BEHIND, crossing)
        for i in range(n):
            there = np.int64(crossing.voxels[i])
            away = (there // shape[1] - at_x) ** 2 + (there % shape[1] - at_y) ** 2
            if read[there] == 0.0 and away <= reach * reach:
                confidence = NEAR + away / (reach * reach) * (FAR - NEAR)
                hit = end == OBSTACLE and i == n - 1
                read[there] = confidence if hit else 1.0 - confidence

"""The belief of Bhattacharya 2010, sect. 5.3: occupancy probabilities of cells, and the broadcast in phases.

A sensor at distance r from a cell is right with probability s(r) = s_n + (r/R)² (s_f - s_n); a reading z of
a cell says u = z s + (1 - z)(1 - s); readings are fused by their mean, p = Σ u / Σ 1. Entropies are in nats,
e = -p ln p - (1 - p) ln(1 - p) (eq. 9 with the sign that it lacks), and pass a 3 × 3 minimum filter. This
belief serves the reproduction alone: the library's is a Gaussian a voxel.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

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
"""(N,) int32 cells, each once, and (N,) float32 what was read of them, u."""


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
        self._window = np.zeros(4, np.int64)

    @property
    def occupied(self) -> np.ndarray:
        """(X, Y, 1) bool, believed occupied: p > ½."""
        return (self.probability > 0.5).reshape(self.shape)

    def fuse(self, cells: np.ndarray, total: np.ndarray, times: np.ndarray) -> None:
        """Fuse readings, and filter the entropies again where they may have changed.

        Args:
            cells: (N,) int32, each once.
            total: (N,) float32, Σ u of each.
            times: (N,) int32, Σ 1.
        """
        if len(cells) == 0:
            return
        kept = self._readings.total, self._readings.times
        _fuse(self.probability, self._raw, kept, (cells, total, times))
        x, y = cells // self.shape[1], cells % self.shape[1]
        self._window[:] = x.min(), x.max() + 1, y.min(), y.max() + 1
        _filter(self._raw.reshape(self.shape), self.entropy, self._window)
        self.version += 1

    def fuse_readings(self, readings: Readings) -> None:
        """Fuse a teammate's buffer."""
        cells = np.flatnonzero(readings.times).astype(np.int32)
        self.fuse(cells, readings.total[cells], readings.times[cells])

    def fuse_scan(self, scan: Scan) -> None:
        """Fuse a scan."""
        self.fuse(*scan, np.ones(len(scan[0]), np.int32))


@lean_kernel
def _fuse(
    probability: np.ndarray,
    raw: np.ndarray,
    kept: tuple[np.ndarray, np.ndarray],
    readings: tuple[np.ndarray, np.ndarray, np.ndarray],
) -> None:
    """Fuse readings into the probabilities and entropies of their cells."""
    (total, times), (cells, more, more_times) = kept, readings
    for i in range(len(cells)):
        cell = np.int64(cells[i])
        total[cell] += more[i]
        times[cell] += more_times[i]
        p = np.float64(total[cell]) / times[cell]
        probability[cell] = p
        raw[cell] = -p * math.log(p) - (1.0 - p) * math.log(1.0 - p)


@lean_kernel
def _filter(raw: np.ndarray, entropy: np.ndarray, window: np.ndarray) -> None:
    """Fill in the least of 3 × 3 cells, in the window and one cell around it."""
    size_x, size_y = raw.shape[0], raw.shape[1]
    for x in range(max(window[0] - 1, 0), min(window[1] + 1, size_x)):
        for y in range(max(window[2] - 1, 0), min(window[3] + 1, size_y)):
            least = raw[x, y, 0]
            for i in range(max(x - 1, 0), min(x + 2, size_x)):
                for j in range(max(y - 1, 0), min(y + 2, size_y)):
                    least = min(least, raw[i, j, 0])
            entropy[x, y, 0] = least


class ScanScratch(NamedTuple):
    """Arrays that a scan works in."""

    crossed: np.ndarray
    """(L,) int32, cells of a ray."""
    entered: np.ndarray
    """(L,) int64, how each was entered."""
    seen: np.ndarray
    """(V,) int64, number of the last scan that read a cell."""
    cells: np.ndarray
    """(V,) int32, cells that were read."""
    read: np.ndarray
    """(V,) float32, u of each."""


class Scanner:
    """Reads the cells of a true plan that can be seen from a cell, each once; no noise."""

    def __init__(self, occupied: np.ndarray, range_cells: float) -> None:
        """Look at a plan (X, Y, 1) bool, up to a range R in cells."""
        self._shape = occupied.shape
        self._truth = occupied.astype(np.float32).reshape(-1)
        rays = math.ceil(2.0 * math.pi * range_cells * _RAYS_A_CELL)
        angles = np.arange(rays) * (2.0 * math.pi / rays)
        self._rays = np.stack([np.cos(angles), np.sin(angles), np.zeros(rays)], axis=1)
        x, y, z = occupied.shape
        places = longest_crossing(x, y, z, range_cells, 1)
        self._range, self._scans = float(range_cells), 0
        self._scratch = ScanScratch(
            np.empty(places, np.int32),
            np.empty(places, np.int64),
            np.zeros(occupied.size, np.int64),
            np.empty(occupied.size, np.int32),
            np.empty(occupied.size, np.float32),
        )

    def scan(self, cell: int) -> Scan:
        """Return what is seen from the centre of a cell."""
        self._scans += 1
        count = _scan(self._truth, self._shape, cell, self._rays, self._range, self._scratch, self._scans)
        return self._scratch.cells[:count].copy(), self._scratch.read[:count].copy()


@lean_kernel
def _scan(
    truth: np.ndarray,
    shape: tuple[int, int, int],
    cell: int,
    rays: np.ndarray,
    reach: float,
    scratch: ScanScratch,
    number: int,
) -> int:
    """Cast the rays; returns how many cells were read."""
    crossed, entered, seen, cells, read = scratch
    at_x, at_y, count = cell // shape[1], cell % shape[1], 0
    start = (at_x + 0.5, at_y + 0.5, 0.5)
    for ray in range(len(rays)):
        _, n, end = cast_ray(
            truth,
            shape,
            Line(start, point(rays[ray]), reach),
            0.5,
            OPEN_END,
            ONE_BEHIND,
            Crossing(crossed, entered),
        )
        for i in range(n):
            there = np.int64(crossed[i])
            if seen[there] == number:
                continue
            seen[there] = number
            away = (there // shape[1] - at_x) ** 2 + (there % shape[1] - at_y) ** 2
            if away <= reach * reach:
                confidence = NEAR + away / (reach * reach) * (FAR - NEAR)
                hit = end == OBSTACLE and i == n - 1
                cells[count] = there
                read[count] = confidence if hit else 1.0 - confidence
                count += 1
    return count

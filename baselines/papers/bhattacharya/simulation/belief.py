"""The belief of Bhattacharya 2010, sect. 5.3: occupancy probabilities of cells, and the broadcast in phases.

A sensor at distance r from a cell is right with probability s(r) = s_n + (r/R)² (s_f - s_n); a reading z of
a cell says u = z s + (1 - z)(1 - s); readings are fused by a generalised mean, p = g⁻¹(Σ g(u) / Σ 1), g(x) =
xᵐ. Entropies are in nats, e = -p ln p - (1 - p) ln(1 - p) (eq. 9 with the sign that it lacks), and pass a 3
× 3 minimum filter. This belief serves the reproduction alone: the library's is a Gaussian a voxel.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
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
from entropy_explore_env.settings.validation import check, check_kind

BITS_PER_CELL = 64
"""A cell in a message: its number, and what was read of it, 32 bits each."""
BITS_PER_MESSAGE = 160
"""Sender, time stamp and the window."""

_RAYS_A_CELL = 1.5
"""Rays at the end of the range, for each cell of its circle."""


@dataclass(frozen=True)
class Sensor:
    """A scanner that looks all around; distances in cells.

    Attributes:
        range_cells: R, where it ends.
        near: s_n, its confidence right beside the robot.
        far: s_f, at R; ≤ s_n, > ½, so that what it reads free is believed free.
    """

    range_cells: float = 60.0
    near: float = 0.99
    far: float = 0.9

    def __post_init__(self) -> None:
        """Check every field."""
        check(self, "range_cells", "a number from 1.5 to 1e4", lambda v: 1.5 <= v <= 1e4)
        check(self, "far", "a number above 0.5 and below 1", lambda v: 0.5 < v < 1.0)
        check(self, "near", "a number from `far` to below 1", lambda v: self.far <= v < 1.0)

    def confidence(self, distance_cells: float) -> float:
        """s(r): the probability that a cell at this distance is read right; 0 beyond the range."""
        if distance_cells > self.range_cells:
            return 0.0
        return self.near + (distance_cells / self.range_cells) ** 2 * (self.far - self.near)


@dataclass(frozen=True)
class Fusion:
    """How readings of a cell become one probability.

    Attributes:
        exponent: m of g(x) = xᵐ; 0 = g is the logarithm (the geometric mean). The larger it is, the more the
            highest probability ever read counts; single precision holds u⁸.
        most_confident: Keep the reading farthest from ½ instead of a mean.
    """

    exponent: float = 1.0
    most_confident: bool = False

    def __post_init__(self) -> None:
        """Check every field."""
        check(self, "exponent", "a number from 0 to 8", lambda v: 0.0 <= v <= 8.0)
        check_kind(self, "most_confident", bool)


class Readings:
    """A robot's buffer: what it read of cells since the buffer was cleared."""

    def __init__(self, cells: int) -> None:
        """Room for a map of this many cells."""
        self.total, self.times = np.zeros(cells, np.float32), np.zeros(cells, np.int32)
        self.changed, self._count = np.empty(cells, np.int32), np.zeros(1, np.int64)

    @property
    def count(self) -> int:
        """Cells that were read."""
        return int(self._count[0])

    @property
    def cells(self) -> np.ndarray:
        """(N,) int32, those cells."""
        return self.changed[: self.count]

    def clear(self) -> None:
        """Clear the buffer."""
        self.total[self.cells], self.times[self.cells] = 0.0, 0
        self._count[0] = 0

    def add(self, scan: tuple[np.ndarray, np.ndarray], fusion: Fusion) -> None:
        """Add a scan: (N,) cells, each once, and (N,) float32 what was read, u."""
        cells, read = scan
        _add_readings(
            self.total,
            self.times,
            self.changed,
            self._count,
            cells,
            read,
            fusion.exponent,
            fusion.most_confident,
        )


class GridBelief:
    """A robot's belief of the cells of a plan; arrays by number of the cell, C order.

    Attributes:
        probability: (V,) float32, p, that a cell is occupied; ½ at first.
        entropy: (X, Y, 1) float32 nats, after the minimum filter.
    """

    def __init__(self, shape: tuple[int, int, int], fusion: Fusion) -> None:
        """Nothing is known of X × Y × 1 cells."""
        cells = math.prod(shape)
        self.shape, self.fusion = shape, fusion
        self.probability = np.full(cells, 0.5, np.float32)
        self.entropy = np.full(shape, LN2, np.float32)
        self._raw = np.full(cells, LN2, np.float32)
        self._total, self._times = np.zeros(cells, np.float32), np.zeros(cells, np.int32)
        self._window = np.zeros(4, np.int64)
        self.version = 0
        """Counts the fusions."""

    @property
    def occupied(self) -> np.ndarray:
        """(X, Y, 1) bool, believed occupied: p > ½."""
        return (self.probability > 0.5).reshape(self.shape)

    def fuse(self, cells: np.ndarray, total: np.ndarray, times: np.ndarray) -> None:
        """Fuse readings, and filter the entropies again where they may have changed.

        Args:
            cells: (N,) int32, each once.
            total: (N,) float32, Σ g(u) of each; where the most confident reading is kept, its u.
            times: (N,) int32, Σ 1.
        """
        if len(cells) == 0:
            return
        _fuse(
            self.probability,
            self._raw,
            (self._total, self._times),
            self.shape,
            (cells, total, times),
            self.fusion.exponent,
            self.fusion.most_confident,
            self._window,
        )
        _filter(self._raw.reshape(self.shape), self.entropy, self._window)
        self.version += 1

    def fuse_readings(self, readings: Readings) -> None:
        """Fuse a teammate's buffer."""
        cells = readings.cells
        self.fuse(cells, readings.total[cells], readings.times[cells])

    def fuse_scan(self, scan: tuple[np.ndarray, np.ndarray]) -> None:
        """Fuse a scan: (N,) cells, each once, and (N,) float32 what was read, u."""
        cells, read = scan
        total = np.empty_like(read)
        _transform(read, total, self.fusion.exponent, self.fusion.most_confident)
        self.fuse(cells, total, np.ones(len(cells), np.int32))


@lean_kernel
def _g(read: float, exponent: float) -> float:
    """g(u)."""
    return math.log(read) if exponent == 0.0 else read**exponent


@lean_kernel
def _transform(read: np.ndarray, total: np.ndarray, exponent: float, most_confident: bool) -> None:
    for i in range(len(read)):
        total[i] = read[i] if most_confident else _g(np.float64(read[i]), exponent)


@lean_kernel
def _add_readings(
    total: np.ndarray,
    times: np.ndarray,
    changed: np.ndarray,
    count: np.ndarray,
    cells: np.ndarray,
    read: np.ndarray,
    exponent: float,
    most_confident: bool,
) -> None:
    for i in range(len(cells)):
        cell = cells[i]
        if times[cell] == 0:
            changed[count[0]] = cell
            count[0] += 1
        if not most_confident:
            total[cell] += np.float32(_g(np.float64(read[i]), exponent))
        elif times[cell] == 0 or abs(read[i] - 0.5) > abs(total[cell] - 0.5):
            total[cell] = read[i]
        times[cell] += 1


@lean_kernel
def _fuse(
    probability: np.ndarray,
    raw: np.ndarray,
    kept: tuple[np.ndarray, np.ndarray],
    shape: tuple[int, int, int],
    readings: tuple[np.ndarray, np.ndarray, np.ndarray],
    exponent: float,
    most_confident: bool,
    window: np.ndarray,
) -> None:
    """Fuse readings; fill the window (4,) of what changed: x from, to, y from, to."""
    (total, times), (cells, more, more_times), width = kept, readings, shape[1]
    window[0], window[1], window[2], window[3] = shape[0], 0, shape[1], 0
    for i in range(len(cells)):
        cell = np.int64(cells[i])
        if not most_confident:
            total[cell] += more[i]
        elif times[cell] == 0 or abs(more[i] - 0.5) > abs(total[cell] - 0.5):
            total[cell] = more[i]
        times[cell] += more_times[i]
        p = np.float64(total[cell])
        if not most_confident:
            p /= times[cell]
            p = math.exp(p) if exponent == 0.0 else p ** (1.0 / exponent)
        probability[cell] = p
        raw[cell] = -p * math.log(p) - (1.0 - p) * math.log(1.0 - p)
        x, y = cell // width, cell % width
        window[0], window[1] = min(window[0], x), max(window[1], x + 1)
        window[2], window[3] = min(window[2], y), max(window[3], y + 1)


@lean_kernel
def _filter(raw: np.ndarray, entropy: np.ndarray, window: np.ndarray) -> None:
    """The least of 3 × 3 cells, in the window and one cell around it."""
    size_x, size_y = raw.shape[0], raw.shape[1]
    for x in range(max(window[0] - 1, 0), min(window[1] + 1, size_x)):
        for y in range(max(window[2] - 1, 0), min(window[3] + 1, size_y)):
            least = raw[x, y, 0]
            for i in range(max(x - 1, 0), min(x + 2, size_x)):
                for j in range(max(y - 1, 0), min(y + 2, size_y)):
                    least = min(least, raw[i, j, 0])
            entropy[x, y, 0] = least


class SensorModel(NamedTuple):
    """A sensor as kernels take it: R, s_n and s_f."""

    range_cells: float
    near: float
    far: float


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

    def __init__(self, occupied: np.ndarray, sensor: Sensor) -> None:
        """Look at a plan (X, Y, 1) bool."""
        self._shape = occupied.shape
        self._truth = occupied.astype(np.float32).reshape(-1)
        rays = math.ceil(2.0 * math.pi * sensor.range_cells * _RAYS_A_CELL)
        angles = np.arange(rays) * (2.0 * math.pi / rays)
        self._rays = np.stack([np.cos(angles), np.sin(angles), np.zeros(rays)], axis=1)
        x, y, z = occupied.shape
        places = longest_crossing(x, y, z, sensor.range_cells, 1)
        self._model, self._scans = SensorModel(sensor.range_cells, sensor.near, sensor.far), 0
        self._scratch = ScanScratch(
            np.empty(places, np.int32),
            np.empty(places, np.int64),
            np.zeros(occupied.size, np.int64),
            np.empty(occupied.size, np.int32),
            np.empty(occupied.size, np.float32),
        )

    def scan(self, cell: int) -> tuple[np.ndarray, np.ndarray]:
        """(N,) int32 cells and (N,) float32 readings u of them, from the centre of a cell."""
        self._scans += 1
        count = _scan(self._truth, self._shape, cell, self._rays, self._model, self._scratch, self._scans)
        return self._scratch.cells[:count].copy(), self._scratch.read[:count].copy()


@lean_kernel
def _scan(
    truth: np.ndarray,
    shape: tuple[int, int, int],
    cell: int,
    rays: np.ndarray,
    sensor: SensorModel,
    scratch: ScanScratch,
    number: int,
) -> int:
    """Cast the rays; returns how many cells were read."""
    crossed, entered, seen, cells, read = scratch
    reach, near, far = sensor
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
                confidence = near + away / (reach * reach) * (far - near)
                hit = end == OBSTACLE and i == n - 1
                cells[count] = there
                read[count] = confidence if hit else 1.0 - confidence
                count += 1
    return count

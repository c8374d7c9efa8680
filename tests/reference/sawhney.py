"""Sawhney 2009 in plain Python, slow, from its equations: frontiers, expected visibility, allocation."""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Sequence

import numpy as np

from tests.reference import rocha04

UNEXPLORED, UNMAPPED, COVERED = 1, 2, 4


def neighbours(place: tuple[int, ...], shape: Sequence[int], flat: bool) -> list[tuple[int, ...]]:
    """Voxels that share a face with one, inside the grid; of planar robots in their layer."""
    found = []
    for axis in range(2 if flat else 3):
        for step in (-1, 1):
            near = list(place)
            near[axis] += step
            if all(0 <= i < n for i, n in zip(near, shape, strict=True)):
                found.append(tuple(near))
    return found


def standing(state: np.ndarray, ball: Sequence[Sequence[int]]) -> np.ndarray:
    """(X, Y, Z) bool: all that the body touches is mapped and free, and inside."""
    found = np.zeros(state.shape, bool)
    for place in itertools.product(*map(range, state.shape)):
        touched = [tuple(i + o for i, o in zip(place, offset, strict=True)) for offset in ball]
        inside = all(0 <= i < n for voxel in touched for i, n in zip(voxel, state.shape, strict=True))
        found[place] = inside and not any(state[voxel] & (UNMAPPED | COVERED) for voxel in touched)
    return found


def candidates(
    state: np.ndarray, ball: Sequence[Sequence[int]], dropped: np.ndarray | None = None
) -> np.ndarray:
    """(X, Y, Z) bool: the body may stand there, and touches the edge of the explored that is not dropped."""
    flat = state.shape[2] == 1
    edge = np.zeros(state.shape, bool)
    for place in itertools.product(*map(range, state.shape)):
        if state[place] & (UNMAPPED | COVERED) == 0:
            beside = any(state[near] & UNEXPLORED for near in neighbours(place, state.shape, flat))
            edge[place] = bool(state[place] & UNEXPLORED) or beside
    if dropped is not None:
        edge &= ~dropped
    found = np.zeros(state.shape, bool)
    stands = standing(state, ball)
    for place in zip(*np.nonzero(stands), strict=True):
        touched = [tuple(int(i) + o for i, o in zip(place, offset, strict=True)) for offset in ball]
        found[place] = any(edge[voxel] for voxel in touched)
    return found


def crossings(start: Sequence[float], direction: Sequence[float], reach: float) -> list[float]:
    """Distances at which a ray crosses a face of any voxel, in order, 0 first and the reach last."""
    cuts = {0.0, reach}
    for position, along in zip(start, direction, strict=True):
        if abs(along) > 1e-12:
            last = position + along * reach
            low, high = min(position, last), max(position, last)
            for face in range(math.ceil(low), math.floor(high) + 1):
                cuts.add(min(max((face - position) / along, 0.0), reach))
    return sorted(cuts)


def seen_voxels(
    state: np.ndarray, start: Sequence[float], directions: np.ndarray, reach: float
) -> set[tuple[int, ...]]:
    """Unexplored voxels on rays from a place, up to and with the first that is believed covered."""
    size, found = tuple(state.shape), set()
    for direction in directions:
        ray = rocha04.trace(lambda v: bool(state[v] & COVERED), start, direction, size, reach, 1)
        found.update(voxel for voxel in ray.voxels if state[voxel] & UNEXPLORED)
    return found


def weighed(points: set[tuple[int, ...]], promised: dict[tuple[int, ...], int]) -> float:
    """Σ w, w = 1/(1 + promises)."""
    return sum(1.0 / (1 + promised.get(point, 0)) for point in points)


def ground_of(state: np.ndarray) -> np.ndarray:
    """(X, Y): solid layers of a column whose surface is known; -1 = not known."""
    found = np.full(state.shape[:2], -1)
    for x, y in np.ndindex(*state.shape[:2]):
        for z in reversed(range(state.shape[2])):
            if state[x, y, z] & COVERED and not state[x, y, z] & UNMAPPED:
                if z + 1 == state.shape[2] or state[x, y, z + 1] & (UNMAPPED | COVERED) == 0:
                    found[x, y] = z + 1
                break
    return found


def mean_height(ground: np.ndarray, x: int, y: int, patch: int) -> float:
    """z_av."""
    near = ground[max(x - patch, 0) : x + patch + 1, max(y - patch, 0) : y + patch + 1]
    known = near[near >= 0]
    return float(known.mean()) if len(known) else 0.0


def surface(ground: np.ndarray, eye: Sequence[float], average: float, fade: float) -> np.ndarray:
    """(X, Y) heights, extrapolated as z = (1 - dist/fade) z_av where unknown, and not below the floor."""
    found = ground.astype(float)
    for x, y in np.argwhere(ground < 0):
        dist = math.hypot(x + 0.5 - eye[0], y + 0.5 - eye[1])
        found[x, y] = max((1.0 - dist / fade) * average, 0.0)
    return found


def seen_columns(
    heights: np.ndarray,
    unexplored: np.ndarray,
    eye: Sequence[float],
    azimuths: np.ndarray,
    reach: float,
    flattest: float,
) -> set[tuple[int, ...]]:
    """Unexplored columns whose tops a ray from the eye meets: to the far end of the top, over all before."""
    found = set()
    for azimuth in azimuths:
        cuts = crossings(eye[:2], azimuth, 2.0 * reach)
        passed: list[tuple[float, float]] = []
        for a, b in itertools.pairwise(cuts):
            if b - a < 1e-9:
                continue
            x, y = (math.floor(p + d * 0.5 * (a + b)) for p, d in zip(eye[:2], azimuth, strict=True))
            if not (0 <= x < heights.shape[0] and 0 <= y < heights.shape[1]) or a > reach:
                break
            drop = eye[2] - heights[x, y]
            if drop <= 0.0:
                break  # higher than the eye: it hides all tops behind
            clear = all(eye[2] - drop * far / b > height for far, height in passed)
            if clear and math.hypot(a, drop) <= reach and drop >= flattest * a and unexplored[x, y]:
                found.add((x, y))
            passed.append((b, heights[x, y]))
    return found


def allocated(
    robots: Sequence[int],
    places: Sequence[int],
    value: Callable[[int, int, dict[tuple[int, ...], int]], float],
    sees: Callable[[int], set[tuple[int, ...]]],
    promised: dict[tuple[int, ...], int],
) -> dict[int, int]:
    """The paper's inner loop: the best pair first, what is seen from there promised, then the next.

    Args:
        robots: Who is allocated something.
        places: Candidates.
        value: Of a robot, a candidate and the promises so far.
        sees: Points that are seen from a candidate.
        promised: Of those under way.
    """
    promised, waiting, found = dict(promised), list(robots), dict[int, int]()
    while waiting:
        pairs = [(value(robot, place, promised), -robot, -place) for robot in waiting for place in places]
        best = max(pairs)
        if best[0] == -math.inf:
            break
        robot, place = -best[1], -best[2]
        found[robot] = place
        waiting.remove(robot)
        for point in sees(place):
            promised[point] = promised.get(point, 0) + 1
    return found

"""Short open tours: from a fixed start through all other places, ending anywhere.

A tour is built by cheapest insertion and improved by 2-opt moves (a stretch is reversed) and Or-opt moves
(up to three places in a row go elsewhere, reversed or not) until neither shortens it.
"""

from __future__ import annotations

import numpy as np

from entropy_explore_env.compilation.kernels import lean_kernel

_SLACK = 1e-9
_LONGEST_STRETCH = 3
"""Places that an Or-opt move takes along."""


def open_tour(lengths: np.ndarray) -> np.ndarray:
    """Return a short tour from place 0 through all others.

    Args:
        lengths: (N, N) float64 lengths of the ways from place to place, symmetric; inf is not allowed.

    Returns:
        (N,) int64 places in the order of the tour, place 0 first.
    """
    tour, spare = np.zeros(len(lengths), np.int64), np.empty(len(lengths), np.int64)
    insert_cheapest(np.ascontiguousarray(lengths, np.float64), tour)
    improve(np.ascontiguousarray(lengths, np.float64), tour, spare)
    return tour


def tour_length(lengths: np.ndarray, tour: np.ndarray) -> float:
    """Return the length of an open tour."""
    return float(lengths[tour[:-1], tour[1:]].sum())


@lean_kernel
def insert_cheapest(lengths: np.ndarray, tour: np.ndarray) -> None:
    """Fill in (N,) a tour: of all places that are left, the one that lengthens it least comes in next."""
    count = len(lengths)
    for place in range(count):
        tour[place] = place
    for filled in range(1, count):
        best, at, least = filled, filled, np.inf
        for other in range(filled, count):  # tour[filled:] are the places that are left
            place = tour[other]
            for gap in range(1, filled + 1):
                added = lengths[tour[gap - 1], place]
                if gap < filled:
                    added += lengths[place, tour[gap]] - lengths[tour[gap - 1], tour[gap]]
                if added < least:
                    best, at, least = other, gap, added
        chosen = tour[best]
        tour[best] = tour[filled]
        for gap in range(filled, at, -1):
            tour[gap] = tour[gap - 1]
        tour[at] = chosen


@lean_kernel
def improve(lengths: np.ndarray, tour: np.ndarray, spare: np.ndarray) -> None:
    """Shorten a tour in place until no move shortens it; `spare` is (N,) scratch space."""
    better = True
    while better:
        better = reverse_stretches(lengths, tour)
        better = move_stretches(lengths, tour, spare) or better


@lean_kernel
def reverse_stretches(lengths: np.ndarray, tour: np.ndarray) -> bool:
    """Do 2-opt moves once over the tour; whether one shortened it."""
    count, better = len(tour), False
    for first in range(1, count - 1):
        for last in range(first + 1, count):
            before, after = lengths[tour[first - 1], tour[first]], lengths[tour[first - 1], tour[last]]
            if last + 1 < count:
                before += lengths[tour[last], tour[last + 1]]
                after += lengths[tour[first], tour[last + 1]]
            if after < before - _SLACK:
                low, high = first, last
                while low < high:
                    tour[low], tour[high] = tour[high], tour[low]
                    low, high = low + 1, high - 1
                better = True
    return better


@lean_kernel
def move_stretches(lengths: np.ndarray, tour: np.ndarray, spare: np.ndarray) -> bool:
    """Do Or-opt moves once over the tour; whether one shortened it."""
    count, better = len(tour), False
    for size in range(1, _LONGEST_STRETCH + 1):
        first = 1
        while first + size <= count:
            better = _move_stretch(lengths, tour, spare, first, size) or better
            first += 1
    return better


@lean_kernel
def _move_stretch(lengths: np.ndarray, tour: np.ndarray, spare: np.ndarray, first: int, size: int) -> bool:
    """Move the stretch of a size that begins at a place of the tour to where that shortens it most."""
    count = len(tour)
    head, tail, before = tour[first], tour[first + size - 1], tour[first - 1]
    saved = lengths[before, head]
    if first + size < count:
        after = tour[first + size]
        saved += lengths[tail, after] - lengths[before, after]
    left = 0
    for place in range(count):
        if not first <= place < first + size:
            spare[left] = tour[place]
            left += 1
    best, at, turned = -_SLACK, -1, False
    for gap in range(1, left + 1):
        for reversed_ in range(2):
            a, b = (tail, head) if reversed_ else (head, tail)
            added = lengths[spare[gap - 1], a]
            if gap < left:
                added += lengths[b, spare[gap]] - lengths[spare[gap - 1], spare[gap]]
            if added - saved < best:
                best, at, turned = added - saved, gap, reversed_ == 1
    if at < 0:
        return False
    for place in range(size):  # the stretch goes behind the places that are left
        spare[left + place] = tour[first + size - 1 - place] if turned else tour[first + place]
    for place in range(at):
        tour[place] = spare[place]
    for place in range(size):
        tour[at + place] = spare[left + place]
    for place in range(at, left):
        tour[size + place] = spare[place]
    return True

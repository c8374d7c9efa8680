"""Rules that count what would be seen or look ahead, in plain Python and NumPy, slow: gain, tours, trees.

Maps and point robots as in `explorers`. Rules with a memory are objects that are called like the others.
"""

from __future__ import annotations

import itertools
import math

import numpy as np

from tests.reference.explorers import (
    FREE,
    UNKNOWN,
    WALL,
    Cell,
    frontier_cells,
    lengths_from,
    lengths_from_all,
    nearest_frontier,
)

_SAMPLES = 16
"""Points a cell at which a line of sight is looked at."""


def in_sight(stops: np.ndarray, cell: Cell, others: np.ndarray) -> np.ndarray:
    """(K,) bool: which of (K, 2) cells are seen from a cell, middle to middle, past (X, Y) bool stops.

    The cell that is looked at stops nothing. Two stops that touch at a corner leave no gap.
    """
    if len(others) == 0:
        return np.zeros(0, bool)
    apart = others - np.array(cell)
    count = _SAMPLES * int(np.abs(apart).max()) + 2
    along = np.linspace(0.0, 1.0, count)[:, None, None]
    passed = np.floor(np.array(cell) + 0.5 + along * apart).astype(int)  # (S, K, 2)
    last = (passed == others).all(axis=-1)
    stopped = (stops[passed[..., 0], passed[..., 1]] & ~last).any(axis=0)
    before, after = passed[:-1], passed[1:]
    beside = stops[before[..., 0], after[..., 1]] & stops[after[..., 0], before[..., 1]]
    across = (before != after).all(axis=-1)
    return ~stopped & ~(beside & across).any(axis=0)


def gain(plan: np.ndarray, cell: Cell, reach: float) -> int:
    """How many unknown cells within reach would be seen from a cell, were all that is unknown free."""
    unknown = np.argwhere(plan == UNKNOWN)
    unknown = unknown[np.linalg.norm(unknown - np.array(cell), axis=1) <= reach]
    return int(in_sight(plan == WALL, cell, unknown).sum())


def information_gain(
    plan: np.ndarray, robot: Cell, weight: float, horizon: float, reach: float
) -> dict[Cell, float]:
    """Frontier cell within the horizon → λ log(1 + gain) - path; if there are not two, as `nearest_frontier`.

    Args:
        plan: Known to the robot.
        robot: Where it is.
        weight: λ, in ranges.
        horizon: Longest path, in ranges.
        reach: The sensor's range, in cells.
    """
    lengths = lengths_from(plan, robot)
    near = [cell for cell in frontier_cells(plan) if lengths[cell] <= horizon * reach]
    if len(near) < 2:
        return nearest_frontier(plan, robot)
    return {
        cell: weight * reach * math.log1p(gain(plan, cell, reach)) - float(lengths[cell]) for cell in near
    }


def open_tour(between: np.ndarray) -> list[int]:
    """An order of all places from place 0 on that no reversal of a stretch shortens (2-opt).

    Args:
        between: (K, K) lengths.
    """
    tour, left = [0], set(range(1, len(between)))
    while left:
        tour.append(min(left, key=lambda place: between[tour[-1], place]))
        left.remove(tour[-1])
    shorter = True
    while shorter:
        shorter = False
        for first in range(1, len(tour) - 1):
            for last in range(first + 1, len(tour)):
                turned = tour[:first] + tour[first : last + 1][::-1] + tour[last + 1 :]
                if length_of(between, turned) < length_of(between, tour) - 1e-9:
                    tour, shorter = turned, True
    return tour


def length_of(between: np.ndarray, tour: list[int]) -> float:
    """Length of a tour."""
    return float(sum(between[a, b] for a, b in itertools.pairwise(tour)))


class Tour:
    """The first place of a short tour through cells that cover near frontiers, and one of each far region."""

    def __init__(self, reach: float, near: float, cover: float, coarse: float, stay: float) -> None:
        """Take the sensor's range in cells, and the settings in ranges; `stay` is a share of the tour."""
        self.reach, self.near, self.cover, self.coarse, self.stay = reach, near, cover, coarse, stay
        self.target: Cell | None = None

    def __call__(self, plan: np.ndarray, robot: Cell) -> dict[Cell, float]:
        """The cell to go to."""
        lengths = lengths_from(plan, robot)
        cells = sorted(
            (cell for cell in frontier_cells(plan) if math.isfinite(lengths[cell])), key=lengths.__getitem__
        )
        if not cells:
            return {}
        near = [cell for cell in cells if lengths[cell] <= self.near * self.reach]
        places = self.covering(plan, near) + self.far(cells[len(near) :])
        fields = lengths_from_all(plan, [robot, *places])
        between = np.array([[field[cell] for cell in (robot, *places)] for field in fields])
        tour = open_tour(between)
        first = places[tour[1] - 1]
        if self.target in places:
            kept = 1 + places.index(self.target)
            rest = [kept, *(n for n in range(1, len(between)) if n != kept)]
            onward = [rest[n] for n in open_tour(between[np.ix_(rest, rest)])]
            if between[0, kept] + length_of(between, onward) <= (1 + self.stay) * length_of(between, tour):
                first = self.target
        self.target = first
        return {first: 1.0}

    def covering(self, plan: np.ndarray, cells: list[Cell]) -> list[Cell]:
        """Cells from which all are seen close by, in turn the one that covers most that is left."""
        places, left, chosen = np.array(cells).reshape(-1, 2), set(range(len(cells))), []
        seen = []
        for cell in cells:
            close = np.linalg.norm(places - np.array(cell), axis=1) <= self.cover * self.reach
            seen.append(set(np.flatnonzero(close & in_sight(plan != FREE, cell, places)).tolist()))
        if self.target in cells:
            chosen.append(cells.index(self.target))
            left -= seen[chosen[0]]
        while left:
            chosen.append(max(range(len(cells)), key=lambda place: len(seen[place] & left)))
            left -= seen[chosen[-1]] | {chosen[-1]}
        return [cells[place] for place in chosen]

    def far(self, cells: list[Cell]) -> list[Cell]:
        """The nearest one of each coarse cell; the target instead where that is one."""
        edge, first = max(self.coarse * self.reach, 1.0), dict[Cell, Cell]()
        for cell in cells:
            region = int((cell[0] + 0.5) // edge), int((cell[1] + 0.5) // edge)
            if region not in first or cell == self.target:
                first[region] = cell
        return list(first.values())


class RecedingHorizon:
    """The first edge of the best branch of a random tree (Bircher et al. 2016)."""

    def __init__(
        self, reach: float, decay: float, edge: float, around: float, places: tuple[int, int]
    ) -> None:
        """Take the sensor's range in cells, and the settings in ranges; `places` of a tree, few and most."""
        self.reach, self.decay, self.edge, self.around, self.places = reach, decay, edge, around, places
        self.rng, self.scanned, self.branch = np.random.default_rng(0), set[Cell](), list[Cell]()

    def __call__(self, plan: np.ndarray, robot: Cell) -> dict[Cell, float]:
        """The cell to go to."""
        self.scanned.add(robot)
        tree: list[tuple[Cell, int]] = [(robot, -1)]
        for cell in self.branch:
            if cell != tree[-1][0] and in_sight(plan != FREE, tree[-1][0], np.array([cell]))[0]:
                tree.append((cell, len(tree) - 1))
            else:
                break
        for count in self.places:
            self.grow(plan, tree, count)
            worth = self.worth(plan, tree)
            best = int(np.argmax(worth))
            if worth[best] >= 2.0:
                branch = [best]
                while tree[branch[-1]][1] > 0:
                    branch.append(tree[branch[-1]][1])
                cells = [tree[place][0] for place in reversed(branch)]
                self.branch = cells[1:]
                return {cells[0]: 1.0}
        self.branch = []
        return nearest_frontier(plan, robot)

    def grow(self, plan: np.ndarray, tree: list[tuple[Cell, int]], count: int) -> None:
        """Add random cells until there are so many."""
        robot = np.array(tree[0][0])
        free = np.argwhere(plan == FREE)
        free = free[np.abs(free - robot).max(axis=1) <= int(self.around * self.reach)]
        for _ in range(4 * count):
            if len(tree) >= count:
                return
            drawn = free[self.rng.integers(len(free))]
            apart = [math.dist(drawn, cell) for cell, _ in tree]
            parent = int(np.argmin(apart))
            start = np.array(tree[parent][0]) + 0.5
            end = start + (drawn + 0.5 - start) * min(1.0, self.edge * self.reach / max(apart[parent], 1e-9))
            cell = (int(end[0]), int(end[1]))
            if cell != tree[parent][0] and plan[cell] == FREE:
                if in_sight(plan != FREE, tree[parent][0], np.array([cell]))[0]:
                    tree.append((cell, parent))

    def worth(self, plan: np.ndarray, tree: list[tuple[Cell, int]]) -> np.ndarray:
        """(K,) gains of the branches that end in each cell."""
        worth, lengths = np.zeros(len(tree)), np.zeros(len(tree))
        for place, (cell, parent) in enumerate(tree):
            own = 0 if cell in self.scanned else gain(plan, cell, self.reach)
            if parent >= 0:
                lengths[place] = lengths[parent] + math.dist(cell, tree[parent][0])
                worth[place] = worth[parent]
            worth[place] += own * math.exp(-self.decay * lengths[place] / self.reach)
        return worth

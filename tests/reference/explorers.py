"""Textbook rules of exploration in plain Python, NumPy and SciPy, slow: frontiers, path lengths, choices.

Point robots in plans. A map is (X, Y) int8: UNKNOWN, FREE or WALL. Paths lead from cell centre to cell centre
through known free cells; a diagonal step needs both cells beside it.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Sequence

import numpy as np
from scipy.sparse import csr_array
from scipy.sparse.csgraph import dijkstra

from entropy_explore_env.missions.view import RobotView
from entropy_explore_env.settings.scenario import Scenario

UNKNOWN, FREE, WALL = -1, 0, 1
Cell = tuple[int, int]


def frontier_cells(plan: np.ndarray) -> list[Cell]:
    """Known free cells that share a side with an unknown one (Yamauchi 1998)."""
    unknown = np.pad(plan == UNKNOWN, 1)
    beside = unknown[2:, 1:-1] | unknown[:-2, 1:-1] | unknown[1:-1, 2:] | unknown[1:-1, :-2]
    return [(int(x), int(y)) for x, y in np.argwhere((plan == FREE) & beside)]


def steps(plan: np.ndarray) -> csr_array:
    """(X·Y, X·Y) lengths of the steps between neighbouring known free cells."""
    free, number = np.pad(plan == FREE, 1), np.pad(np.arange(plan.size).reshape(plan.shape), 1)
    rows, columns, lengths = [], [], []
    inner = np.s_[1:-1, 1:-1]
    for dx, dy in ((1, 0), (0, 1), (1, 1), (1, -1)):
        there = np.roll(free, (-dx, -dy), (0, 1))
        may = free & there
        if dx and dy:
            may &= np.roll(free, -dx, 0) & np.roll(free, -dy, 1)
        rows.append(number[inner][may[inner]])
        columns.append(np.roll(number, (-dx, -dy), (0, 1))[inner][may[inner]])
        lengths.append(np.full(len(rows[-1]), math.hypot(dx, dy)))
    places = (np.concatenate(rows), np.concatenate(columns))
    return csr_array((np.concatenate(lengths), places), shape=(plan.size, plan.size))


def lengths_from(plan: np.ndarray, cell: Cell) -> np.ndarray:
    """(X, Y) lengths of the shortest paths from a cell; inf = there is none."""
    return lengths_from_all(plan, [cell])[0]


def lengths_from_all(plan: np.ndarray, cells: Sequence[Cell]) -> np.ndarray:
    """(K, X, Y) lengths of the shortest paths from K cells; inf = there is none."""
    numbers = [x * plan.shape[1] + y for x, y in cells]
    return np.asarray(dijkstra(steps(plan), directed=False, indices=numbers)).reshape(-1, *plan.shape)


def nearest_frontier(plan: np.ndarray, robot: Cell) -> dict[Cell, float]:
    """Frontier cell → minus the length of the path to it."""
    lengths = lengths_from(plan, robot)
    return {cell: -lengths[cell] for cell in frontier_cells(plan) if math.isfinite(lengths[cell])}


def distance_advantage(
    plan: np.ndarray, robot: Cell, radius: int, horizon: float, block: int = 1
) -> dict[Cell, float]:
    """Frontier cell within the horizon → its distance advantage; if there is none, as `nearest_frontier`.

    The free cells u are those that the robot can reach, at most `radius` off along either axis. Of the
    frontier cells of a block, so many cells wide, the nearest one counts.
    """
    lengths = lengths_from(plan, robot)
    near = [cell for cell in frontier_cells(plan) if lengths[cell] <= horizon and lengths[cell] < math.inf]
    if not near:
        return nearest_frontier(plan, robot)
    nearest: dict[Cell, Cell] = {}
    for cell in sorted(near, key=lambda cell: float(lengths[cell])):
        nearest.setdefault((cell[0] // block, cell[1] // block), cell)
    near = sorted(nearest.values())
    x, y = np.indices(plan.shape)
    around = (abs(x - robot[0]) <= radius) & (abs(y - robot[1]) <= radius) & np.isfinite(lengths)
    means = [float(field[around].mean()) for field in lengths_from_all(plan, near)]
    return {cell: mean - float(lengths[cell]) for cell, mean in zip(near, means, strict=True)}


def chosen(values: dict[Cell, float]) -> Cell | None:
    """A cell of greatest value."""
    return max(values, key=values.__getitem__) if values else None


def coordinated(
    plan: np.ndarray, robots: list[Cell], targets: list[Cell], beta: float, reach: float, last: bool = False
) -> dict[Cell, float]:
    """Burgard 2005's algorithm: frontier cell → U - β V for the first of several robots that choose together.

    In turn the pair of robot and cell that is worth most is taken; what the cells are worth then is told when
    it is the first robot's turn.

    Args:
        plan: The map that all of them have.
        robots: Where they are.
        targets: Where others are under way to.
        beta: Cost of a path as long as the reach.
        reach: The sensor's range, in cells.
        last: Whether the last of equal pairs is taken; else the first.
    """
    cells = frontier_cells(plan)[:: -1 if last else 1]
    utility = {cell: 1.0 - sum(max(1.0 - math.dist(cell, t) / reach, 0.0) for t in targets) for cell in cells}
    lengths = [lengths_from(plan, robot) for robot in robots]
    left = list(range(len(robots)))
    while True:
        worth = {
            (robot, cell): utility[cell] - beta * float(lengths[robot][cell]) / reach
            for robot in left
            for cell in cells
            if math.isfinite(lengths[robot][cell])
        }
        robot, taken = max(worth, key=lambda pair: round(worth[pair], 9), default=(0, None))
        if taken is None or robot == 0:
            return {cell: value for (who, cell), value in worth.items() if who == 0}
        left.remove(robot)
        for other in cells:
            utility[other] -= max(1.0 - math.dist(other, taken) / reach, 0.0)


def assigned(plan: np.ndarray, robots: list[Cell], radius: float) -> set[Cell]:
    """Cells to which some assignment of groups to robots with the least sum of path lengths sends the first.

    All assignments are tried. A group begins with the first cell that is in none, and holds all others within
    the radius of it; each group has one robot at most, and as many robots as can be have one. A robot goes to
    the nearest cell of its group, and one without a group to the nearest cell of all.

    Args:
        plan: The map that all of them have, in which each can reach all frontier cells or none.
        robots: Where they are.
        radius: Of groups, in cells.
    """
    lengths = [lengths_from(plan, robot) for robot in robots]
    cells = [cell for cell in frontier_cells(plan) if math.isfinite(lengths[0][cell])]
    members: list[list[Cell]] = []
    for cell in cells:
        home = next((group for group in members if math.dist(cell, group[0]) <= radius), None)
        members.append([cell]) if home is None else home.append(cell)
    count = min(len(robots), len(members))
    sums: dict[int | None, float] = {}
    for chosen_robots in itertools.permutations(range(len(robots)), count):
        for chosen_groups in itertools.combinations(range(len(members)), count):
            pairs = list(zip(chosen_robots, chosen_groups, strict=True))
            total = sum(min(float(lengths[who][cell]) for cell in members[group]) for who, group in pairs)
            mine = dict(pairs).get(0)
            sums[mine] = min(total, sums.get(mine, math.inf))
    least = min(sums.values(), default=math.inf)
    found: set[Cell] = set()
    for group, total in sums.items():
        if total <= least + 1e-9:
            near = cells if group is None else members[group]
            nearest = min(float(lengths[0][cell]) for cell in near)
            found |= {cell for cell in near if lengths[0][cell] <= nearest + 1e-9}
    return found


class Textbook:
    """A strategy of one point robot that decides by a rule at every call, and forgets all but its target.

    It goes to the cell of greatest value. The target is kept until the map changes, or until it is reached. A
    cell in which the robot stands and that is a frontier still counts no more: its scan did not show what is
    beside it.
    """

    def __init__(
        self, rule: Callable[[np.ndarray, Cell], dict[Cell, float]], until_reached: bool = False
    ) -> None:
        """Take a rule, from a map and the robot's cell to values of cells; and how long a target holds."""
        self.rule, self.until_reached = rule, until_reached

    def reset(self, scenario: Scenario, rng: np.random.Generator) -> None:
        """A new mission begins; nothing is drawn."""
        del scenario, rng
        self.before, self.target, self.dropped = np.zeros((0, 0)), None, set[Cell]()

    def choose(self, view: RobotView) -> np.ndarray:
        """The viewpoint of one robot."""
        return self.choose_all([view])[0]

    def choose_all(self, views: Sequence[RobotView]) -> list[np.ndarray]:
        """(5,) the viewpoint of the robot."""
        view = views[0]
        if not self.before.size:
            self.before = np.ones((1, 1))
            return [view.pose.copy()]
        plan = np.where(view.mean > 0.5, WALL, FREE)[:, :, 0]
        plan[view.precision[:, :, 0] < 0.5**-2] = UNKNOWN
        grid = view.scenario.grid
        x, y, _ = (int(i) for i in grid.voxel_of(view.pose[:3]))
        plan[x, y] = FREE
        if (x, y) in frontier_cells(plan):
            self.dropped.add((x, y))
        same = plan.shape == self.before.shape and (plan == self.before).all()
        holds = same and self.target in frontier_cells(plan) and self.target not in self.dropped
        if self.until_reached:
            holds = self.target not in (None, (x, y)) and plan[self.target] == FREE
        if not holds:
            values = self.rule(plan, (x, y))
            self.target = chosen({cell: value for cell, value in values.items() if cell not in self.dropped})
        self.before = plan
        viewpoint = view.pose.copy()
        if self.target is not None:
            viewpoint[:2] = grid.centre_of(np.array([*self.target, 0]))[:2]
        return [viewpoint]

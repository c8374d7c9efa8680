"""Bhattacharya's simulation: point robots on the cells of a plan, a step an iteration (sect. 4.3 and 5).

In an iteration every robot scans, broadcasts, tessellates its own belief from the last positions that it
received, and takes one step. With perfect messages all robots have the same belief, so one belief and one
tessellation serve all: the centralised run. Distances are in cells.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import Literal

import numpy as np

from baselines.papers.bhattacharya.simulation.belief import GridBelief, Readings, Scanner
from baselines.papers.bhattacharya.simulation.covering import (
    CellFunctional,
    coverage_functional,
    step_is_free,
)
from baselines.strategies.territory import nearest_uncertain, projected_centroid
from entropy_explore_env.belief.paths.geodesic_cells import (
    UNREACHED,
    extract_path,
    new_tessellation,
    tessellate,
)

Control = Literal["projected-centroid", "gradient-search", "nearest"]
Metric = Literal["entropy", "length"]

ETA = 0.01
"""η, what a cell of a path costs in addition to its entropy. In unknown space a diagonal step costs hardly
more than a straight one: the entropy part does not know lengths."""
TAU, TAU_FLOOR = 0.35, 0.33
"""τ, an entropy in nats from which on a cell counts as uncertain, and τ′, the least density: below τ, so that
a constant density counts as explored."""


@dataclass(frozen=True)
class Rules:
    """What robots do.

    Attributes:
        control: `projected-centroid` (eqs. 6-8), `gradient-search` (eq. 3), or `nearest`: the uncertain cell
            of the robot's own region that costs least to reach (ours; without one, the projected centroid).
        metric: What paths cost while there is something to explore: `entropy` (sect. 5.2) or `length`.
        keeps_targets: While exploring, a robot keeps its target until it arrives, sees it, or finds the path
            blocked; else it chooses a new one after every step.
        guarded: While covering, a robot moves only if its own functional falls (ours).
        perfect: Every reading and position is known to all robots at once: one belief.
        phase: Iterations of a phase of the broadcast.
        loss: Probability that a message does not reach a robot.
        range_cells: R of the sensor.
    """

    control: Control = "projected-centroid"
    metric: Metric = "entropy"
    keeps_targets: bool = True
    guarded: bool = True
    perfect: bool = True
    phase: int = 5
    loss: float = 0.0
    range_cells: float = 60.0


class Planner:
    """A belief with the tessellation and the targets that follow from it."""

    def __init__(self, belief: GridBelief, rules: Rules, robots: int) -> None:
        """Begin with nothing tessellated."""
        self.belief, self.rules, self._robots = belief, rules, robots
        self.space, self._scratch = new_tessellation(belief.shape), new_tessellation(belief.shape)
        self.explored = False
        self.tessellations = 0
        self._of: tuple[object, ...] = ()
        self.targets = np.full(robots, UNREACHED, np.int64)
        self.uncertain = np.zeros(robots, np.int64)
        self._functionals: np.ndarray | None = None

    @property
    def _metric(self) -> tuple[float, bool]:
        """What a voxel edge of path costs in addition, and whether costs are lengths."""
        by_length = self.explored or self.rules.metric == "length"
        return (0.0, True) if by_length else (ETA, False)

    def update(self, places: np.ndarray) -> None:
        """Tessellate from the robots' cells (A,), unless nothing has changed since."""
        key = (self.belief.version, *places.tolist())
        if key == self._of:
            return
        self._of, self._functionals, rules = key, None, self.rules
        self.density = np.maximum(self.belief.entropy, np.float32(TAU_FLOOR))
        while True:
            length_cost, by_length = self._metric
            cell_costs = np.ones_like(self.density) if by_length else self.belief.entropy.copy()
            cell_costs[self.belief.occupied] = np.inf
            cell_costs.reshape(-1)[places] = np.minimum(cell_costs.reshape(-1)[places], 1.0)
            self.cell_costs = cell_costs
            tessellate(self.space, cell_costs, places, length_cost, by_length)
            self.tessellations += 1
            cells = [np.flatnonzero(self.space.cells == robot) for robot in range(self._robots)]
            found = [projected_centroid(cell, self.density, TAU) for cell in cells]
            self.targets, flat = np.array(found, np.int64), self.density.reshape(-1)
            self.uncertain = np.array([np.count_nonzero(flat[cell] >= TAU) for cell in cells])
            explored = not self.uncertain.any()
            if explored == self.explored:
                break
            self.explored = explored
        if rules.control == "nearest" and not explored:
            near = [nearest_uncertain(cell, self.space.costs, self.density, TAU) for cell in cells]
            self.targets = np.where(np.array(near) == UNREACHED, self.targets, near)

    def functionals(self) -> np.ndarray:
        """Return (A,) the coverage functional of each cell."""
        if self._functionals is None:
            arrays = self.space.cells, self.space.costs, self.density
            found = [coverage_functional(*arrays, robot)[0] for robot in range(self._robots)]
            self._functionals = np.array(found)
        return self._functionals

    def path_to(self, voxel: int) -> np.ndarray:
        """Return (N,) the cells of the shortest path from its robot to a voxel."""
        return extract_path(self.space, self.cell_costs, voxel, *self._metric)

    def covering_step(self, robot: int, place: int) -> int:
        """Return the next cell of a robot that covers a region without uncertain cells."""
        cell = self.space.cells == robot
        if not cell.any():  # another robot is in the same place, and comes first
            return place
        functional = CellFunctional(self._scratch, self.cell_costs, self.density, cell, self._metric)
        if self.rules.control == "gradient-search":
            return functional.step(place)
        path = self.path_to(int(self.targets[robot]))
        if len(path) < 2:
            return place
        step = int(path[1])
        if self.rules.guarded and functional.value(step) >= float(self.functionals()[robot]):
            return place
        return step


@dataclass
class Trace:
    """What is recorded of a run, an entry an iteration."""

    places: list[list[int]] = field(default_factory=list)
    """Cells of the robots at its beginning."""
    uncertain: list[int] = field(default_factory=list)
    """Cells that can be reached and are uncertain, in the belief of the robot with the most of them."""
    functional: list[float] = field(default_factory=list)
    """The coverage functional, where it was computed; else NaN."""
    seconds: list[float] = field(default_factory=list)
    """Processor time of tessellations and controls of all robots."""
    tessellations: list[int] = field(default_factory=list)
    explored_at: int | None = None
    ended: str = "cut off"
    """`converged`, `cycle` or `cut off`."""
    cycle: int = 0
    """Iterations of the limit cycle."""


class Simulation:
    """Robots on a plan, from their starts until they converge."""

    def __init__(
        self, occupied: np.ndarray, starts: Sequence[int], rules: Rules, known: bool = False, seed: int = 0
    ) -> None:
        """Place the robots at their starts.

        Args:
            occupied: (X, Y, 1) bool, the truth.
            starts: Cells of the robots; free ones.
            rules: What they do.
            known: Whether they know the plan from the beginning.
            seed: Of lost messages.
        """
        self.occupied, self.rules, self.known = occupied, rules, known
        self.places = np.array(starts, np.int64)
        robots = len(self.places)
        count = 1 if rules.perfect or known else robots
        beliefs = [GridBelief(occupied.shape) for _ in range(count)]
        self.planners = [Planner(belief, rules, robots) for belief in beliefs]
        self._shared = count == 1
        self._planner_of = self.planners * robots if self._shared else self.planners
        self._scanner = Scanner(occupied, rules.range_cells)
        self._still_iterations = 0
        self._last_heard_at = np.tile(self.places, (robots, 1))
        self._paths: list[np.ndarray] = [np.zeros(0, np.int64)] * robots
        self._wants_to_see = [False] * robots
        self._rng = np.random.default_rng(seed)
        buffers = 0 if self._shared else robots
        self._sensing = [Readings(occupied.size) for _ in range(buffers)]
        self._broadcast = [Readings(occupied.size) for _ in range(buffers)]
        self._received = np.ones((robots, robots), bool)
        self.trace = Trace()
        if known:
            belief = self.planners[0].belief
            belief.probability[:] = occupied.reshape(-1)
            belief.entropy[:] = 0.0

    def run(self, limit: int, every: int = 0, after_step: Callable[[bool], None] | None = None) -> Trace:
        """Iterate until no robot moves any more, positions in a known plan repeat, or the limit is reached.

        Args:
            limit: Most iterations.
            every: Iterations between entries of the coverage functional, which costs extra; 0 = none.
            after_step: Called after each iteration with whether the run goes on.
        """
        seen: dict[tuple[int, ...], int] = {}
        for iteration in range(limit):
            if self.known:
                key = tuple(self.places.tolist())
                if key in seen:
                    self.trace.ended, self.trace.cycle = "cycle", iteration - seen[key]
                    break
                seen[key] = iteration
            goes_on = self.step(bool(every) and iteration % every == 0)
            if after_step is not None:
                after_step(goes_on)
            if not goes_on:
                self.trace.ended = "converged"
                break
        return self.trace

    def step(self, functional: bool = True) -> bool:
        """Run one iteration; return False once all is explored and no robot has moved for long enough."""
        trace, before = self.trace, sum(planner.tessellations for planner in self.planners)
        trace.places.append(self.places.tolist())
        if not self.known:
            self._scan_and_broadcast(len(trace.places) - 1)
        started = time.thread_time()
        steps = np.array([self._step_of(robot) for robot in range(len(self.places))])
        trace.seconds.append(time.thread_time() - started)
        trace.tessellations.append(sum(planner.tessellations for planner in self.planners) - before)
        moved = bool((steps != self.places).any())
        if functional:
            self.planners[0].update(self._known_places(0))
            trace.functional.append(float(self.planners[0].functionals().sum()))
        else:
            trace.functional.append(float("nan"))
        self.places = steps
        explored = all(planner.explored for planner in self.planners)
        if explored and trace.explored_at is None:
            trace.explored_at = len(trace.places) - 1
        counts = [int(planner.uncertain.sum()) for planner in self.planners]
        trace.uncertain.append(max(counts))
        self._still_iterations = 0 if moved or not explored else self._still_iterations + 1
        return self._still_iterations < (1 if self._shared else 2 * self.rules.phase)  # of messages in flight

    def _known_places(self, robot: int) -> np.ndarray:
        """Return (A,) where a robot believes the team to be."""
        if self._shared:
            return self.places
        self._last_heard_at[robot, robot] = self.places[robot]
        return self._last_heard_at[robot]

    def _scan_and_broadcast(self, iteration: int) -> None:
        """Let all robots scan, and broadcast in phases where messages are not perfect."""
        robots = range(len(self.places))
        if iteration % self.rules.phase == 0 and not self._shared:
            for robot in robots:  # swap the buffers
                self._broadcast[robot].clear()
                both = self._sensing[robot], self._broadcast[robot]
                self._broadcast[robot], self._sensing[robot] = both
                self._received[robot] = not self._broadcast[robot].times.any()
        for robot, place in enumerate(self.places):
            scan = self._scanner.scan(int(place))
            self._planner_of[robot].belief.fuse_scan(scan)
            if not self._shared:
                self._sensing[robot].add(scan)
        for robot in () if self._shared else robots:
            self._send(robot)

    def _send(self, sender: int) -> None:
        """Broadcast a buffer and a position; a robot that has received the buffer ignores it."""
        message = self._broadcast[sender]
        for mate in range(len(self.places)):
            if mate == sender or self._rng.random() < self.rules.loss:
                continue
            self._last_heard_at[mate, sender] = self.places[sender]
            if not self._received[sender, mate]:
                self.planners[mate].belief.fuse_readings(message)
                self._received[sender, mate] = True

    def _step_of(self, robot: int) -> int:
        """Return the cell to which a robot steps in this iteration."""
        planner, place = self._planner_of[robot], int(self.places[robot])
        if self.rules.keeps_targets and not planner.explored and self._keeps_target(planner, robot):
            step = int(self._paths[robot][0])
        else:
            planner.update(self._known_places(robot))
            if planner.explored or self.rules.control == "gradient-search":
                step = planner.covering_step(robot, place)
            else:
                target = int(planner.targets[robot])
                reached = target != UNREACHED
                path = planner.path_to(target)[1:] if reached else self._paths[robot][:0]
                self._paths[robot] = path
                self._wants_to_see[robot] = reached and self._uncertain(planner, target)
                step = int(path[0]) if len(path) else place
        if step != place and not step_is_free(~self.occupied, place, step):
            step = place  # the next cell was not known to be occupied
            self._paths[robot] = self._paths[robot][:0]
        if step != place:
            self._paths[robot] = self._paths[robot][1:]
        return step

    def _uncertain(self, planner: Planner, cell: int) -> bool:
        return bool(planner.belief.entropy.reshape(-1)[cell] >= TAU)

    def _keeps_target(self, planner: Planner, robot: int) -> bool:
        """Return whether a robot keeps a target: not reached or blocked, nor seen yet if that is the aim."""
        path = self._paths[robot]
        if len(path) == 0 or (self._wants_to_see[robot] and not self._uncertain(planner, int(path[-1]))):
            return False
        if (planner.belief.probability[path] > 0.5).any():
            return False
        free = (planner.belief.probability <= 0.5).reshape(self.occupied.shape)
        return step_is_free(free, int(self.places[robot]), int(path[0]))

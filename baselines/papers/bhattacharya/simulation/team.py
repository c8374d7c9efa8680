"""Bhattacharya's simulation: point robots on the cells of a plan, a step an iteration (sect. 4.3 and 5).

In an iteration every robot scans, tells the others, tessellates its own belief from the positions it last
heard, and takes one step. With perfect messages all beliefs are the same one, and a robot that knows what
the others know needs no other code: that is the centralised run. Distances are in cells.
"""

from __future__ import annotations

import time
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Literal

import numpy as np

from baselines.papers.bhattacharya.simulation.belief import (
    BITS_PER_CELL,
    BITS_PER_MESSAGE,
    Fusion,
    GridBelief,
    Readings,
    Scanner,
    Sensor,
)
from baselines.strategies.voronoi.controls import (
    CellFunctional,
    coverage_functionals,
    gradient_step,
    nearest_uncertain,
    projected_centroids,
    step_is_free,
)
from entropy_explore_env.belief.paths.geodesic_cells import (
    UNREACHED,
    extract_path,
    new_tessellation,
    tessellate,
)
from entropy_explore_env.errors import SettingError
from entropy_explore_env.validation import check, check_choice, check_count, check_kind, check_not_negative

Control = Literal["projected-centroid", "gradient-search", "nearest"]
Metric = Literal["entropy", "length"]


@dataclass(frozen=True)
class Rules:
    """What robots do.

    Attributes:
        control: `projected-centroid` (eqs. 6-8), `gradient-search` (eq. 3), or `nearest`: the uncertain cell
            of the robot's own region that costs least to reach (ours; without one, the projected centroid).
        metric: What ways cost while there is something to explore: `entropy` (sect. 5.2) or `length`.
        eta: η, what a cell of way costs besides its entropy. In unknown space a diagonal step costs hardly
            more than a straight one: the entropy part does not know lengths.
        tau: τ, an entropy in nats from which on a cell counts as uncertain.
        tau_floor: τ′, the least density; below τ, so that a constant density counts as explored.
        keeps_targets: While exploring, a robot goes to its target until it is there, or sees it, or finds the
            way blocked; else it takes one step and chooses anew.
        guarded: While covering, a robot moves only if its own functional falls (ours).
        perfect: All know at once what one reads, and where all are: one belief.
        phase: Iterations of a phase of the broadcast.
        loss: Probability that a message does not reach a robot.
    """

    control: Control = "projected-centroid"
    metric: Metric = "entropy"
    eta: float = 0.01
    tau: float = 0.35
    tau_floor: float = 0.33
    keeps_targets: bool = True
    guarded: bool = True
    perfect: bool = True
    phase: int = 5
    loss: float = 0.0
    sensor: Sensor = field(default_factory=Sensor)
    fusion: Fusion = field(default_factory=Fusion)

    def __post_init__(self) -> None:
        """Check every field."""
        check_choice(self, "control", Control)
        check_choice(self, "metric", Metric)
        check(self, "eta", "a number from 1e-6 to 1e3", lambda v: 1e-6 <= v <= 1e3)
        check(self, "tau", "a number from 1e-6 to ln 2", lambda v: 1e-6 <= v <= 0.6931)
        check(self, "tau_floor", "a number above 0 and below tau", lambda v: 0.0 < v < self.tau)
        for name in ("keeps_targets", "guarded", "perfect"):
            check_kind(self, name, bool)
        check_count(self, "phase", 1, 10**6)
        check_not_negative(self, "loss")
        check(self, "loss", "a number from 0 to 1", lambda v: v <= 1.0)


class Mind:
    """A belief with the tessellation and the targets that follow from it."""

    def __init__(self, belief: GridBelief, rules: Rules, robots: int) -> None:
        """Nothing is tessellated yet."""
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
        return (0.0, True) if by_length else (self.rules.eta, False)

    def update(self, places: np.ndarray) -> None:
        """Tessellate from the robots' cells (A,), unless nothing has changed since."""
        key = (self.belief.version, *places.tolist())
        if key == self._of:
            return
        self._of, self._functionals, rules = key, None, self.rules
        self.density = np.maximum(self.belief.entropy, np.float32(rules.tau_floor))
        while True:
            length_cost, by_length = self._metric
            rates = np.ones_like(self.density) if by_length else self.belief.entropy.copy()
            rates[self.belief.occupied] = np.inf
            rates.reshape(-1)[places] = np.minimum(rates.reshape(-1)[places], 1.0)
            self.rates = rates
            tessellate(self.space, rates, places, length_cost, by_length)
            self.tessellations += 1
            found = projected_centroids(self.space.cells, self.density, rules.tau, self._robots)
            self.targets, self.uncertain = found
            explored = not self.uncertain.any()
            if explored == self.explored:
                break
            self.explored = explored
        if rules.control == "nearest" and not explored:
            arrays = self.space.cells, self.space.costs, self.density
            near = nearest_uncertain(*arrays, rules.tau, self._robots)
            self.targets = np.where(near == UNREACHED, self.targets, near)

    def functionals(self) -> np.ndarray:
        """(A,) the coverage functional of each cell."""
        if self._functionals is None:
            arrays = self.space.cells, self.space.costs, self.density
            self._functionals = coverage_functionals(*arrays, self._robots)
        return self._functionals

    def way(self, voxel: int) -> np.ndarray:
        """(N,) the way from its robot to a voxel."""
        return extract_path(self.space, self.rates, voxel, *self._metric)

    def covering_step(self, robot: int, place: int) -> int:
        """Where a robot steps that explores no more."""
        cell = self.space.cells == robot
        if not cell.any():  # another robot is in the same place, and comes first
            return place
        if self.rules.control == "gradient-search":
            functional = CellFunctional(self._scratch, self.rates, self.density, cell)
            return gradient_step(functional, cell, place, *self._metric)
        way = self.way(int(self.targets[robot]))
        if len(way) < 2:
            return place
        step = int(way[1])
        if self.rules.guarded:
            functional = CellFunctional(self._scratch, self.rates, self.density, cell)
            if functional.value(step, *self._metric) >= float(self.functionals()[robot]):
                return place
        return step


@dataclass
class Tally:
    """What a run leaves, an entry an iteration."""

    places: list[list[int]] = field(default_factory=list)
    """Cells of the robots at its beginning."""
    uncertain: list[int] = field(default_factory=list)
    """Cells that can be reached and are uncertain, by the belief of the robot that knows least."""
    functional: list[float] = field(default_factory=list)
    """The coverage functional, where it was worked out; else NaN."""
    entropy: list[float] = field(default_factory=list)
    """Entropy of robot 0's map in nats, after the filter."""
    seconds: list[float] = field(default_factory=list)
    """Processor time of tessellations and controls of all robots."""
    tessellations: list[int] = field(default_factory=list)
    bits: list[int] = field(default_factory=list)
    """Sent so far by all robots."""
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
        """Put the robots down.

        Args:
            occupied: (X, Y, 1) bool, the truth.
            starts: Cells of the robots; free ones.
            rules: What they do.
            known: Whether they know the plan from the beginning.
            seed: Of lost messages.

        Raises:
            SettingError: A start is occupied.
        """
        if occupied.reshape(-1)[list(starts)].any():
            raise SettingError("starts", list(starts), "free cells")
        self.occupied, self.rules, self.known = occupied, rules, known
        self.places = np.array(starts, np.int64)
        robots = len(self.places)
        minds = 1 if rules.perfect or known else robots
        self.minds = [Mind(GridBelief(occupied.shape, rules.fusion), rules, robots) for _ in range(minds)]
        self._scanner = Scanner(occupied, rules.sensor)
        self._truth = occupied.astype(np.float32).reshape(-1)
        self._quiet = 0
        self._heard = np.tile(self.places, (robots, 1))
        self._ways: list[np.ndarray] = [np.zeros(0, np.int64)] * robots
        self._wants_to_see = [False] * robots
        self._rng = np.random.default_rng(seed)
        buffers = 0 if minds == 1 else robots
        self._sensing = [Readings(occupied.size) for _ in range(buffers)]
        self._broadcast = [Readings(occupied.size) for _ in range(buffers)]
        self._has = np.ones((robots, robots), bool)
        self.tally, self._bits = Tally(), 0
        if known:
            belief = self.minds[0].belief
            belief.probability[:] = occupied.reshape(-1)
            belief.entropy[:] = 0.0

    def run(self, limit: int, every: int = 0) -> Tally:
        """Iterate until nobody moves any more, a known plan's positions come again, or the limit.

        Args:
            limit: Most iterations.
            every: So often the coverage functional is noted where it would have to be worked out extra; 0 =
            never.
        """
        seen: dict[tuple[int, ...], int] = {}
        for iteration in range(limit):
            if self.known:
                key = tuple(self.places.tolist())
                if key in seen:
                    self.tally.ended, self.tally.cycle = "cycle", iteration - seen[key]
                    break
                seen[key] = iteration
            if not self.step(bool(every) and iteration % every == 0):
                self.tally.ended = "converged"
                break
        return self.tally

    def step(self, functional: bool = True) -> bool:
        """One iteration; returns False where all is explored and nobody has moved for long enough."""
        tally, before = self.tally, sum(mind.tessellations for mind in self.minds)
        tally.places.append(self.places.tolist())
        if not self.known:
            self._scan_and_tell(len(tally.places) - 1)
        started = time.thread_time()
        steps = np.array([self._step_of(robot) for robot in range(len(self.places))])
        tally.seconds.append(time.thread_time() - started)
        tally.tessellations.append(sum(mind.tessellations for mind in self.minds) - before)
        moved = bool((steps != self.places).any())
        if functional:
            self.minds[0].update(self._known_places(0))
            tally.functional.append(float(self.minds[0].functionals().sum()))
        else:
            tally.functional.append(float("nan"))
        self.places = steps
        explored = all(mind.explored for mind in self.minds)
        if explored and tally.explored_at is None:
            tally.explored_at = len(tally.places) - 1
        counts = [int(mind.uncertain.sum()) for mind in self.minds]
        tally.uncertain.append(max(counts))
        tally.entropy.append(float(self.minds[0].belief.entropy.sum(dtype=np.float64)))
        tally.bits.append(self._bits)
        self._quiet = 0 if moved or not explored else self._quiet + 1
        return self._quiet < (
            1 if len(self.minds) == 1 else 2 * self.rules.phase
        )  # messages may be under way

    def _known_places(self, robot: int) -> np.ndarray:
        """(A,) where a robot believes all to be."""
        if len(self.minds) == 1:
            return self.places
        self._heard[robot, robot] = self.places[robot]
        return self._heard[robot]

    def _scan_and_tell(self, iteration: int) -> None:
        """All robots scan, and broadcast in phases where messages are not perfect."""
        robots = len(self.places)
        if iteration % self.rules.phase == 0 and len(self.minds) > 1:
            for robot in range(robots):  # the buffers change places
                self._broadcast[robot].clear()
                both = self._sensing[robot], self._broadcast[robot]
                self._broadcast[robot], self._sensing[robot] = both
                self._has[robot] = self._broadcast[robot].count == 0
        for robot in range(robots):
            scan = self._scanner.scan(int(self.places[robot]))
            self.minds[robot if len(self.minds) > 1 else 0].belief.take_scan(scan)
            if len(self.minds) > 1:
                self._sensing[robot].add(scan, self.rules.fusion)
        if len(self.minds) > 1:
            for robot in range(robots):
                self._tell(robot)

    def _tell(self, sender: int) -> None:
        """Broadcast a buffer and a position; who has the buffer already ignores it."""
        message = self._broadcast[sender]
        self._bits += BITS_PER_MESSAGE + message.count * BITS_PER_CELL
        for mate in range(len(self.places)):
            if mate == sender or self._rng.random() < self.rules.loss:
                continue
            self._heard[mate, sender] = self.places[sender]
            if not self._has[sender, mate]:
                self.minds[mate].belief.take_readings(message)
                self._has[sender, mate] = True

    def _step_of(self, robot: int) -> int:
        """Where a robot goes in this iteration."""
        mind, place = self.minds[robot if len(self.minds) > 1 else 0], int(self.places[robot])
        if self.rules.keeps_targets and not mind.explored and self._goes_on(mind, robot):
            step = int(self._ways[robot][0])
        else:
            mind.update(self._known_places(robot))
            if mind.explored or self.rules.control == "gradient-search":
                step = mind.covering_step(robot, place)
            else:
                target = int(mind.targets[robot])
                self._ways[robot] = mind.way(target)[1:] if target != UNREACHED else self._ways[robot][:0]
                self._wants_to_see[robot] = target != UNREACHED and self._uncertain(mind, target)
                step = int(self._ways[robot][0]) if len(self._ways[robot]) else place
        if step != place and not step_is_free(self._truth, self.occupied.shape, place, step):
            step = place  # what is right beside it is not known yet
            self._ways[robot] = self._ways[robot][:0]
        if step != place:
            self._ways[robot] = self._ways[robot][1:]
        return step

    def _uncertain(self, mind: Mind, cell: int) -> bool:
        return bool(mind.belief.entropy.reshape(-1)[cell] >= self.rules.tau)

    def _goes_on(self, mind: Mind, robot: int) -> bool:
        """Whether a robot's target stands: still ahead, not yet seen if that was wanted, and not blocked."""
        way = self._ways[robot]
        if len(way) == 0 or (self._wants_to_see[robot] and not self._uncertain(mind, int(way[-1]))):
            return False
        if (mind.belief.probability[way] > 0.5).any():
            return False
        probability, size = mind.belief.probability, self.occupied.shape
        return bool(step_is_free(probability, size, int(self.places[robot]), int(way[0])))

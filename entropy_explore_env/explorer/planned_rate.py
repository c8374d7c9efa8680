"""The planner as a strategy, `planned-rate`: to each robot the viewpoint to which it drives next.

Ours, not a paper's. Candidates are drawn, scored by expected bits per time and remembered as `planner` says,
as those that a policy chooses among where candidates are the actions. A far place is driven to if it is worth
more than every viewpoint nearby, along the shortest path by the robot's belief, and the robot decides anew at
every stop. What a robot is, and what its mission asks for, decides how it explores:

- Flying robots, and all in 3-D worlds: bits per time, with the recipe of narrow or of wide views. In caves,
  scans are imagined in a predicted map.
- Drones that see all around and scan in flight, in grids that are fine for them, in missions that end by what
  was seen: by bits per time, and on tours of frontier cells while they gain little.
- Ground robots with a scanner that sees all around, in a plan, until the map has a given entropy: bits per
  time, of scans imagined in a predicted map where much is predicted solid (`missions.foresight`).
- The same robots where everything is to be seen: frontier cells on short tours, see `planner.tour`.
  Bits per time would leave what is small until the end, and drive back for it.
- The same robots where a part may stay unseen: bits per time, of unknown voxels alone.

With learned weights (`planner.weights`) a robot chooses among several candidates of the same planner, in any
mission. Where robots return to their start, one that finds nothing worth a scan goes for the frontier cells
that are left, and then home.
"""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Callable

import numpy as np

from entropy_explore_env.belief.paths.search import Search
from entropy_explore_env.missions.foresight import Foresight, LearnedForesight, predictions_pay
from entropy_explore_env.missions.view import RobotView
from entropy_explore_env.missions.view_candidates import ViewProposer
from entropy_explore_env.planner.tour import SharedTour
from entropy_explore_env.planner.weights import PlannerWeights
from entropy_explore_env.settings.changes import with_settings
from entropy_explore_env.settings.robot_kind import RobotKind
from entropy_explore_env.settings.scenario import Scenario
from entropy_explore_env.viewpoints.evaluation import cell_edge, sees_all_around

_EVERYTHING = 0.995
"""Share of what can be seen from which on every corner must be seen."""
_LATELY_S = 20.0
"""How far back the gains count by which a drone decides whether it gains little."""
_LITTLE = 0.2
"""A drone that gained less, a second, than this share of its mission's mean gains little."""


def explores_frontiers(scenario: Scenario, kind: RobotKind) -> bool:
    """Return whether robots of a kind go for frontier cells, and not for bits."""
    if not (scenario.grid.flat and kind.robot.motion == "planar" and sees_all_around(kind.sensor)):
        return False
    return scenario.ending.by_seen and _wants_everything(scenario, kind)


def _wants_everything(scenario: Scenario, kind: RobotKind) -> bool:
    """Return whether a mission that ends by what is seen leaves no more unseen than a sliver between rays."""
    ending = scenario.ending
    if ending.seen_share is not None:
        return ending.seen_share >= _EVERYTHING
    unseen = 0 if ending.unseen_free_voxels is None else ending.unseen_free_voxels
    return unseen < kind.sensor.max_range_m / scenario.grid.voxel_size_m


def tours_what_is_left(scenario: Scenario, kind: RobotKind) -> bool:
    """Return whether robots of a kind go for frontier cells while they gain little.

    Drones do that see all around and scan in flight, where several voxels make a cell of their paths. By bits
    per time they would cross the world for each of the slivers between rays that are left. Robots that return
    to their start go for all frontier cells before that.
    """
    scans_in_flight = sees_all_around(kind.sensor) and math.isfinite(kind.sensor.scan_every_m)
    counts_seen = scenario.ending.by_seen and not scenario.ending.return_to_start
    return counts_seen and scans_in_flight and cell_edge(scenario, kind) > 1


class _Gains:
    """What a robot gained lately."""

    def __init__(self) -> None:
        """Begin a mission."""
        self._past: deque[tuple[float, float]] = deque()
        """Time, and bits gained until then, at the decisions of the last _LATELY_S seconds and one before."""

    def are_low(self, view: RobotView) -> bool:
        """Return whether the robot gains little now, at one of its decisions."""
        self._past.append((view.time_s, view.gained_bits))
        while len(self._past) > 1 and view.time_s - self._past[1][0] >= _LATELY_S:
            self._past.popleft()
        since_s, before = self._past[0]
        seconds, gained = view.time_s - since_s, view.gained_bits - before
        return seconds >= _LATELY_S and gained / seconds < _LITTLE * view.gained_bits / view.time_s


class PlannedRate:
    """Chooses among candidates nearby and far away by bits / s^c; in some plans among frontier cells."""

    def __init__(
        self,
        weights: PlannerWeights | None = None,
        foresight: Callable[[], Foresight] | None = LearnedForesight,
    ) -> None:
        """Take the weights of features by which candidates are chosen; None = by bits / s^c alone.

        Without weights, `foresight` makes what predicts unknown voxels in a mission that it suits
        (`missions.foresight`); None = nothing is predicted.
        """
        self.weights, self._foresight = weights, foresight if weights is None else None

    def reset(self, scenario: Scenario, rng: np.random.Generator) -> None:
        """Begin a mission."""
        weights, kinds = self.weights, [scenario.kind_of(robot) for robot in range(scenario.robots)]
        self._by_frontiers = [weights is None and explores_frontiers(scenario, kind) for kind in kinds]
        """Whether each robot goes for frontier cells, and home when there are none."""
        self._returns = scenario.ending.return_to_start
        self._gains: dict[int, _Gains] = {}
        """Robot → what it gained lately, of those that tour what is left."""
        self._parts: list[SharedTour | ViewProposer] = []
        self._rng, self._tours = rng, SharedTour()
        self._tours.backs_off = False  # whatever the planner chooses is followed so
        self._prepare_tours(scenario)
        if not all(self._by_frontiers):
            foresight = self._foresight() if self._foresight and predictions_pay(scenario) else None
            self._proposer = ViewProposer(self._proposing(scenario), rng, foresight=foresight)
            self._parts.append(self._proposer)

    def _prepare_tours(self, scenario: Scenario) -> None:
        """Get ready for tours, if a robot may go on one in the grid of a scenario."""
        for robot in range(scenario.robots):
            if self.weights is None and tours_what_is_left(scenario, scenario.kind_of(robot)):
                self._gains.setdefault(robot, _Gains())
        wanted = any(self._by_frontiers) or self._returns or len(self._gains) > 0
        if wanted and self._tours not in self._parts:
            self._tours.refines = len(self._gains) == 0
            self._tours.reset(scenario, self._rng)
            self._parts.append(self._tours)

    def _proposing(self, scenario: Scenario) -> Scenario:
        """Return a scenario with as many candidates as are compared."""
        most = 1 if self.weights is None else self.weights.candidates
        return with_settings(scenario, {"action": {"kind": "candidates", "candidates": most}})

    def grow(self, scenario: Scenario, shift: np.ndarray) -> None:
        """Go on in a larger grid: see `explorer.goals.Decider`."""
        for part in self._parts:
            part.grow(self._proposing(scenario), shift)
        self._prepare_tours(scenario)

    @property
    def search(self) -> Search:
        """Memory of its path searches, which nothing needs from one decision to the next."""
        return self._tours.search if any(self._by_frontiers) else self._proposer.search

    def choose(self, view: RobotView) -> np.ndarray:
        """Return the viewpoint (5,) by the robot's own belief and what it has heard."""
        if view.robot in self._gains and view.ceiling is None:  # below an exposure surface there are no tours
            viewpoint = self._toured(view)
            if viewpoint is not None:
                return viewpoint
        elif self._by_frontiers[view.robot]:
            return self._tours.choose(view)
        proposed = self._proposer.propose(view)
        if self._returns and view.ceiling is None:
            self._tours.start_from(view)
            if self._proposer.found_nothing(view.robot):
                self._by_frontiers[view.robot] = True
                return self._tours.choose(view)
        if self.weights is None:
            return proposed[0].copy()
        features = self._proposer.features(view.robot)
        counts = np.array([len(proposed)], np.int64)
        return proposed[self.weights.choices(features[None], counts)[0]].copy()

    def _toured(self, view: RobotView) -> np.ndarray | None:
        """Return the viewpoint (5,) on a tour of what is left; None = it gains enough, or finds no cell."""
        robot, toured = view.robot, self._by_frontiers[view.robot]
        self._by_frontiers[robot] = False
        if not self._gains[robot].are_low(view):
            return None
        if not toured:
            self._tours.take_over(view)
            self._proposer.forget_goal(robot)
        viewpoint = self._tours.choose(view)
        self._by_frontiers[robot] = not self._tours.found_nothing(robot)
        return viewpoint if self._by_frontiers[robot] else None

    def found_nothing(self, robot: int) -> bool:
        """Return whether nothing that is worth a drive was found for a robot at its latest decision."""
        if self._by_frontiers[robot]:
            return self._tours.found_nothing(robot)
        return self._proposer.found_nothing(robot)

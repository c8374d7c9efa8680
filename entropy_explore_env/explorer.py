"""The planner as a strategy, `planned-rate`: to each robot the viewpoint to which it drives next.

Ours, not a paper's. Candidates are drawn, scored by expected bits per time and remembered as `planner` says,
as those that a policy chooses among where candidates are the actions. A far place is driven to if it is worth
more than every viewpoint nearby, along the shortest path by the robot's belief, and the robot decides anew at
every stop. What a robot is, and what its mission asks for, decides how it explores:

- Flying robots, and all in 3-D worlds: bits per time, with the recipe of narrow or of wide views.
- Ground robots with a scanner that sees all around, in a plan, until the map has a given entropy: bits per
  time.
- The same robots where everything is to be seen: frontier cells on short tours, see `planner.shared_tour`.
  Bits per time would leave what is small until the end, and drive back for it.
- The same robots where a part may stay unseen: bits per time, of unknown voxels alone.
"""

from __future__ import annotations

import numpy as np

from entropy_explore_env.missions.view import RobotView
from entropy_explore_env.missions.view_candidates import ViewProposer
from entropy_explore_env.planner.shared_tour import SharedTour
from entropy_explore_env.scenario import Scenario, with_settings
from entropy_explore_env.settings import RobotKind
from entropy_explore_env.viewpoints.evaluation import sees_all_around

_EVERYTHING = 0.995
"""Share of what can be seen from which on every corner must be seen."""


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


class PlannedRate:
    """Chooses among candidates nearby and far away by bits / s^c; in some plans among frontier cells."""

    def reset(self, scenario: Scenario, rng: np.random.Generator) -> None:
        """Begin a mission."""
        self._frontiers = [explores_frontiers(scenario, kind) for kind in scenario.kinds]
        if any(self._frontiers):
            self._tours = SharedTour()
            self._tours.backs_off = False  # whatever the planner chooses is followed so
            self._tours.reset(scenario, rng)
        if not all(self._frontiers):
            one = with_settings(scenario, {"action": {"kind": "candidates", "candidates": 1}})
            self._proposer = ViewProposer(one, rng)

    def choose(self, view: RobotView) -> np.ndarray:
        """Return the viewpoint (5,) by the robot's own belief and what it has heard."""
        if self._frontiers[view.robot % len(self._frontiers)]:
            return self._tours.choose(view)
        return self._proposer.propose(view)[0].copy()

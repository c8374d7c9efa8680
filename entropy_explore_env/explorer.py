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

from collections.abc import Sequence
from dataclasses import asdict, dataclass, fields
from typing import Any

import numpy as np

from entropy_explore_env.missions.view import RobotView
from entropy_explore_env.missions.view_candidates import ViewProposer
from entropy_explore_env.planner.recipe import Recipe, recipe_for
from entropy_explore_env.planner.shared_tour import SharedTour, SharedTourConfig
from entropy_explore_env.scenario import Scenario, with_settings
from entropy_explore_env.settings import RobotKind
from entropy_explore_env.validation import check_count, check_not_negative
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


@dataclass(frozen=True)
class PlannedRateConfig:
    """What differs from the recipe of every kind of robot, and from the settings of tours; None = nothing.

    Attributes:
        behind: As in `planner.recipe.Recipe`.
        far_places: As in `planner.recipe.Recipe`.
        leave_below: As in `planner.recipe.Recipe`.
        pocket: As in `planner.shared_tour.SharedTourConfig`.
        sight: As in `planner.shared_tour.SharedTourConfig`.

    Raises:
        SettingError: One of them is not allowed.
    """

    behind: float | None = None
    far_places: int | None = None
    leave_below: float | None = None
    pocket: float | None = None
    sight: float | None = None

    def __post_init__(self) -> None:
        """Check every field."""
        for name in (name for name, value in asdict(self).items() if value is not None):
            if name == "far_places":
                check_count(self, name, 0, 100_000)
            else:
                check_not_negative(self, name)

    def recipe(self, kind: RobotKind) -> Recipe:
        """Return the recipe of a kind of robot."""
        return recipe_for(kind)._replace(**self._given(Recipe._fields))

    def tour(self) -> SharedTourConfig:
        """Return the settings of tours in plans of which everything is to be seen."""
        return SharedTourConfig(**self._given([field.name for field in fields(SharedTourConfig)]))

    def _given(self, names: Sequence[str]) -> dict[str, Any]:
        """Return those of its fields that have one of some names and are not None."""
        return {name: value for name, value in asdict(self).items() if name in names and value is not None}


class PlannedRate:
    """Chooses among candidates nearby and far away by bits / s^c; in some plans among frontier cells."""

    def __init__(self, config: PlannedRateConfig | None = None) -> None:
        """Take what differs from the robots' recipes; None = nothing."""
        self.config = config or PlannedRateConfig()

    def reset(self, scenario: Scenario, rng: np.random.Generator) -> None:
        """Begin a new mission."""
        self._frontiers = [explores_frontiers(scenario, kind) for kind in scenario.kinds]
        if any(self._frontiers):
            self._plans = SharedTour(self.config.tour())
            self._plans.reset(scenario, rng)
        if not all(self._frontiers):
            one = with_settings(scenario, {"action": {"kind": "candidates", "candidates": 1}})
            recipes = {number: self.config.recipe(kind) for number, kind in enumerate(scenario.kinds)}
            self._proposer = ViewProposer(one, rng, recipes=recipes)

    def choose(self, views: Sequence[RobotView]) -> list[np.ndarray]:
        """Return the viewpoint of each view, by its own belief and what it has heard."""
        return [self._choose(view) for view in views]

    def _choose(self, view: RobotView) -> np.ndarray:
        if self._frontiers[view.robot % len(self._frontiers)]:
            return self._plans.choose([view])[0]
        return self._proposer.propose(view)[0].copy()

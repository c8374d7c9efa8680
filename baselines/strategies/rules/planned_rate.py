"""The strategy `planned-rate`: viewpoints nearby and far places on planned paths, by expected bits per time.

Ours, not a paper's: the successor of `information-rate-v0`. Candidates and their expected bits are those of
`viewpoints.proposals`, drawn and scored by what the robot is (`viewpoints.recipe`), as those that a policy
chooses among where candidates are the actions. A far place is driven to if it is worth more than every
viewpoint nearby, along the shortest path by the robot's belief, and the robot decides anew at every stop.
What did not come, and what could not be reached, is remembered: no place and gaze is tried again that brought
nothing, and robots whose bodies block each other part.

What a robot is, and what its mission asks for, decides how it explores:

- Flying robots, and all in 3-D worlds: bits per time, with the recipe of narrow or of wide views.
- Ground robots with a scanner that sees all around, in a plan, until the map has so little entropy: bits per
  time.
- The same robots where everything is to be seen: frontier cells on short tours, by `explorers.shared_tour`,
  with looks into pockets from outside. Bits per time would leave what is small until the end, and drive back
  for it.
- The same robots where a part may stay unseen: bits per time, of unknown voxels alone.
"""

from __future__ import annotations

from dataclasses import asdict, dataclass, fields, replace
from typing import Any

import numpy as np

from entropy_explore_env.missions.view import RobotView
from entropy_explore_env.missions.view_candidates import ViewProposer
from entropy_explore_env.planner.recipe import Recipe, recipe_for
from entropy_explore_env.planner.shared_tour import SharedTour, SharedTourConfig
from entropy_explore_env.scenario import Scenario, with_settings
from entropy_explore_env.settings import RobotKind
from entropy_explore_env.validation import check_count, check_not_negative, check_positive
from entropy_explore_env.viewpoints.evaluation import sees_all_around

_EVERYTHING = 0.995
"""Who is to see such a share of what can be seen has to look into every corner."""


def explores_frontiers(scenario: Scenario, kind: RobotKind) -> bool:
    """Whether robots of a kind go for frontier cells, and not for bits."""
    if not (scenario.grid.flat and kind.robot.motion == "planar" and sees_all_around(kind.sensor)):
        return False
    return scenario.ending.by_seen and _wants_everything(scenario, kind)


def _wants_everything(scenario: Scenario, kind: RobotKind) -> bool:
    """Whether a mission that ends by what is seen leaves no more unseen than a sliver between two rays."""
    ending = scenario.ending
    if ending.seen_share is not None:
        return ending.seen_share >= _EVERYTHING
    unseen = 0 if ending.unseen_free_voxels is None else ending.unseen_free_voxels
    return unseen < kind.sensor.max_range_m / scenario.grid.voxel_size_m


@dataclass(frozen=True)
class PlannedRateConfig:
    """What differs from the recipe of every kind of robot, and from the tours' settings; None = nothing.

    Attributes:
        exponent: As in `viewpoints.recipe.Recipe`.
        behind: Likewise.
        far_places: Likewise.
        leave_below: Likewise.
        dregs: Likewise.
        path_scans: Likewise.
        pocket: As in `explorers.shared_tour.SharedTourConfig`.
        sight: Likewise.

    Raises:
        SettingError: One of them is not allowed.
    """

    exponent: float | None = None
    behind: float | None = None
    far_places: int | None = None
    leave_below: float | None = None
    dregs: float | None = None
    path_scans: int | None = None
    pocket: float | None = None
    sight: float | None = None

    def __post_init__(self) -> None:
        """Check every field."""
        given = [name for name, value in asdict(self).items() if value is not None]
        for name in given:
            if name in ("far_places", "path_scans"):
                check_count(self, name, 0, 100_000)
            elif name == "exponent":
                check_positive(self, name)
            else:
                check_not_negative(self, name)

    def recipe(self, kind: RobotKind) -> Recipe:
        """Of a kind of robot."""
        return replace(recipe_for(kind), **self._given(Recipe))

    def tour(self) -> SharedTourConfig:
        """Of plans of which everything is to be seen."""
        return SharedTourConfig(**self._given(SharedTourConfig))

    def _given(self, settings: type[Recipe] | type[SharedTourConfig]) -> dict[str, Any]:
        """Those of its fields that are also fields of other settings, and not None."""
        known = {field.name for field in fields(settings)}
        return {name: value for name, value in asdict(self).items() if name in known and value is not None}


class PlannedRate:
    """Chooses among candidates nearby and far away by bits / s^c; in some plans among frontier cells."""

    def __init__(self, config: PlannedRateConfig | None = None) -> None:
        """Take what differs from the robots' recipes; None = nothing."""
        self.config = config or PlannedRateConfig()

    def reset(self, scenario: Scenario, rng: np.random.Generator) -> None:
        """A new mission begins."""
        self._frontiers = [explores_frontiers(scenario, kind) for kind in scenario.kinds]
        if any(self._frontiers):
            self._plans = SharedTour(self.config.tour())
            self._plans.reset(scenario, rng)
        if not all(self._frontiers):
            one = with_settings(scenario, {"action": {"kind": "candidates", "candidates": 1}})
            recipes = {number: self.config.recipe(kind) for number, kind in enumerate(scenario.kinds)}
            self._proposer = ViewProposer(one, rng, recipes=recipes)

    def choose(self, view: RobotView) -> np.ndarray:
        """Return the viewpoint (5,) by the robot's own belief and what it has heard."""
        return self._choose(view)

    def _choose(self, view: RobotView) -> np.ndarray:
        if self._frontiers[view.robot % len(self._frontiers)]:
            return self._plans.choose(view)
        return self._proposer.propose(view)[0].copy()

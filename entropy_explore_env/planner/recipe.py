"""How a robot's candidate viewpoints are drawn and scored: by what it is, not by where it explores.

What a candidate is worth is bits / s^c, with s the seconds until its scan is taken. With c = 1 that is a
rate; a larger c favours what is soon done, which pays where little is left behind by doing so. The values
come from missions in worlds of the train split.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from entropy_explore_env.settings import RobotKind
from entropy_explore_env.validation import check, check_count, check_not_negative, check_positive
from entropy_explore_env.viewpoints.evaluation import sees_all_around


@dataclass(frozen=True)
class Recipe:
    """How viewpoints are drawn and scored; K = gazes + turns + places are drawn first.

    Attributes:
        exponent: c of bits / s^c.
        stop_probability: Probability that an unknown voxel stops an imagined ray.
        gap_probability: The same of one beside something believed covered.
        draw_thinning: One in this many columns, and rows, of the sensor's rays is imagined for those drawn.
        thinning: The same where they are refined, and for far places; 1 = exactly the sensor's rays.
        gazes: Drawn around the present gaze, on the spot.
        turns: Drawn on the spot with any gaze.
        places: Drawn within reach with any gaze.
        yaw_spread: Standard deviation of `gazes`, in widths of the field of view.
        pitch_spread: The same in its heights.
        refinements: How often viewpoints are drawn around the best three.
        refined: How many each time.
        far_places: Known free places that are evaluated beyond those within reach.
        far_gazes: Gazes at each.
        waypoint_gazes: Gazes that are evaluated at a stop on the way to one.
        far_below: Far places are looked for where the best viewpoint nearby brings less than this share of
            the most bits ever expected; 1 = whenever one could be worth more.
        keep: A far place, once chosen, is kept unless another is worth this many times as much.
        block_m: Edge of the blocks that far places are taken from.
        dregs: What any scan of known ground still brings, as a share of the most bits ever expected of one:
            bits below that are worth next to nothing, and bits above it so much less.
        leave_below: A robot whose last decision brought fewer bits a second than this share of its mission's
            mean so far chooses by the plain rate, c = 1: what is left where it is holds it no longer (the
            marginal value theorem of Charnov 1976, by which foragers leave a patch).
        behind: How many times its own bits an unknown voxel beside a free one promises, where far places are
            looked for.
        path_scans: Number of scans on the path to a viewpoint that its value includes, under way and at
            stops, spread evenly over the path; 0 = the scan at the viewpoint alone.
    """

    exponent: float
    stop_probability: float
    gap_probability: float
    draw_thinning: int
    thinning: int
    gazes: int
    turns: int
    places: int
    yaw_spread: float = 1.2
    pitch_spread: float = 1.5
    refinements: int = 2
    refined: int = 12
    far_places: int = 24
    far_gazes: int = 1
    waypoint_gazes: int = 1
    far_below: float = 1.0
    keep: float = 1.15
    block_m: float = 1.0
    dregs: float = 0.0
    leave_below: float = 0.0
    behind: float = 4.0
    path_scans: int = 0

    def __post_init__(self) -> None:
        """Check every field."""
        check_positive(self, "exponent", "keep", "block_m")
        check_not_negative(self, "yaw_spread", "pitch_spread", "far_below", "dregs", "leave_below", "behind")
        for name in ("stop_probability", "gap_probability"):
            check(self, name, "a number from 0 to 1", lambda v: 0.0 <= v <= 1.0)
        check_count(self, "draw_thinning", 1, 1000)
        check_count(self, "thinning", 1, 1000)
        for name in ("gazes", "turns", "places", "refinements", "far_places", "path_scans"):
            check_count(self, name, 0, 100_000)
        for name in ("refined", "far_gazes", "waypoint_gazes"):
            check_count(self, name, 1, 100_000)
        check(self, "places", "above 0 where neither gazes nor turns are drawn", self._any_drawn)

    def _any_drawn(self, places: int) -> bool:
        return self.gazes + self.turns + places > 0


ALL_AROUND = Recipe(
    exponent=1.15,
    stop_probability=0.1,
    gap_probability=0.5,
    draw_thinning=1,
    thinning=1,
    gazes=4,
    turns=0,
    places=28,
    behind=64.0,
)
"""Scanners that see all around: where to, not which way to look."""

NARROW_PLANNED = Recipe(
    exponent=1.0,
    stop_probability=0.4,
    gap_probability=0.9,
    draw_thinning=2,
    thinning=1,
    gazes=20,
    turns=20,
    places=40,
    refinements=3,
    refined=20,
    far_gazes=3,
    waypoint_gazes=24,
    block_m=1.6,
    dregs=0.0025,
)
"""Narrow fields of view, on planned paths."""

NARROW_STRAIGHT = Recipe(
    exponent=2.2,
    stop_probability=0.02,
    gap_probability=0.02,
    draw_thinning=2,
    thinning=1,
    gazes=36,
    turns=36,
    places=8,
    refinements=3,
    refined=30,
    far_places=12,
    far_gazes=4,
    far_below=0.1,
    leave_below=0.1,
)
"""Narrow fields of view, straight drives of short reach: nearly all time is turning and scanning."""


def recipe_for(kind: RobotKind) -> Recipe:
    """The recipe of a kind of robot."""
    if sees_all_around(kind.sensor):
        return ALL_AROUND
    return NARROW_PLANNED if kind.robot.navigator == "planned" else NARROW_STRAIGHT


def angular_spread(kind: RobotKind) -> float:
    """Standard deviation in radians by which refined gazes differ, before it shrinks: half a field of view.

    Where a sensor sees all around only the place of its rays between each other matters.
    """
    if sees_all_around(kind.sensor):
        return 0.25 * kind.sensor.angular_step_rad
    return 0.5 * max(*kind.sensor.field_of_view_rad, math.radians(6.0))

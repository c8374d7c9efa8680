"""How many viewpoints a robot draws and how it scores them, by what the robot is.

A viewpoint is worth bits / s^c, with s the seconds until its scan is taken. With c = 1 that is a rate; a
larger c favours what is soon done, which pays where little is left behind by doing so. All values were tuned
on missions in worlds of the train split.
"""

from __future__ import annotations

import math
from typing import NamedTuple

from entropy_explore_env.settings.robot_kind import RobotKind
from entropy_explore_env.settings.scenario import Scenario
from entropy_explore_env.viewpoints.evaluation import cell_edge, sees_all_around


class Recipe(NamedTuple):
    """How viewpoints are drawn and scored."""

    exponent: float  # c of bits / s^c
    stop_probability: float  # probability that an unknown voxel stops an imagined ray
    gap_probability: float  # probability that an unknown voxel beside a covered one stops an imagined ray
    draw_thinning: int
    """One in this many columns, and rows, of the sensor's rays is imagined for viewpoints that are drawn."""
    gazes: int  # viewpoints that are drawn around the present gaze, on the spot
    turns: int  # viewpoints that are drawn on the spot with any gaze
    places: int  # viewpoints that are drawn within reach with any gaze
    refinements: int = 2  # how often viewpoints are drawn around the best ones so far
    refined: int = 12  # viewpoints that are drawn in each refinement
    far_places: int = 24  # known free places that are evaluated beyond those within reach
    far_gazes: int = 1  # gazes that are evaluated at each far place
    waypoint_gazes: int = 1  # gazes that are evaluated at a stop on the way to a far place
    far_below: float = 1.0
    """Far places are looked for where the best viewpoint nearby brings less than this share of the most bits
    ever expected; 1 = whenever one could be worth more."""
    block_m: float = 1.0  # edge of the blocks that far places are taken from, in metres
    known_ground_share: float = 0.0
    """Bits that a scan of known ground still brings, as a share of the most bits ever expected of a scan;
    bits up to that are worth next to nothing, and bits above count without them."""
    thinning: int = 1
    """One in this many columns, and rows, of the sensor's rays is imagined for refined viewpoints, far places
    and views of candidates."""
    leave_below: float = 0.0
    """A robot whose last decision brought fewer bits a second than this share of its mission's mean so far
    chooses by the plain rate, c = 1 (the marginal value theorem of Charnov 1976: foragers leave a patch)."""
    behind: float = 4.0
    """Bits that an unknown voxel beside a free one promises, in multiples of its own, where far places are
    looked for."""


ALL_AROUND = Recipe(
    exponent=1.15,
    stop_probability=0.1,
    gap_probability=0.5,
    draw_thinning=1,
    gazes=4,
    turns=0,
    places=28,
    behind=64.0,
)
"""Scanners that see all around: they choose places, not gazes."""

MANY_RAYS = 2000
"""Number of rays from which scanners that see all around get a recipe that imagines fewer of them."""

NARROW_PLANNED = Recipe(
    exponent=1.0,
    stop_probability=0.4,
    gap_probability=0.9,
    draw_thinning=2,
    gazes=20,
    turns=20,
    places=40,
    refinements=3,
    refined=20,
    far_gazes=3,
    waypoint_gazes=24,
    block_m=1.6,
    known_ground_share=0.0025,
)
"""Narrow fields of view, on planned paths."""

NARROW_STRAIGHT = Recipe(
    exponent=2.2,
    stop_probability=0.02,
    gap_probability=0.02,
    draw_thinning=2,
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


def recipe_for(scenario: Scenario, kind: RobotKind) -> Recipe:
    """Return the recipe of a kind of robot in a scenario.

    Where scanners of many rays look for what was not seen, in grids that are fine for them, one ray in two
    columns and rows tells as much. Elsewhere expected bits are compared with those that a scan brought, so
    that all rays are imagined for refined viewpoints.
    """
    if not sees_all_around(kind.sensor):
        return NARROW_PLANNED if kind.robot.navigator == "planned" else NARROW_STRAIGHT
    if kind.sensor.rays < MANY_RAYS:
        return ALL_AROUND
    if scenario.ending.by_seen and cell_edge(scenario, kind) > 1:
        return ALL_AROUND._replace(draw_thinning=4, thinning=2)
    return ALL_AROUND._replace(draw_thinning=2)


def angular_spread(kind: RobotKind) -> float:
    """Return the standard deviation in radians by which refined gazes differ at first: half a field of view.

    Where a sensor sees all around, only the place of its rays between each other matters.
    """
    if sees_all_around(kind.sensor):
        return 0.25 * kind.sensor.angular_step_rad
    return 0.5 * max(*kind.sensor.field_of_view_rad, math.radians(6.0))

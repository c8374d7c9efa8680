"""The features of candidate viewpoints, and of a robot's situation: names, meanings, scaling; one table.

All lie in [-1, 1]. All but `bits_log`, `seconds` and `time` are ratios, so that they mean the same in any
world, whatever its size, its voxels, its sensor, and whatever the team. What one voxel adds to them is told
with it: a view sees the voxels of which a scan from there should take at least `SEEN_BITS` each. Policies
depend on the order and the meaning of the features: a change of one raises `FEATURES_VERSION`.
"""

from __future__ import annotations

from types import MappingProxyType
from typing import NamedTuple

FEATURES_VERSION = 1
"""Version of this table; a checkpoint holds the one that it was trained with."""
SEEN_BITS = 0.1
"""Expected bits from which on a voxel counts as seen from a viewpoint."""
ANNOUNCED = 3
"""Number of announced views of teammates with which a candidate is compared: those that share most."""


class Feature(NamedTuple):
    """One number of an observation."""

    name: str
    meaning: str
    unit: str = "share"
    least: float = 0.0
    """Its lower bound; the upper one is 1."""


FEATURES: tuple[Feature, ...] = (
    Feature("score", "what the planner holds it to be worth, as a share of its own choice, which has 1"),
    Feature("chosen", "1 for the planner's own choice", "-"),
    Feature("spot", "1 for a gaze from where the robot is", "-"),
    Feature("near", "1 for a place within reach", "-"),
    Feature("far", "1 for the first stop on the way to a far place, of which most features are then", "-"),
    Feature("kept", "1 if the robot is on its way to it already", "-"),
    Feature("bits", "expected bits of a scan there, as a share of the most ever expected of one"),
    Feature("bits_log", "the same bits as log2(1 + bits) / 20", "log2(1 + bits) / 20"),
    Feature("seconds", "seconds s until that scan is taken, as s/(s + 10)", "s/(s + 10)"),
    Feature("soonness", "the fewest seconds of all candidates, as a share of its own"),
    Feature("rate", "bits per second, as a share of the best candidate's"),
    Feature("rate_ever", "bits per second, as a share of the best rate of any candidate so far"),
    Feature("rank", "1 for the candidate that is worth most, 0 for the last"),
    Feature("again", "bits that a second scan there should still bring, as a share of the first one's"),
    Feature("unique", "mean over the voxels seen of 1/n, with n the candidates that see the voxel"),
    Feature("common", "share of the voxels seen that the planner's own choice sees, too"),
    Feature("slivers", "unknown voxels left beside those seen, one voxel thick, per voxel seen, at most 1"),
    Feature("elsewhere", "share of the map's remaining bits that is not in the blocks around it"),
    Feature(
        "advantage", "mean distance to the remaining bits less its path, in workspace diagonals", least=-1.0
    ),
    Feature("unknown", "share of unknown ones among the voxels seen"),
    Feature("depth", "mean distance of the voxels seen, as a share of the longest ray"),
    Feature("directness", "straight distance to it, as a share of the path's length; 1 on the spot"),
    Feature("distance", "straight distance to it, in workspace diagonals"),
    Feature("announced_most", "share of its bits in the announced view that it shares most with"),
    Feature("announced_second", "share of its bits in the one that it shares second most with; 0 without"),
    Feature("announced_third", "share of its bits in the one that it shares third most with; 0 without"),
    Feature(
        "contest",
        "seconds m of the teammate that is there soonest, less its own s, as (m - s)/(m + s); 1 without",
        least=-1.0,
    ),
    Feature("trust", "share of the expected bits that like viewpoints brought; 1 where none was a failure"),
    Feature("ahead", "displacement of the viewpoint along the present gaze's yaw, in reaches", least=-1.0),
    Feature("left", "displacement to the left of it, in reaches", least=-1.0),
    Feature("up", "displacement upwards, in reaches", least=-1.0),
    Feature("turn_cos", "cos of the yaw less the present one", "-", -1.0),
    Feature("turn_sin", "sin of it", "-", -1.0),
    Feature("pitch", "pitch of the gaze, downwards, in π/2 radians", "-", -1.0),
)
"""Features of each candidate, in their order."""

CONTEXT: tuple[Feature, ...] = (
    Feature("entropy", "entropy left in the robot's map: 1 at the start, 0 with all voxels known"),
    Feature("reported", "share of the bits taken from its map that teammates' measurements took"),
    Feature("bits", "most bits of a candidate now, as a share of the most ever"),
    Feature("rate", "best rate of a candidate now, as a share of the best so far"),
    Feature("far", "worth f of the best far place, against that n of the best candidate near, as f/(f + n)"),
    Feature("around", "share of the map's remaining bits in the blocks around the robot"),
    Feature("time", "time gone, seconds s, as s/(s + 300)", "s/(s + 300)"),
    Feature("candidates", "candidates that there are, as a share of the most there can be"),
    Feature("mates", "teammates n, as n/(n + 2)", "n/(n + 2)"),
    Feature("heard", "share of the teammates that were heard and are not silent since"),
    Feature("nearest", "distance of the nearest of those, in workspace diagonals; 1 without"),
    Feature("blocked", "1 while the robot keeps clear of a teammate that was in its way", "-"),
    Feature("failures", "share of the failures that it remembers at most"),
    Feature("under_way", "1 where it decides while it drives on", "-"),
    Feature("planar", "1 for robots that stay in a plane", "-"),
    Feature("all_around", "1 for sensors that see all around", "-"),
    Feature(
        "scan_time",
        "a scan's share of the seconds of a scan, a quarter turn and a drive as far as it reaches",
    ),
)
"""Features of the robot's situation, in their order."""

COLUMNS: MappingProxyType[str, int] = MappingProxyType({f.name: i for i, f in enumerate(FEATURES)})
"""Name → number of a candidate's feature."""
CONTEXT_COLUMNS: MappingProxyType[str, int] = MappingProxyType({f.name: i for i, f in enumerate(CONTEXT)})
"""Name → number of a situation's feature."""

"""The features of candidate viewpoints, and of a robot's situation: names, meanings, scaling; one table.

All lie in [-1, 1]. All but `bits_log`, `seconds` and `time` are ratios, so that they mean the same in any
world, whatever its size, its voxels, its sensor, and whatever the team. What one voxel adds to them is told
with it: a view sees the voxels of which a scan from there should take at least `SEEN_BITS` each. Policies
depend on the order and the meaning of the features: a change of one raises `FEATURES_VERSION`.
"""

from __future__ import annotations

from types import MappingProxyType
from typing import NamedTuple

FEATURES_VERSION = 2
"""Version of this table; a checkpoint holds the one that it was trained with."""
SEEN_BITS = 0.1
"""Expected bits from which on a voxel counts as seen from a viewpoint."""


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
    Feature("far", "1 for the first stop on the way to a far place, of which most features are then", "-"),
    Feature("kept", "1 if the robot is on its way to it already", "-"),
    Feature("bits_log", "expected bits of a scan there, as log2(1 + bits) / 20", "log2(1 + bits) / 20"),
    Feature("seconds", "seconds s until that scan is taken, as s/(s + 10)", "s/(s + 10)"),
    Feature("soonness", "the fewest seconds of all candidates, as a share of its own"),
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
    Feature(
        "contest",
        "seconds m of the teammate that is there soonest, less its own s, as (m - s)/(m + s); 1 without",
        least=-1.0,
    ),
    Feature("turn_cos", "cos of the yaw less the present one", "-", -1.0),
)
"""Features of each candidate, in their order."""

CONTEXT: tuple[Feature, ...] = (
    Feature("entropy", "entropy left in the robot's map: 1 at the start, 0 with all voxels known"),
    Feature("reported", "share of the bits taken from its map that teammates' measurements took"),
    Feature("around", "share of the map's remaining bits in the blocks around the robot"),
    Feature("time", "time gone, seconds s, as s/(s + 300)", "s/(s + 300)"),
    Feature("mates", "teammates n, as n/(n + 2)", "n/(n + 2)"),
    Feature("heard", "share of the teammates that were heard and are not silent since"),
    Feature("under_way", "1 where it decides while it drives on", "-"),
)
"""Features of the robot's situation, in their order."""

COLUMNS: MappingProxyType[str, int] = MappingProxyType({f.name: i for i, f in enumerate(FEATURES)})
"""Name → number of a candidate's feature."""
CONTEXT_COLUMNS: MappingProxyType[str, int] = MappingProxyType({f.name: i for i, f in enumerate(CONTEXT)})
"""Name → number of a situation's feature."""

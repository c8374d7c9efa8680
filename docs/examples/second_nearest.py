"""A rule of one's own: it goes to the second nearest frontier cell, if there are two."""

from entropy_explore_env.frontiers.blocks import NONE


def pick(scene):
    """Return the voxel to go to; NONE = no frontier cell can be reached."""
    voxels, lengths = scene.paths.frontiers_within(float("inf"))  # (K,) each: cells, and how far they are
    nearest = voxels[lengths.argsort(kind="stable")]
    return int(nearest[:2][-1]) if len(nearest) else NONE

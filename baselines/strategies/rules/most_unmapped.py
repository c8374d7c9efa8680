"""Three ways of choosing poses with which Sujan compares `next-best-view` (sect. 3.1).

Of poses drawn in known free space that a known free path reaches, a robot takes

- `random-known`: the first, method (i);
- `most-unmapped`: the one that shows the largest unmapped region, method (iii);
- `least-mapped`: the one that shows the smallest mapped region, method (iv).

Ours, where the paper says nothing: poses are drawn uniformly, a new set at each decision. Where its latest
scan showed no new voxel, a robot takes a random pose by methods (iii) and (iv), too: they would choose the
same one for ever.
"""

from __future__ import annotations

import numpy as np

from baselines.strategies.next_best_view.expected_view import OccupancyMap
from baselines.strategies.next_best_view.poses import DrawnPoses
from entropy_explore_env.planner.scene import Scene


class RandomKnown(DrawnPoses):
    """Goes to a random pose in known free space."""

    rule = "random-known"
    poses = 1

    def worth(self, scene: Scene, known: OccupancyMap, pose: np.ndarray) -> float:
        """Return 0; see `DrawnPoses`."""
        return 0.0


class MostUnmapped(DrawnPoses):
    """Goes to where most unknown voxels are in view."""

    rule = "most-unmapped"
    escapes = True

    def worth(self, scene: Scene, known: OccupancyMap, pose: np.ndarray) -> float:
        """Return the number of unknown voxels in view; see `DrawnPoses`."""
        return float(self.seen.counts[1])


class LeastMapped(DrawnPoses):
    """Goes to where the fewest known voxels are in view."""

    rule = "least-mapped"
    escapes = True

    def worth(self, scene: Scene, known: OccupancyMap, pose: np.ndarray) -> float:
        """Return less the number of known voxels in view; see `DrawnPoses`."""
        return -float(self.seen.counts[0])

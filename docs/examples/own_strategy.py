"""A strategy of one's own: it drives to the nearest voxel that it knows nothing about, and looks there."""

import numpy as np

from baselines.strategies.protocol import random_viewpoint


class NearestUnknown:
    """Any class with `reset` and `choose` is a strategy; it is made without arguments."""

    def reset(self, scenario, rng):
        """Begin a mission: its public settings, and a generator for the strategy's own draws."""
        self._unknown = 1.1 * scenario.sigma_prior**-2  # 1/σ² of a voxel that was hardly ever measured
        self._rng = rng

    def choose(self, view):
        """Return a viewpoint (x, y, z, yaw, pitch) for a robot that decides, in metres and radians."""
        grid, here = view.scenario.grid, view.pose[:3]
        unknown = np.argwhere(view.precision < self._unknown)  # view.mean and view.precision: (X, Y, Z)
        if view.move_end.name not in ("ARRIVED", "SEEN", "UNDER_WAY") or len(unknown) == 0:
            return random_viewpoint(view, self._rng)  # something was in the way, or all is known
        apart = grid.centre_of(unknown) - here
        nearest = apart[np.argmin((apart**2).sum(axis=1))]
        step = nearest * min(1.0, view.kind.robot.reach_m / max(np.linalg.norm(nearest), 1e-9))
        yaw = np.arctan2(nearest[1], nearest[0])
        return np.array([*(here + step), yaw, 0.0])

"""Localization once more, slowly: an extended Kalman filter in matrices (Sujan, eqs. 14-16) and eqs. 19-21.

The state is (x, y, z, yaw) of a robot; a landmark whose place is known is seen at R(-yaw) (m - p) from it.
"""

from __future__ import annotations

import math

import numpy as np


def turned(yaw):
    """Rotation about the vertical axis."""
    c, s = math.cos(yaw), math.sin(yaw)
    return np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])


def measured(state, landmark):
    """h(x) of eq. 14, without noise."""
    return turned(-state[3]) @ (np.asarray(landmark) - state[:3])


def jacobian(state, landmark, step=1e-6):
    """H of eq. 15, by central differences."""
    columns = []
    for number in range(4):
        ahead, behind = state.copy(), state.copy()
        ahead[number] += step
        behind[number] -= step
        columns.append((measured(ahead, landmark) - measured(behind, landmark)) / (2.0 * step))
    return np.stack(columns, axis=1)


def sighting_noise(seen, range_sigma, bearing_sigma, expected_m):
    """R of eq. 16: variance along the line of sight, and at right angles to it at the larger distance."""
    along = np.outer(seen, seen) / (seen @ seen)
    distance = max(np.linalg.norm(seen), expected_m)
    return range_sigma**2 * along + (distance * bearing_sigma) ** 2 * (np.eye(3) - along)


def corrected(state, covariance, landmark, seen, noise):
    """Eq. 16: the state and the covariance after a sighting (3,) of this noise (3, 3)."""
    h = jacobian(state, landmark)
    gain = covariance @ h.T @ np.linalg.inv(h @ covariance @ h.T + noise)
    return state + gain @ (seen - measured(state, landmark)), (np.eye(4) - gain @ h) @ covariance


def predicted(state, covariance, moved, turn, variances):
    """The state and the covariance after a motion `moved` (3,), in the robot's frame, and a turn."""
    ahead = turned(state[3]) @ np.asarray(moved)
    carry = np.eye(4)
    carry[:3, 3] = [-ahead[1], ahead[0], 0.0]
    after = state + np.array([*ahead, turn])
    return after, carry @ covariance @ carry.T + np.diag(variances)


def point_covariance(covariance, yaw, seen):
    """Covariance (3, 3) of a point seen at `seen` (3,) in the robot's frame, by eq. 20's rotation.

    In the robot's frame an error of the yaw moves the point by the lever arm; the place's own covariance is
    rotated into that frame, and the sum back into the map's.
    """
    rotation = turned(yaw)
    into = np.zeros((4, 4))
    into[:3, :3], into[3, 3] = rotation.T, 1.0
    own = into @ covariance @ into.T
    lever = np.zeros((3, 4))
    lever[:, :3] = np.eye(3)
    lever[:, 3] = [-seen[1], seen[0], 0.0]
    return rotation @ (lever @ own @ lever.T) @ rotation.T


def merged(one, other):
    """Eq. 21: the covariance of a point that two measurements say something of."""
    return one @ (np.eye(len(one)) - np.linalg.inv(one + other) @ one)

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


def foreseen(covariance, pose, path, viewpoint, every_m, since_m, variances, landmarks, sees, noise):
    """Σ at the end of a drive: piece by piece from scan to scan, matrices alone (eq. 23's LE is made of it).

    Args:
        covariance: (4, 4).
        pose: (5,).
        path: (N, 3) points.
        viewpoint: (5,).
        every_m: Metres between scans under way.
        since_m: Driven since the latest scan.
        variances: Of x and y, z, yaw a metre, and of yaw a radian.
        landmarks: (F, 3).
        sees: place, landmark → whether a scan there sights it.
        noise: Standard deviations of sightings: along, and of the direction.
    """
    points, scans, walked, due = [np.asarray(pose[:3], float)], [], 0.0, every_m - since_m
    for end in np.asarray(path, float):
        leg = np.linalg.norm(end - points[-1])
        while due < walked + leg - 1e-12:
            scans.append((points[-1] + (end - points[-1]) * (due - walked) / leg, due))
            due += every_m
        walked += leg
        points.append(end)
    scans.append((points[-1], walked))
    turn = abs(math.remainder(viewpoint[3] - pose[3], 2.0 * math.pi))
    at, done = points[0], 0.0
    for place, metres in scans:
        carry = np.eye(4)
        carry[0, 3], carry[1, 3] = -(place - at)[1], (place - at)[0]
        xy, z, yaw = (variance * (metres - done) for variance in variances[:3])
        yaw += variances[3] * (turn if done == 0.0 else 0.0)
        covariance = carry @ covariance @ carry.T + np.diag([xy, xy, z, yaw])
        for landmark in landmarks:
            away = np.asarray(landmark, float) - place
            if sees(place, landmark):
                state = np.array([*place, viewpoint[3]])
                r = turned(-viewpoint[3])
                seen_noise = r @ sighting_noise(away, *noise, np.linalg.norm(away)) @ r.T
                _, covariance = corrected(state, covariance, landmark, measured(state, landmark), seen_noise)
        at, done = place, metres
    return covariance


def clone_corrected(covariance, before, moved, believed, seen_from, seen, expected, noise):
    """Σ and the estimate's step by a landmark of the own map: eq. 16 with the pose of then as more state.

    The state is (e, e₀), the errors of the pose now and when the landmark was chosen. Without corrections in
    between e = F e₀ + w. The landmark lies where e₀ put it, so that the sighting says H e - G e₀ + noise.

    Args:
        covariance: (4, 4), Σ now.
        before: (4, 4), Σ₀.
        moved: (2,), from where it believed to be then to where it does now.
        believed: (3,), where it believes the landmark to be.
        seen_from: (3,), where it believed to be then.
        seen: (3,), measured.
        expected: (3,), from where it believes to be to where it believes the landmark to be.
        noise: (3, 3).

    Returns:
        (Σ', step): what the filter takes from the estimate.
    """
    carry = np.eye(4)
    carry[0, 3], carry[1, 3] = -moved[1], moved[0]
    joint = np.block([[covariance, carry @ before], [before @ carry.T, before]])

    def lever(away):
        h = np.zeros((3, 4))
        h[:, :3] = np.eye(3)
        h[:, 3] = [-away[1], away[0], 0.0]
        return h

    h = np.hstack([lever(expected), -lever(np.asarray(believed) - seen_from)])
    gain = joint @ h.T @ np.linalg.inv(h @ joint @ h.T + noise)
    after = (np.eye(8) - gain @ h) @ joint
    return after[:4, :4], (gain @ (np.asarray(seen) - expected))[:4]


def sight_frame(seen):
    """(3, 3): unit vectors along a line of sight, sideways and up, as rows."""
    ahead = np.asarray(seen) / np.linalg.norm(seen)
    side = np.cross([0.0, 0.0, 1.0], ahead)
    side /= np.linalg.norm(side)
    return np.stack([ahead, side, np.cross(ahead, side)])


def landmark_score(mean, precision, prior, voxel, occupancy):
    """Eq. 17 without visual contrast, voxel by voxel; `occupancy` is P(c > ½) of a mean and a precision."""
    known = precision > prior
    p = np.array([occupancy(m, q) for m, q in zip(mean.ravel(), precision.ravel(), strict=True)]).reshape(
        mean.shape
    )
    if not known[voxel] or p[voxel] <= 0.5:
        return 0.0
    apart = np.max([abs(axis - at) for axis, at in zip(np.indices(mean.shape), voxel, strict=True)], axis=0)
    certain = np.where(known, abs(2.0 * p - 1.0), 0.0)
    free = known & (p < 0.5)
    shells = [certain[apart == shell].mean() for shell in range(4) if (apart == shell).any()]
    radius = 1
    for shell in range(1, len(shells)):
        if shells[shell] >= shells[shell - 1]:
            break
        radius = shell
    contrasts = [
        abs(2.0 * free[apart <= shell].mean() - 1.0) if free[apart <= shell].any() else 0.0
        for shell in (1, 2, 3)
    ]
    window, contrast = 0, 0.0
    for shell, here in enumerate(contrasts, 1):
        if here < contrast:
            break
        window, contrast = shell, here
    return p[voxel] / radius + contrast * window / 3

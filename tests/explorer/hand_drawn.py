"""A plan drawn by hand, and what a scanner sees of it."""

from __future__ import annotations

import math

import numpy as np

EDGE_M = 0.1
START = np.array([1.0, 1.0, 0.3, 0.0, 0.0])


def plan_by_hand():
    """12 × 8 m: three rooms around a corner, with doors of 1 m."""
    solid = np.ones((120, 80), bool)
    solid[2:118, 2:78] = False
    solid[40, 2:60] = solid[80, 20:78] = solid[40:80, 40] = True
    solid[56:66, 40] = False
    return solid


def look(solid, seen, pose, range_m=8.0):
    """Fill in percents of what is in line of sight of a pose, by small steps along many rays."""
    for angle in np.linspace(0.0, 2.0 * math.pi, 720, endpoint=False):
        for step in np.arange(0.0, range_m, 0.4 * EDGE_M):
            x, y = pose[0] + step * math.cos(angle), pose[1] + step * math.sin(angle)
            at = int(x / EDGE_M), int(y / EDGE_M)
            seen[at] = 100 if solid[at] else 0
            if solid[at]:
                break

"""How robots that drift back off: no blocked drive is tried again at once, and no robot stands for good.

A robot that is wrong about its place has a wrong map, too: a path that it takes for free may lead along a
wall, and what it measures there weighs less than what it measured before. So it may believe in a free path
for ever, or for ever expect a scan to bring what it does not bring. Robots that know where they are need none
of this.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from entropy_explore_env.frontiers.knowledge import RobotKnowledge, random_viewpoint
from entropy_explore_env.scenario import Scenario

_SAME_EDGES = 1.5
"""Places nearer than this, in voxel edges, are the same."""
_STANDS = 15
"""Decisions at the same place after which a robot goes elsewhere: one for each direction of a narrow view."""
_DRAWS = 16
"""Directions drawn at most until one leads away from where the robot was blocked."""
_BACK_EDGES = 2.0, 6.0
"""Shortest and longest way back, in voxel edges: a far goal would lead through the same first corner."""
_MOST_AWAY = 4
"""Most decisions for which a robot backs off after a blocked drive."""


@dataclass
class _Trail:
    """What is kept of a robot from one decision to the next."""

    aim: np.ndarray | None = None
    """(3,) where it meant to go at its latest decision."""
    blocked_aim: np.ndarray | None = None
    """(3,) where it meant to go when it was blocked last."""
    blocked: int = 0
    """Number of drives in a row that were blocked."""
    away: int = 0
    """Decisions for which it still backs off."""
    stood_at: np.ndarray = field(default_factory=lambda: np.full(3, np.inf))
    stands: int = 0
    """Number of decisions in a row near `stood_at`."""


class BackOff:
    """Replaces viewpoints of robots that drift and are blocked, or do not move.

    A drive that was blocked is not tried again: where the robot chooses the same place once more, or was
    blocked twice in a row, it drives a few voxels in a random direction that leads away from there, once more
    with each further block. A robot that stayed at the same place for many decisions goes to a random
    viewpoint.
    """

    def __init__(self, scenario: Scenario, rng: np.random.Generator) -> None:
        """Begin a mission; the draws are those of a stream of its own."""
        self._edge_m = scenario.grid.voxel_size_m
        self._trails = [_Trail() for _ in range(scenario.robots)]
        (self._rng,) = rng.spawn(1)

    def mended(self, view: RobotKnowledge, viewpoint: np.ndarray) -> np.ndarray:
        """Return the viewpoint (5,) that was chosen, or another one."""
        trail = self._trails[view.robot]
        if view.under_way or not view.covariance.any():
            trail.aim = viewpoint[:3].copy()
            return viewpoint
        self._note(view, trail)
        again = trail.blocked_aim is not None and self._near(viewpoint[:3], trail.blocked_aim)
        if trail.away > 0 or (trail.blocked > 0 and again):
            trail.away = max(trail.away - 1, 0)
            viewpoint = self._back(view, trail)
        elif trail.stands >= _STANDS:
            trail.stands = 0
            viewpoint = random_viewpoint(view, self._rng)
        trail.aim = viewpoint[:3].copy()
        return viewpoint

    def _note(self, view: RobotKnowledge, trail: _Trail) -> None:
        """Learn from how the latest drive ended, and where."""
        if view.move_end.blocked and trail.aim is not None:
            trail.blocked += 1
            trail.blocked_aim = trail.aim
            if trail.blocked >= 2:
                trail.away = min(trail.blocked - 1, _MOST_AWAY)
        else:
            trail.blocked = 0
        if self._near(view.pose[:3], trail.stood_at):
            trail.stands += 1
        else:
            trail.stood_at, trail.stands = view.pose[:3].copy(), 0

    def _near(self, place: np.ndarray, other: np.ndarray) -> bool:
        return bool(np.linalg.norm(place - other) < _SAME_EDGES * self._edge_m)

    def _back(self, view: RobotKnowledge, trail: _Trail) -> np.ndarray:
        """Return a viewpoint (5,) a few voxels off, away from where the robot was blocked, with any gaze."""
        viewpoint = random_viewpoint(view, self._rng)
        grid, here = view.scenario.grid, view.pose[:3]
        ahead = np.zeros(3) if trail.blocked_aim is None else trail.blocked_aim - here
        axes = 2 if view.planar else 3
        for _ in range(_DRAWS):
            step = np.zeros(3)
            step[:axes] = self._rng.normal(size=axes)
            if float(ahead @ step) <= 0.0:
                break
        far_m = min(self._rng.uniform(*_BACK_EDGES) * self._edge_m, view.kind.robot.reach_m)
        low = np.asarray(grid.origin_m)
        place = here + far_m * step / max(float(np.linalg.norm(step)), 1e-9)
        viewpoint[:axes] = np.clip(place, low, low + grid.size_m)[:axes]
        return viewpoint

"""What robots that drift do whatever their strategy: no drive that was blocked twice, and no standing still.

Where a robot is wrong about its place its map is, too: a way that it takes for free may lead along a wall,
and what it measures there again weighs less than what it measured before, as its pose is less certain now. So
it may believe in a free way for ever, or for ever expect a scan to bring what it does not bring. Ours:

- A drive that something solid ended, or for which no path was known, is not tried again. Where the strategy
  wants to go there once more, or the robot was blocked twice in a row, it backs off: a few voxels in a random
  direction that leads away from where it meant to go. With each further block in a row it backs off once more
  before it goes on.
- A robot that stayed within a voxel's edge or two of the same place for so many decisions in a row goes to a
  random viewpoint within its reach.

Robots that know where they are keep to their strategy.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from baselines.strategies.protocol import Strategy, random_viewpoint
from entropy_explore_env.missions.view import RobotView
from entropy_explore_env.robots.motion import MoveEnd
from entropy_explore_env.scenario import Scenario

_BLOCKED = (
    MoveEnd.OBSTACLE,
    MoveEnd.WALL,
    MoveEnd.GROUND,
    MoveEnd.CEILING,
    MoveEnd.EDGE,
    MoveEnd.NO_PATH,
)
_SAME_EDGES = 1.5
"""Voxel edges: places so near count as the same."""
_STANDS = 15
"""Decisions on the same spot after which a robot goes elsewhere; one in each direction of a narrow view."""
_DRAWS = 16
_BACK_EDGES = 2.0, 6.0
"""How far a robot backs off, voxel edges: far goals would lead it through the same first corner."""
_MOST_AWAY = 4
"""Most decisions for which a robot backs off after a block."""


@dataclass
class _Trail:
    """What is kept of a robot from one decision to the next."""

    aim: np.ndarray | None = None
    """(3,) where it meant to go at its latest decision."""
    blocked_aim: np.ndarray | None = None
    """(3,) where it meant to go when it was blocked last."""
    blocked: int = 0
    """Drives in a row that something solid ended."""
    away: int = 0
    """Decisions for which it still backs off."""
    stood_at: np.ndarray = field(default_factory=lambda: np.full(3, np.inf))
    stands: int = 0
    """Decisions in a row near `stood_at`."""


class DriftGuard:
    """Lets a strategy choose, but for robots that drift and are blocked, or do not get on."""

    def __init__(self, strategy: Strategy) -> None:
        """Of a strategy."""
        self._strategy = strategy

    def reset(self, scenario: Scenario, rng: np.random.Generator) -> None:
        """A new mission begins; the strategy draws as it does alone."""
        self._edge_m = scenario.grid.voxel_size_m
        self._trails = [_Trail() for _ in range(scenario.robots)]
        self._strategy.reset(scenario, rng)
        (self._rng,) = rng.spawn(1)

    def choose(self, views: Sequence[RobotView]) -> list[np.ndarray]:
        """What the strategy chooses, but for robots that it does not get on with."""
        chosen = list(self._strategy.choose(views))
        return [self._mended(view, viewpoint) for view, viewpoint in zip(views, chosen, strict=True)]

    def _mended(self, view: RobotView, viewpoint: np.ndarray) -> np.ndarray:
        """The viewpoint (5,) that was chosen, or another one."""
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

    def _note(self, view: RobotView, trail: _Trail) -> None:
        """Learn from how the latest drive ended, and where."""
        if view.move_end in _BLOCKED and trail.aim is not None:
            trail.blocked += 1
            trail.blocked_aim = trail.aim
            if trail.blocked >= 2:
                trail.away = min(trail.blocked - 1, _MOST_AWAY)
        else:
            trail.blocked = 0
        if np.linalg.norm(view.pose[:3] - trail.stood_at) < _SAME_EDGES * self._edge_m:
            trail.stands += 1
        else:
            trail.stood_at, trail.stands = view.pose[:3].copy(), 0

    def _near(self, place: np.ndarray, other: np.ndarray) -> bool:
        return bool(np.linalg.norm(place - other) < _SAME_EDGES * self._edge_m)

    def _back(self, view: RobotView, trail: _Trail) -> np.ndarray:
        """A viewpoint (5,) a few voxels away, not towards where the robot was blocked, with any gaze."""
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

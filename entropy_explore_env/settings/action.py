"""How a viewpoint is written as an action."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

from entropy_explore_env.settings.validation import check_count, check_fields

MAX_CANDIDATES = 64
"""Most viewpoints that are proposed to a robot: 64 bits of a number note which of them see a voxel."""


@dataclass(frozen=True)
class Action:
    """How a viewpoint is written as an action.

    Attributes:
        kind: `continuous`, a Box(-1, 1); `discrete`, moves by whole voxels × gaze directions; or
            `candidates`, the number of one of the viewpoints that a planner proposes to the robot.
        moves: Discrete moves: `all` voxels within reach, or `axes`, to stay and the farthest voxel each way
            along each axis: 7 moves, 5 for planar robots.
        yaws: Discrete gazes around the horizon.
        pitches: Discrete gazes up and down, from -π/4 to π/4; planar robots have one, level.
        candidates: Largest number K of proposed viewpoints, 1 to 64; the first is the planner's own choice.
    """

    kind: Literal["continuous", "discrete", "candidates"] = "continuous"
    moves: Literal["all", "axes"] = "all"
    yaws: int = 16
    pitches: int = 3
    candidates: int = 24

    def __post_init__(self) -> None:
        """Check every field."""
        check_fields(self)
        check_count(self, "yaws", 1, 360)
        check_count(self, "pitches", 1, 90)
        check_count(self, "candidates", 1, MAX_CANDIDATES)

    @property
    def by_number(self) -> bool:
        """Whether an action is a whole number."""
        return self.kind != "continuous"

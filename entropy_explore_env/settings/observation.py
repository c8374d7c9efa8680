"""What robots observe."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

from entropy_explore_env.errors import SettingError
from entropy_explore_env.settings.validation import check_count, check_counts, check_fields

MOST_PREDICTED = 111
"""Most cells of a prediction along an axis: a crop of the network has 128, and its place is not quite in the
middle."""


@dataclass(frozen=True)
class Observation:
    """Which parts an observation has; a part that is left out costs nothing.

    Attributes:
        panorama: Utility and free distance of rays around the robot, by its own belief.
        panorama_yaws: Directions around the horizon; None = 16, in 2-D worlds 32.
        panorama_pitches: Directions up and down, from -π/4 to π/4; planar robots have one.
        panorama_utility: `bits`, or `log2` for log2(1 + bits), which suits networks.
        self_state: The robot's pose, time, remaining entropy and whether it decides (part `self`).
        drive: The robot's speed and the viewpoint that it chose last, for those that decide under way.
        team: Where teammates were last heard, and what they announced.
        patch: The belief around the robot.
        patch_shape: Voxels of the patch along x, y and z; odd, the robot in the middle.
        overview: The whole belief, pooled.
        overview_shape: Cells of the pooled belief along x, y and z, at most the world's.
        prediction: What a network predicts where the robot has measured nothing, in horizontal cells of 0.2 m
            around it. It was trained in plans; robots that fly observe the band of heights about them.
        prediction_shape: Cells of the prediction along x and y; odd, the robot in the middle one.
        candidates: With candidates as actions, the features of each (part `candidates`) and of all of them
            (part `context`).
        overlaps: With candidates as actions, the share of what one sees that another sees.
        action_mask: With actions by number, the mask as a part of the observation.
        flat: Whether the observation is one Box of all parts, in the order of this list.
        while_busy: Whether robots that cannot choose observe, too; if not, they observe zeros until they
            decide or the mission is over.
    """

    panorama: bool = True
    panorama_yaws: int | None = None
    panorama_pitches: int = 3
    panorama_utility: Literal["bits", "log2"] = "bits"
    self_state: bool = True
    drive: bool = False
    team: bool = True
    patch: bool = False
    patch_shape: tuple[int, int, int] = (11, 11, 5)
    overview: bool = False
    overview_shape: tuple[int, int, int] = (8, 8, 4)
    prediction: bool = False
    prediction_shape: tuple[int, int] = (65, 65)
    candidates: bool = True
    overlaps: bool = False
    action_mask: bool = False
    flat: bool = False
    while_busy: bool = True

    def __post_init__(self) -> None:
        """Check every field."""
        check_fields(self)
        if self.panorama_yaws is not None:
            check_count(self, "panorama_yaws", 1, 360)
        check_count(self, "panorama_pitches", 1, 90)
        check_counts(self, "patch_shape", 1, 255)
        if not all(n % 2 for n in self.patch_shape):
            raise SettingError("Observation.patch_shape", self.patch_shape, "odd numbers only")
        check_counts(self, "overview_shape", 1, 64)
        check_counts(self, "prediction_shape", 1, MOST_PREDICTED, ("x", "y"))
        if not all(n % 2 for n in self.prediction_shape):
            raise SettingError("Observation.prediction_shape", self.prediction_shape, "odd numbers only")

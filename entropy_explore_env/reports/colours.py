"""Colours of mission pictures: robots, entropy, coverage, and the page that they are drawn on."""

from __future__ import annotations

import numpy as np

Colour = tuple[int, int, int]
"""Red, green, blue, each from 0 to 255."""

ROBOT_COLOURS: tuple[Colour, ...] = (
    (230, 159, 0),
    (86, 180, 233),
    (0, 158, 115),
    (213, 94, 0),
    (204, 121, 167),
    (0, 114, 178),
    (240, 228, 66),
    (153, 153, 153),
)
"""A palette that is safe for colour-blind readers (Okabe & Ito 2008); it repeats from robot 8 on."""

PAPER: Colour = (255, 255, 255)
INK: Colour = (40, 40, 40)
FAINT: Colour = (205, 205, 205)
"""Of the page, of text and outlines, of grid lines."""

UNKNOWN_COLOUR: Colour = (205, 190, 160)
"""Of unknown voxels in maps of coverage."""

_ENTROPY_ANCHORS = (
    (0, 0, 4), (12, 8, 38), (36, 12, 79), (66, 10, 104), (93, 18, 110), (120, 28, 109), (147, 38, 103),
    (174, 48, 92), (199, 62, 76), (221, 81, 58), (237, 105, 37), (248, 133, 15), (252, 165, 10),
    (250, 198, 45), (242, 230, 97), (252, 255, 164),
)  # fmt: skip
"""Inferno (van der Walt & Smith 2015, CC0): perceptually uniform from known (dark) to unknown."""

_COVERAGE_ANCHORS = ((250, 250, 250), (20, 20, 28))

UNKNOWN_LEVEL = 255
"""Level of unknown cells in maps of coverage; levels 0 to 254 are coverage 0 to 1."""


def colour_ramp(anchors: tuple[Colour, ...], levels: int) -> np.ndarray:
    """Return (levels, 3) uint8, colours interpolated between equally spaced anchors."""
    wanted, given = np.linspace(0, 1, levels), np.linspace(0, 1, len(anchors))
    channels = [np.interp(wanted, given, channel) for channel in np.array(anchors, dtype=np.float64).T]
    return np.stack(channels, axis=1).round().astype(np.uint8)


COLOURS: dict[str, np.ndarray] = {
    "entropy": colour_ramp(_ENTROPY_ANCHORS, 256),
    "coverage": np.vstack([colour_ramp(_COVERAGE_ANCHORS, 255), np.array([UNKNOWN_COLOUR], np.uint8)]),
}
"""Quantity → (256, 3) uint8, the colour of each level."""


def robot_colour(robot: int) -> Colour:
    """Return the colour of the robot with this index, in every panel."""
    return ROBOT_COLOURS[robot % len(ROBOT_COLOURS)]

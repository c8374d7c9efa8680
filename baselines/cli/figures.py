"""What figures share: the colours of robots, matplotlib's settings, the bytes of a PNG."""

from __future__ import annotations

import io
from typing import Any

from matplotlib.figure import Figure
from PIL import Image

from entropy_explore_env.reports.colours import robot_colour

COLOURS = tuple(tuple(level / 255 for level in robot_colour(robot)) for robot in range(8))
"""Of the robots, as in every other picture; colour-blind people can tell them apart."""


STYLE: Any = {"font.size": 9, "axes.spines.top": False, "axes.spines.right": False}
"""Of all figures: matplotlib's settings."""


DOTS_PER_INCH = 110
_PALETTE = 256
"""Colours of a PNG: files are a third as large, and look the same."""


def png(figure: Figure) -> bytes:
    """Return the figure as a PNG file, the same bytes for the same figure."""
    drawn = io.BytesIO()
    figure.savefig(drawn, format="png", dpi=DOTS_PER_INCH, metadata={"Software": None})
    return packed_png(Image.open(drawn))


def packed_png(picture: Image.Image) -> bytes:
    """Return a picture as a PNG file of few colours."""
    packed = io.BytesIO()
    few = picture.convert("RGB").quantize(_PALETTE, dither=Image.Dither.NONE)
    few.save(packed, format="png", optimize=True)
    return packed.getvalue()

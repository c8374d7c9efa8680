"""What pictures are made of: a bitmap font, marks, lines, colours and the keys to them; in pixels.

A point is (x, y), x to the right, y down; a picture is (H, W, 3) uint8, rows first.
"""

from __future__ import annotations

import unicodedata
from dataclasses import dataclass
from functools import lru_cache

import numpy as np

Colour = tuple[int, int, int]
"""Red, green, blue, each from 0 to 255."""

GLYPH_HEIGHT = 9
"""Rows of a glyph of the font: 7 from the top of a capital to the base line, 2 below it."""

LINE_HEIGHT = 12
"""From one line of text to the next, in pixels of the font."""

_GAP = 1
"""Empty columns between two glyphs."""

_SPACE_WIDTH = 3

_MISSING = "☐"
"""Stands for a character that the font does not have."""

_ART = r"""
A     B     C     D     E     F     G     H     I   J     K     L     M     N     O     P     Q     R
.###. ####. .###. ####. ##### ##### .###. #...# ### ..### #...# #.... #...# #...# .###. ####. .###. ####.
#...# #...# #...# #...# #.... #.... #...# #...# .#. ...#. #..#. #.... ##.## #...# #...# #...# #...# #...#
#...# #...# #.... #...# #.... #.... #.... #...# .#. ...#. #.#.. #.... #.#.# ##..# #...# #...# #...# #...#
##### ####. #.... #...# ####. ####. #.### ##### .#. ...#. ##... #.... #.#.# #.#.# #...# ####. #...# ####.
#...# #...# #.... #...# #.... #.... #...# #...# .#. ...#. #.#.. #.... #...# #..## #...# #.... #.#.# #.#..
#...# #...# #...# #...# #.... #.... #...# #...# .#. #..#. #..#. #.... #...# #...# #...# #.... #..#. #..#.
#...# ####. .###. ####. ##### #.... .#### #...# ### .##.. #...# ##### #...# #...# .###. #.... .##.# #...#

S     T     U     V     W     X     Y     Z     0     1     2     3     4     5     6     7     8     9
.#### ##### #...# #...# #...# #...# #...# ##### .###. ..#.. .###. .###. ...#. ##### ..##. ##### .###. .###.
#.... ..#.. #...# #...# #...# #...# #...# ....# #...# .##.. #...# #...# ..##. #.... .#... ....# #...# #...#
#.... ..#.. #...# #...# #...# .#.#. .#.#. ...#. #..## ..#.. ....# ....# .#.#. ####. #.... ...#. #...# #...#
.###. ..#.. #...# #...# #.#.# ..#.. ..#.. ..#.. #.#.# ..#.. ..##. ..##. #..#. ....# ####. ..#.. .###. .####
....# ..#.. #...# .#.#. #.#.# .#.#. ..#.. .#... ##..# ..#.. .#... ....# ##### ....# #...# ..#.. #...# ....#
....# ..#.. #...# .#.#. ##.## #...# ..#.. #.... #...# ..#.. #.... #...# ...#. #...# #...# ..#.. #...# ...#.
####. ..#.. .###. ..#.. #...# #...# ..#.. ##### .###. .###. ##### .###. ...#. .###. .###. ..#.. .###. .##..

a     b     c    d     e     f    g     h     i j   k    l  m     n     o     p     q     r    s
..... #.... .... ....# ..... ..## ..... #.... # ..# #... #. ..... ..... ..... ..... ..... .... ....
..... #.... .... ....# ..... .#.. ..... #.... . ... #... #. ..... ..... ..... ..... ..... .... ....
.###. ####. .### .#### .###. #### .#### #.##. # ..# #..# #. ##.#. #.##. .###. ####. .#### #.## .###
....# #...# #... #...# #...# .#.. #...# ##..# # ..# #.#. #. #.#.# ##..# #...# #...# #...# ##.. #...
.#### #...# #... #...# ##### .#.. #...# #...# # ..# ##.. #. #.#.# #...# #...# #...# #...# #... .##.
#...# #...# #... #...# #.... .#.. #...# #...# # ..# #.#. #. #.#.# #...# #...# #...# #...# #... ...#
.#### ####. .### .#### .###. .#.. .#### #...# # ..# #..# .# #.#.# #...# .###. ####. .#### #... ###.
..... ..... .... ..... ..... .... ....# ..... . #.# .... .. ..... ..... ..... #.... ....# .... ....
..... ..... .... ..... ..... .... .###. ..... . .#. .... .. ..... ..... ..... #.... ....# .... ....

t    u     v     w     x     y     z    . ,  : ;  ! ?     ' "   `  +     -    *     /     =     _
.#.. ..... ..... ..... ..... ..... .... . .. . .. # .###. # #.# #. ..... .... ..... ....# ..... .....
.#.. ..... ..... ..... ..... ..... .... . .. . .. # #...# # #.# .# ..... .... ..#.. ....# ..... .....
#### #...# #...# #...# #...# #...# #### . .. . .. # ....# . ... .. ..#.. .... #.#.# ...#. ..... .....
.#.. #...# #...# #...# .#.#. #...# ...# . .. # .# # ..##. . ... .. ..#.. .... .###. ..#.. ##### .....
.#.. #...# .#.#. #.#.# ..#.. #...# .##. . .. . .. # ..#.. . ... .. ##### #### #.#.# .#... ..... .....
.#.. #..## .#.#. #.#.# .#.#. #...# #... . .. . .. . ..... . ... .. ..#.. .... ..#.. #.... ##### .....
..## .##.# ..#.. .#.#. #...# .#### #### # .# # .# # ..#.. . ... .. ..#.. .... ..... #.... ..... .....
.... ..... ..... ..... ..... ....# .... . .# . .# . ..... . ... .. ..... .... ..... ..... ..... #####
.... ..... ..... ..... ..... .###. .... . #. . #. . ..... . ... .. ..... .... ..... ..... ..... .....

<    >    (   )   [   ]   {    }    | \     ^     ~     #     $     %     &     @     °    · ×     –     …
...# #... ..# #.. ### ### ..## ##.. # #.... ..#.. ..... .#.#. ..#.. ##..# .##.. .###. .##. . ..... ..... .....
..#. .#.. .#. .#. #.. ..# .#.. ..#. # #.... .#.#. ..... .#.#. .#### ##..# #..#. #...# #..# . ..... ..... .....
.#.. ..#. #.. ..# #.. ..# .#.. ..#. # .#... #...# ..... ##### #.#.. ...#. #.#.. #.### #..# . #...# ..... .....
#... ...# #.. ..# #.. ..# #... ...# # ..#.. ..... .#..# .#.#. .###. ..#.. .#... #.#.# .##. . .#.#. ..... .....
.#.. ..#. #.. ..# #.. ..# .#.. ..#. # ...#. ..... #.#.# ##### ..#.# .#... #.#.# #.### .... # ..#.. ##### .....
..#. .#.. .#. .#. #.. ..# .#.. ..#. # ....# ..... #..#. .#.#. ####. #..## #..#. #.... .... . .#.#. ..... .....
...# #... ..# #.. ### ### ..## ##.. # ....# ..... ..... .#.#. ..#.. #..## .##.# .#### .... . #...# ..... #.#.#
.... .... ... ... ... ... .... .... # ..... ..... ..... ..... ..... ..... ..... ..... .... . ..... ..... .....
.... .... ... ... ... ... .... .... # ..... ..... ..... ..... ..... ..... ..... ..... .... . ..... ..... .....

²   ³   µ     σ     α     ξ    ≥    ≤    →     ☐
##. ##. ..... ..... ..... ###. #... ..#. ..... #####
..# ..# ..... ..... ..... #... .#.. .#.. ..... #...#
.#. .#. #...# .#### .##.# .##. ..#. #... ...#. #...#
#.. ..# #...# #..#. #..#. #... .#.. .#.. ##### #...#
### ##. #...# #...# #..#. .##. #... ..#. ...#. #...#
... ... #..## #...# #..#. #... .... .... ..... #...#
... ... ###.# .###. .##.# .##. #### #### ..... #####
... ... #.... ..... ..... ...# .... .... ..... .....
... ... #.... ..... ..... .##. .... .... ..... .....
"""


def _glyphs() -> dict[str, np.ndarray]:
    """Character → (GLYPH_HEIGHT, width) bool, read off the drawings above."""
    glyphs = {" ": np.zeros((GLYPH_HEIGHT, _SPACE_WIDTH), dtype=np.bool_)}
    for block in _ART.strip("\n").split("\n\n"):
        characters, *rows = (line.split() for line in block.splitlines())
        for column, character in enumerate(characters):
            drawn = np.array([[pixel == "#" for pixel in row[column]] for row in rows])
            glyphs[character] = np.pad(drawn, [(0, GLYPH_HEIGHT - len(rows)), (0, 0)])
    return glyphs


_GLYPHS = _glyphs()


def _glyph(character: str) -> np.ndarray:
    """The character's drawing; without its accent, or a box, where the font lacks it."""
    plain = unicodedata.normalize("NFKD", character)[0] if character not in _GLYPHS else character
    return _GLYPHS.get(plain, _GLYPHS[_MISSING])


def text_width(text: str, scale: int = 1) -> int:
    """Width of one line of text in pixels."""
    return scale * max(0, sum(_glyph(character).shape[1] + _GAP for character in text) - _GAP)


@lru_cache(maxsize=1024)
def text_mask(text: str, scale: int = 1) -> np.ndarray:
    """One line of text as a picture.

    Args:
        text: What to write.
        scale: Pixels of the picture along a pixel of the font.

    Returns:
        (GLYPH_HEIGHT * scale, text_width) bool, read-only; whether a pixel is ink.
    """
    gap = np.zeros((GLYPH_HEIGHT, _GAP), dtype=np.bool_)
    columns = [part for character in text for part in (_glyph(character), gap)][:-1]
    line = np.concatenate(columns, axis=1) if columns else np.zeros((GLYPH_HEIGHT, 0), dtype=np.bool_)
    mask = line.repeat(scale, axis=0).repeat(scale, axis=1)
    mask.setflags(write=False)
    return mask


@lru_cache(maxsize=1024)
def shortened(text: str, width: int, scale: int = 1) -> str:
    """The text, or as much of it as fits into `width` pixels, with … at its end."""
    if text_width(text, scale) <= width:
        return text
    kept = text
    while kept and text_width(kept + "…", scale) > width:
        kept = kept[:-1]
    return kept.rstrip() + "…"


def write(image: np.ndarray, text: str, left: int, top: int, colour: Colour, scale: int = 1) -> None:
    """Write one line of text into a picture; what lies outside it is cut off.

    Args:
        image: (H, W, 3) uint8, changed in place.
        text: What to write.
        left: Column of the first glyph's left edge.
        top: Row of a capital's upper edge.
        colour: Of the ink.
        scale: Pixels of the picture along a pixel of the font.
    """
    mask = text_mask(text, scale)
    y, x = max(top, 0), max(left, 0)
    target = image[y : max(top + mask.shape[0], 0), x : max(left + mask.shape[1], 0)]
    seen = mask[y - top :, x - left :][: target.shape[0], : target.shape[1]]
    target[seen] = colour


@lru_cache(maxsize=256)
def disc(radius: float, hole: float = -1.0) -> np.ndarray:
    """Pixels (K, 2) int64 of a disc around (0, 0), or of a ring where `hole`, its inner radius, is ≥ 0."""
    reach = int(radius)
    offsets = np.mgrid[-reach : reach + 1, -reach : reach + 1].reshape(2, -1).T
    distances = np.hypot(offsets[:, 0], offsets[:, 1])
    return offsets[(distances <= radius) & (distances > hole)]


@lru_cache(maxsize=64)
def square(width: int) -> np.ndarray:
    """Pixels (width², 2) int64 of a square around (0, 0): the nib of a line."""
    return np.mgrid[:width, :width].reshape(2, -1).T - (width - 1) // 2


@lru_cache(maxsize=256)
def _outlined(offsets: bytes) -> np.ndarray:
    nib = np.frombuffer(offsets, dtype=np.int64).reshape(-1, 2)
    around = (nib[:, None, :] + square(3)[None, :, :]).reshape(-1, 2)
    return np.unique(around, axis=0)


def line_pixels(points: np.ndarray) -> np.ndarray:
    """Pixels along a polyline, without gaps; all its segments at once.

    Args:
        points: (N, 2) float64, x and y of the corners in pixels; rows that are not finite are left out.

    Returns:
        (M, 2) int64, x and y.
    """
    points = points[np.isfinite(points).all(axis=1)]
    if len(points) < 2:
        return np.floor(points).astype(np.int64)
    steps = np.diff(points, axis=0)
    counts = np.ceil(np.abs(steps).max(axis=1)).astype(np.int64) + 1
    segment = np.repeat(np.arange(len(counts)), counts)
    nth = np.arange(counts.sum()) - np.repeat(np.cumsum(counts) - counts, counts)
    share = nth / np.maximum(counts - 1, 1)[segment]
    return np.floor(points[segment] + steps[segment] * share[:, None]).astype(np.int64)


def paint(window: np.ndarray, pixels: np.ndarray, nib: np.ndarray, colour: Colour) -> None:
    """Stamp a nib onto each of the pixels; what lies outside the window is cut off.

    Args:
        window: (H, W, 3) uint8, a picture or a part of it; changed in place.
        pixels: (M, 2) int64, x and y in the window.
        nib: (K, 2) int64, the stamp around (0, 0).
        colour: Of the stamp.
    """
    x, y = (pixels[:, None, :] + nib[None, :, :]).reshape(-1, 2).T
    inside = (x >= 0) & (x < window.shape[1]) & (y >= 0) & (y < window.shape[0])
    window[y[inside], x[inside]] = colour


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
"""Told apart by colour-blind eyes, too (Okabe & Ito 2008); robot 8 looks like robot 0 again."""

UNKNOWN_COLOUR: Colour = (205, 190, 160)
"""Of coverage that nobody knows yet."""

PAPER, INK, FAINT = (255, 255, 255), (40, 40, 40), (205, 205, 205)

_ENTROPY_ANCHORS = (
    (0, 0, 4), (12, 8, 38), (36, 12, 79), (66, 10, 104), (93, 18, 110), (120, 28, 109), (147, 38, 103),
    (174, 48, 92), (199, 62, 76), (221, 81, 58), (237, 105, 37), (248, 133, 15), (252, 165, 10),
    (250, 198, 45), (242, 230, 97), (252, 255, 164),
)  # fmt: skip
"""Inferno (van der Walt & Smith 2015, CC0): perceptually uniform from known (dark) to unknown."""

_COVERAGE_ANCHORS = ((250, 250, 250), (20, 20, 28))

UNKNOWN_LEVEL = 255
"""Of the coverage colours; levels 0 to 254 are coverage 0 to 1."""


def _between(anchors: tuple[Colour, ...], levels: int) -> np.ndarray:
    """(levels, 3) uint8, colours interpolated between equally spaced anchors."""
    wanted, given = np.linspace(0, 1, levels), np.linspace(0, 1, len(anchors))
    channels = [np.interp(wanted, given, channel) for channel in np.array(anchors, dtype=np.float64).T]
    return np.stack(channels, axis=1).round().astype(np.uint8)


COLOURS: dict[str, np.ndarray] = {
    "entropy": _between(_ENTROPY_ANCHORS, 256),
    "coverage": np.vstack([_between(_COVERAGE_ANCHORS, 255), np.array([UNKNOWN_COLOUR], np.uint8)]),
}
"""Quantity → (256, 3) uint8, the colour of each level."""


@dataclass(frozen=True)
class Box:
    """A rectangle of the picture, in pixels."""

    left: int
    top: int
    width: int
    height: int

    def of(self, image: np.ndarray) -> np.ndarray:
        """This part of an (H, W, 3) picture, not a copy."""
        return image[self.top : self.top + self.height, self.left : self.left + self.width]

    def grown(self, margin: int) -> Box:
        """The rectangle with a margin on every side."""
        return Box(self.left - margin, self.top - margin, self.width + 2 * margin, self.height + 2 * margin)


def robot_colour(robot: int) -> Colour:
    """The colour of the robot with this index, in every panel."""
    return ROBOT_COLOURS[robot % len(ROBOT_COLOURS)]


def stamp(canvas: np.ndarray, pixels: np.ndarray, nib: np.ndarray, colour: Colour) -> None:
    """Paint with a thin dark edge, so that it stands out on any ground."""
    paint(canvas, pixels, _outlined(nib.tobytes()), INK)
    paint(canvas, pixels, nib, colour)


def draw_key(paper: np.ndarray, quantity: str, view: Box, unit: int, pixels_per_m: float | None) -> None:
    """What the colours below a map mean; with `pixels_per_m`, the length of some metres, too."""
    x, y = view.left, view.top + view.height + 5 * unit
    ends = ("0 %", "100 %") if quantity == "entropy" else ("free", "occupied")
    write(paper, ends[0], x, y, INK, unit)
    bar = Box(x + text_width(ends[0], unit) + 4 * unit, y, 60 * unit, 7 * unit)
    levels = np.arange(bar.width) * (255 if quantity == "entropy" else 254) // (bar.width - 1)
    bar.grown(1).of(paper)[:] = INK
    bar.of(paper)[:] = COLOURS[quantity][levels]
    x = bar.left + bar.width + 4 * unit
    write(paper, ends[1], x, y, INK, unit)
    x += text_width(ends[1], unit) + 10 * unit
    if quantity == "coverage":
        swatch = Box(x, y, 7 * unit, 7 * unit)
        swatch.grown(1).of(paper)[:] = INK
        swatch.of(paper)[:] = UNKNOWN_COLOUR
        write(paper, "unknown", x + 11 * unit, y, INK, unit)
    if pixels_per_m is not None:
        length_m = _round_length(45 * unit / pixels_per_m)
        end = x + round(length_m * pixels_per_m)
        Box(x, y + 3 * unit, end - x, unit).of(paper)[:] = INK
        for tick in (x, end - unit):
            Box(tick, y + unit, unit, 5 * unit).of(paper)[:] = INK
        write(paper, f"{length_m:g} m", end + 4 * unit, y, INK, unit)


def _round_length(most: float) -> float:
    """The longest of …, 0.5, 1, 2, 5, 10, … that is not above `most`."""
    decade = 10.0 ** np.floor(np.log10(most))
    return float(max(step * decade for step in (1, 2, 5) if step * decade <= most * (1 + 1e-9)))


def legend_rows(robots: int) -> int:
    """Lines of the legend that name robots."""
    return (min(robots, len(ROBOT_COLOURS)) + 1) // 2


def draw_legend(paper: np.ndarray, box: Box, robots: int, unit: int) -> None:
    """Which colour is which robot, two a row, and what the ring means."""
    shown = min(robots, len(ROBOT_COLOURS))
    for robot in range(shown):
        left, top = box.left + robot % 2 * box.width // 2, box.top + robot // 2 * LINE_HEIGHT * unit
        centre = np.array([[left + 4 * unit, top + 3 * unit]])
        stamp(paper, centre, disc(4.0 * unit), robot_colour(robot))
        more = ", …" if robot + shown < robots else ""
        write(paper, f"robot {robot}{more}", left + 13 * unit, top, INK, unit)
    top = box.top + legend_rows(robots) * LINE_HEIGHT * unit
    centre = np.array([[box.left + 4 * unit, top + 3 * unit]])
    paint(paper, centre, disc(4.0 * unit, 2.5 * unit), INK)
    write(paper, "chosen viewpoint", box.left + 13 * unit, top, INK, unit)


def draw_axes(paper: np.ndarray, box: Box, unit: int) -> None:
    """Axes of the entropy curves: share from 0 to 100 % over time."""
    write(paper, "entropy left", box.left, box.top - LINE_HEIGHT * unit, INK, unit)
    for percent in (0, 50, 100):
        y = box.top + round((1 - percent / 100) * (box.height - unit))
        Box(box.left, y, box.width, unit).of(paper)[:] = INK if percent == 0 else FAINT
        label = f"{percent} %"
        write(paper, label, box.left - 4 * unit - text_width(label, unit), y - 3 * unit, INK, unit)
    Box(box.left, box.top, unit, box.height).of(paper)[:] = INK
    write(paper, "0", box.left, box.top + box.height + 4 * unit, INK, unit)

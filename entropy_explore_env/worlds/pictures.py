"""Pictures of worlds: walls dark, free space light, unknown space blue, metres along the edges.

Solid voxels that give no return are red. Where robots may start is green.

Unknown is what a world's file says nothing of: to robots it is solid. Margins that hold no free space, and no
wall that the file knows of, are cut off.

A plan is drawn as it is. A 3-D world is drawn from above and from the side. Where the sky is open (terrain,
furniture), the view from above shows the height of the highest solid voxel of each column, and the side view
how much is solid along y; in worlds with a roof both show how much of the line of sight is free. All are
drawn with matplotlib.
"""

from __future__ import annotations

import io
import math
from typing import NamedTuple

import numpy as np
from scipy import ndimage

from entropy_explore_env.errors import imported
from entropy_explore_env.settings.grid import Grid
from entropy_explore_env.worlds.world import World, box_around, part_of

_DOTS = 100.0
"""An inch."""
_LONG_SIDE, _LEAST_SIDE, _LEAST_WIDTH = 8.8, 0.6, 4.8
"""Of a view, of the height of a side view and of the picture; _AROUND is the room for ticks and titles."""
_AROUND = 0.75
_TICK = 0.9
"""Width of a tick's label with many digits."""
_LONGEST_NAME = 40
_ROOFED = 0.5
"""Above this share of columns that are solid at the top, a world counts as roofed."""
_SOLID, _FREE = (58, 64, 77), (236, 239, 243)
_UNKNOWN, _UNREADABLE = (176, 200, 226), (190, 74, 72)
_START = (160, 205, 150)
_KEY = (
    (_SOLID, "wall"),
    (_FREE, "free"),
    (_UNKNOWN, "unknown"),
    (_UNREADABLE, "no return"),
    (_START, "may start"),
)
_HEIGHT_COLOURS = (
    (38, 70, 83),
    (42, 157, 143),
    (138, 177, 125),
    (233, 196, 106),
    (244, 162, 97),
    (250, 244, 232),
)
"""From the lowest ground to the highest."""
_FREE_COLOURS = (_SOLID, (120, 132, 150), (190, 200, 212), _FREE)
"""From no free space along the line of sight to nothing else."""


class _View(NamedTuple):
    """A world seen along one axis."""

    title: str
    pixels: np.ndarray
    """(rows, columns, 3) uint8, a pixel a voxel; y or z upwards."""
    stretch: int = 1
    """By how much heights are exaggerated."""


def picture(world: World, starts: np.ndarray | None = None) -> bytes:
    """Return a PNG of a world.

    Args:
        world: The world.
        starts: (X, Y, Z) bool, where robots may start, which the plan or the view from above shows; None =
            not.

    Raises:
        MissingExtraError: matplotlib is not installed.
    """
    figures = imported("matplotlib.figure", "matplotlib", "baselines")
    from matplotlib.patches import Patch

    title, box = _title(world), box_around(_seen(world))
    world = part_of(world, box)
    views, (across, *upwards) = _views(world), world.grid.size_m
    if starts is not None:
        views[0] = _with_starts(views[0], starts[box])
    scale = _LONG_SIDE / max(across, upwards[0])  # inches a metre, of all views
    heights = [scale * height * view.stretch for height, view in zip(upwards, views, strict=False)]
    size = max(_LEAST_WIDTH, scale * across + _AROUND), sum(heights) + _AROUND * (1 + len(views))
    figure = figures.Figure(figsize=size, dpi=_DOTS, layout="constrained")
    axes = figure.subplots(len(views), 1, squeeze=False, height_ratios=heights)[:, 0]
    x_m, *others_m = world.grid.origin_m
    for ax, view, low_m, height_m in zip(axes, views, others_m, upwards, strict=False):
        extent = (x_m, x_m + across, low_m, low_m + height_m)
        sharp = scale * _DOTS * world.grid.voxel_size_m >= 1.0
        ax.imshow(view.pixels, extent=extent, interpolation="nearest" if sharp else "auto")
        ax.set_aspect(view.stretch)
        ax.set_title(view.title, loc="left", fontsize=9)
        ax.set_xlabel("m", loc="right")
        ax.ticklabel_format(useOffset=False, style="plain")  # UTM coordinates keep all their digits
        ax.locator_params(axis="x", nbins=max(1, min(9, int(scale * across / _TICK))), min_n_ticks=1)
    figure.suptitle(title, x=0.02, ha="left", fontsize=11)
    shown = [
        world.unknown is not None,
        any((view.pixels == _UNREADABLE).all(axis=-1).any() for view in views),
    ]
    if any(shown) or starts is not None:
        walls = [world.grid.flat or any(shown)] * 2
        key = zip(_KEY, [*walls, *shown, starts is not None], strict=True)
        patches = [
            Patch(facecolor="#{:02x}{:02x}{:02x}".format(*colour), edgecolor="0.3", label=name)
            for (colour, name), is_shown in key
            if is_shown
        ]
        figure.legend(handles=patches, loc="outside lower right", ncols=len(patches), fontsize=9)
    buffer = io.BytesIO()
    figure.savefig(buffer, format="png")
    return buffer.getvalue()


def _seen(world: World) -> np.ndarray:
    """Return (X, Y, Z) bool, what holds something to be seen: free space, what is around it, known walls."""
    seen = np.asarray(ndimage.binary_dilation(~world.occupied, np.ones((3, 3, 3))), np.bool_)
    return seen if world.unknown is None else seen | (world.occupied & ~world.unknown)


def _with_starts(view: _View, starts: np.ndarray) -> _View:
    """Return a view from above with the columns tinted in which robots may start."""
    columns = _upright(np.atleast_3d(np.any(starts, axis=2)))
    tinted = (0.5 * view.pixels + 0.5 * np.array(_START)).astype(np.uint8)
    return view._replace(pixels=np.where(columns, tinted, view.pixels))


def _title(world: World) -> str:
    """Name and size; a long name is cut off."""
    grid, name = world.grid, world.name
    shown = name if len(name) <= _LONGEST_NAME else name[:_LONGEST_NAME] + "…"
    size = " x ".join(_metres(edge) for edge in grid.size_m[: 2 if grid.flat else 3])
    return f"{shown}   {size} m, voxels of {_metres(grid.voxel_size_m)} m"


def _views(world: World) -> list[_View]:
    """Return a plan, or a 3-D world from above and from the side."""
    solid, z = world.occupied, world.grid.origin_m[2]
    if world.grid.flat:
        plan = np.where(solid[:, :, 0, None], _SOLID, _FREE).astype(np.uint8)
        if world.unknown is not None:
            plan[world.unknown[:, :, 0]] = _UNKNOWN
        if world.unreadable is not None:
            plan[world.unreadable[:, :, 0]] = _UNREADABLE
        return [_View("plan", _upright(plan))]
    if world.unknown is not None:
        return _views_of_known(world)
    layers = solid.shape[2]
    tops = layers - np.argmax(solid[:, :, ::-1], axis=2)
    tops[~solid.any(axis=2)] = 0
    free_along_y = (~solid).mean(axis=1)
    if float((tops == layers).mean()) > _ROOFED:
        above = _coloured((~solid).mean(axis=2), _FREE_COLOURS)
        title = "from above: how much is free, dark = none"
        side, side_title = np.sqrt(free_along_y), "from the side, along y: how much is free, dark = none"
    else:
        low_m, high_m = (float(top) * world.grid.voxel_size_m + z for top in (tops.min(), tops.max()))
        above = _coloured((tops - tops.min()) / max(1, int(np.ptp(tops))), _HEIGHT_COLOURS)
        title = f"from above: top of what is solid, {_metres(low_m)} m (dark) to {_metres(high_m)} m (light)"
        if world.unreadable is not None:
            highest = np.maximum(tops - 1, 0)[:, :, None]
            above[np.take_along_axis(world.unreadable, highest, axis=2)[:, :, 0]] = _UNREADABLE
        side = np.where(free_along_y < 1.0, 0.7 - 0.7 * np.sqrt(1.0 - free_along_y), 1.0)
        side_title = "from the side, along y: how much is solid, white = nothing"
    stretch = _stretch(world.grid)
    if stretch > 1:
        side_title += f", heights {stretch} times as large"
    return [
        _View(title, _upright(above)),
        _View(side_title, _upright(_coloured(side, _FREE_COLOURS)), stretch),
    ]


def _views_of_known(world: World) -> list[_View]:
    """Return views of a world that is partly unknown: how much of the known line of sight is free."""
    assert world.unknown is not None
    pictures = []
    for axis in (2, 1):
        known = (~world.unknown).mean(axis=axis)
        free = (~world.occupied).mean(axis=axis) / np.maximum(known, 1e-9)
        weight = np.minimum(2.0 * known, 1.0)[..., None]  # a line half of which is known counts as known
        shades = weight * _coloured(free, _FREE_COLOURS) + (1.0 - weight) * np.array(_UNKNOWN)
        pictures.append(_upright(shades.astype(np.uint8)))
    stretch = _stretch(world.grid)
    side_title = "from the side, along y" + (f", heights {stretch} times as large" if stretch > 1 else "")
    title = "from above: how much of what is known is free, dark = none"
    return [_View(title, pictures[0]), _View(side_title, pictures[1], stretch)]


def _metres(value: float) -> str:
    """Return a length with at most four digits, three below a metre; whole metres from 1000 m on."""
    if 0 < abs(value) < 1:
        return f"{value:.3g}"
    return f"{value:.4g}" if abs(value) < 1000 else f"{value:.0f}"


def _stretch(grid: Grid) -> int:
    """Return the factor by which a side view is drawn higher."""
    height = grid.size_m[2] * _LONG_SIDE / grid.size_m[:2].max()
    return 1 if height >= _LEAST_SIDE else math.ceil(_LEAST_SIDE / height)


def _upright(pixels: np.ndarray) -> np.ndarray:
    """Return (rows, columns, 3) of (X, Y, 3): x to the right, y up."""
    return np.ascontiguousarray(pixels.swapaxes(0, 1)[::-1])


def _coloured(shares: np.ndarray, colours: tuple[tuple[int, int, int], ...]) -> np.ndarray:
    """Return (X, Y, 3) uint8: shares in [0, 1], interpolated between equally spaced colours."""
    at = np.linspace(0.0, 1.0, len(colours))
    table = np.asarray(colours, np.float64)
    return np.stack([np.interp(shares, at, table[:, c]) for c in range(3)], axis=-1).astype(np.uint8)

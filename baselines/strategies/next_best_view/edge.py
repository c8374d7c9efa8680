"""The edge of the plateau that a rover stands on, as a closed polygon (Sujan, sect. 2.2, figs. 8-9).

Of a completed elevation map: a height threshold around the rover's own height, region growing from the
rover, closing (dilation and erosion), the outer border, so that holes do not count, and a polygon that is
split where it lies farther from the border than the diameter of a wheel. With scikit-image.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from scipy import ndimage
from skimage.draw import polygon2mask
from skimage.measure import approximate_polygon, find_contours
from skimage.morphology import isotropic_closing
from skimage.segmentation import flood


class Edge(NamedTuple):
    """The plateau of a rover and its edge; places in columns, (0, 0) the lower corner of the first."""

    plateau: np.ndarray
    """(X, Y) bool, the surface that the rover touches, closed."""
    border: np.ndarray
    """(N, 2) float64, its outer border, the last point the first: halfway between columns in and out."""
    polygon: np.ndarray
    """(M, 2) float64 corners, some of the border's points, the last one the first."""


def find_edge(
    height: np.ndarray, here: tuple[int, int], threshold: float, closing: float, tolerance: float
) -> Edge:
    """Return the edge of the plateau that a rover stands on.

    Args:
        height: (X, Y) completed heights.
        here: The rover's column; inside the grid.
        threshold: Columns whose height differs by more than this from the rover's are no part of it; in the
            unit of the heights.
        closing: Radius of the disc of the closing, in columns.
        tolerance: Most that the border is away from the polygon, in columns.
    """
    alike = np.abs(height - height[here]) <= threshold
    grown = flood(alike, here, connectivity=1)
    plateau = np.asarray(isotropic_closing(grown, closing), bool) if closing > 0.0 else grown
    whole = np.pad(np.asarray(ndimage.binary_fill_holes(plateau)), 1)
    contours = find_contours(whole.astype(np.float64), 0.5)
    border = max(contours, key=len) - 0.5  # of the padded grid's middles: one column on, half a column back
    return Edge(plateau, border, approximate_polygon(border, tolerance))


def inside_polygon(polygon: np.ndarray, shape: tuple[int, int]) -> np.ndarray:
    """Return (X, Y) bool, which columns have their middle in a polygon (M, 2) in columns."""
    return np.asarray(polygon2mask(shape, polygon - 0.5), bool)


def behind_line(edge: Edge, here: tuple[int, int]) -> np.ndarray:
    """Return (X, Y) bool, which columns lie on the rover's side of the straight line that fits the edge best.

    The line is fitted by total least squares to the border where the workspace does not end; all columns
    where there is no such border.
    """
    shape = edge.plateau.shape
    within = ((edge.border > 0.75) & (edge.border < np.array(shape) - 0.75)).all(axis=1)
    points = edge.border[within]
    if len(points) < 2:
        return np.ones(shape, bool)
    middle = points.mean(axis=0)
    across = np.linalg.svd(points - middle, full_matrices=False)[2][1]
    x, y = np.indices(shape) + 0.5
    side = (x - middle[0]) * across[0] + (y - middle[1]) * across[1]
    return side >= 0.0 if side[here] >= 0.0 else side <= 0.0

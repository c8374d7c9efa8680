"""The edge of a plateau: its polygon and its straight line."""

from __future__ import annotations

import itertools

import numpy as np
import pytest
from scipy import ndimage

from baselines.strategies.next_best_view.edge import behind_line, find_edge, inside_polygon
from entropy_explore_env.settings.scenarios import CLIFF
from entropy_explore_env.worlds.load import make_world


def distances_to(polygon, points):
    """Distance of (N, 2) points to the nearest side of a closed polygon."""
    nearest = np.full(len(points), np.inf)
    for a, b in itertools.pairwise(polygon):
        share = np.clip(((points - a) @ (b - a)) / ((b - a) @ (b - a)), 0.0, 1.0)
        nearest = np.minimum(nearest, np.linalg.norm(points - a - share[:, None] * (b - a), axis=1))
    return nearest


@pytest.mark.parametrize("tolerance", [0.6, 1.6, 4.0])
def test_the_polygon_is_as_near_to_the_edge_as_a_wheel_and_coarser_for_larger_wheels(tolerance):
    """Figs. 8-9, on worlds with the rocks of the Viking sites."""
    corners = []
    for number in range(4):
        height = make_world(CLIFF, number).occupied.sum(axis=2).astype(float)
        edge = find_edge(height, (20, 40), 1.6, 1.6, tolerance)
        plateau = height == 24.0
        assert (edge.plateau[plateau]).all()
        assert (edge.plateau & ~plateau).sum() <= 30  # what the closing closes
        assert distances_to(edge.polygon, edge.border).max() <= tolerance + 1e-9
        np.testing.assert_array_equal(edge.polygon[0], edge.polygon[-1])
        apart = ndimage.distance_transform_edt(plateau) + ndimage.distance_transform_edt(~plateau)
        wrong = inside_polygon(edge.polygon, plateau.shape) != plateau
        assert apart[wrong].max() <= tolerance + 2.5
        corners.append(len(edge.polygon))
    assert np.mean(corners) > 7 if tolerance < 2.0 else np.mean(corners) >= 5


def test_rocks_on_the_plateau_are_no_holes_and_another_plateau_is_not_the_rover_s():
    height = np.zeros((17, 23))
    height[:7], height[11:] = 5.0, 5.0
    height[3, 9] = 9.0
    edge = find_edge(height, (1, 1), 1.0, 0.0, 0.4)
    assert not edge.plateau[3, 9] and not edge.plateau[11:].any()
    assert edge.border.min() == pytest.approx(0.0) and edge.border[:, 0].max() == pytest.approx(7.0)
    assert inside_polygon(edge.polygon, (17, 23)).sum() >= 7 * 23 - 4  # a contour cuts its corners
    assert inside_polygon(edge.polygon, (17, 23))[3, 9]
    far = find_edge(height, (14, 3), 1.0, 0.0, 0.4)
    assert far.plateau[11:].all() and not far.plateau[:11].any()


def test_the_border_is_the_outer_one_however_jagged_a_pit_is():
    height = np.full((30, 30), 5.0)
    height[8:22, 8:27:2] = height[8, 8:27] = 0.0
    edge = find_edge(height, (2, 2), 1.0, 0.0, 0.4)
    assert inside_polygon(edge.polygon, (30, 30)).sum() >= 30 * 30 - 4 and not edge.plateau[8, 8:27].any()


def test_the_straight_edge_is_the_line_that_fits_the_border_within_the_workspace():
    height = np.where(np.add.outer(2.0 * np.arange(17), np.arange(23)) < 25, 5.0, 0.0)
    side = behind_line(find_edge(height, (1, 1), 1.0, 0.0, 0.4), (1, 1))
    assert (side != (height > 0.0)).mean() < 0.05 and side[0, 0] and not side[-1, -1]
    assert behind_line(find_edge(np.zeros((5, 7)), (1, 1), 1.0, 0.0, 0.4), (1, 1)).all()

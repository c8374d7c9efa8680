"""Random viewpoints lie within reach and inside; some parts of them stay what they were."""

from __future__ import annotations

import math

import numpy as np
import pytest

from entropy_explore_env.settings import Grid, Robot
from entropy_explore_env.viewpoints.drawing import (
    draw_gazes,
    draw_places,
    surroundings,
    vary_gazes,
    vary_places,
)

GRID = Grid((7, 11, 5), 0.5)


@pytest.mark.parametrize("planar", [False, True])
def test_places_fill_the_ball_within_reach(planar):
    within = surroundings(GRID, Robot(reach_m=1.0), planar)
    assert (within.axes, within.reach) == (2 if planar else 3, 2.0)
    here = np.array([3.5, 5.5, 2.5, 0.0, 0.0])
    drawn = draw_places(here, 2000, within, np.random.default_rng(0)) - here[: within.axes]
    apart = np.linalg.norm(drawn, axis=1)
    assert apart.max() <= 2.0 and (apart > 1.0).mean() == pytest.approx(1 - 0.5**within.axes, abs=0.04)
    assert np.abs(drawn.mean(axis=0)).max() < 0.1
    corner = draw_places(np.full(5, 0.5), 500, within, np.random.default_rng(0))
    assert corner.min() == 0.5


def test_surroundings_end_at_a_quarter_of_the_workspace():
    assert surroundings(GRID, Robot(reach_m=math.inf), False).reach == 0.25 * 11


def test_gazes_go_everywhere_and_planar_ones_stay_level():
    here = np.array([1.0, 2.0, 3.0, 0.4, 0.1])
    drawn = draw_gazes(here, 2000, False, np.random.default_rng(0))
    assert (drawn[:, :3] == here[:3]).all()
    assert np.sin(drawn[:, 4]).std() == pytest.approx(1 / math.sqrt(3), abs=0.02)  # uniform on the sphere
    assert np.abs(drawn[:, 3]).max() <= math.pi and drawn[:, 3].std() == pytest.approx(1.81, abs=0.05)
    assert (draw_gazes(here, 9, True, np.random.default_rng(0))[:, 4] == 0.0).all()


def test_varied_viewpoints_stay_within_reach_and_turns_on_the_spot_on_it():
    within = surroundings(GRID, Robot(reach_m=1.0), False)
    here = np.array([3.5, 5.5, 2.5, 0.0, 0.0])
    viewpoints = np.tile(here, (400, 1))
    viewpoints[200:, 0] += 1.0
    vary_places(viewpoints, here, within, np.random.default_rng(0))
    assert (viewpoints[:200, :3] == here[:3]).all()
    apart = np.linalg.norm(viewpoints[200:, :3] - here[:3], axis=1)
    assert apart.max() <= 2.0 + 1e-9 and viewpoints[200:, 0].std() == pytest.approx(0.5, abs=0.12)
    vary_gazes(viewpoints, 3.0, False, np.random.default_rng(0))
    assert np.abs(viewpoints[:, 3]).max() <= math.pi and np.abs(viewpoints[:, 4]).max() <= math.pi / 2
    level = np.tile(here, (9, 1))
    vary_gazes(level, 3.0, True, np.random.default_rng(0))
    assert (level[:, 4] == 0.0).all() and level[:, 3].std() > 0.0

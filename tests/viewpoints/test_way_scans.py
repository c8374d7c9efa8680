"""Scans on the way to a viewpoint: where they are, by hand, and what all of them bring, ray by ray."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from entropy_explore_env.belief.fields import Belief
from entropy_explore_env.belief.paths.lattice import belief_costs, new_lattice
from entropy_explore_env.belief.paths.planning import search_paths
from entropy_explore_env.belief.paths.search import new_search
from entropy_explore_env.belief.raycast import longest_crossing
from entropy_explore_env.belief.visibility import CONE
from entropy_explore_env.scenario import with_settings
from entropy_explore_env.scenarios import BOX
from entropy_explore_env.viewpoints.evaluation import robot_model
from entropy_explore_env.viewpoints.expected_scan import new_scan_scratch
from entropy_explore_env.viewpoints.imagined_scan import imagine_scan, imagined_bits
from entropy_explore_env.viewpoints.travel import STRAIGHTENED
from entropy_explore_env.viewpoints.way_scans import fill_way_scans, planned_path, way_bits
from tests.reference.scenes import drawn, seeds

SIZE = (7, 11, 5)
NOWHERE = np.zeros(0, np.int32)


def way_of(here, at, every, since, most, path=NOWHERE, layer=None):
    places = np.zeros((most, 5))
    lattice = new_lattice(SIZE, 0.0, layer)
    here, at = np.array(here, float), np.array(at, float)
    return places[: fill_way_scans(lattice, SIZE, path, len(path), here, at, every, since, places)]


def test_on_a_straight_drive_by_hand():
    """Eight edges along y, a scan every two: after 2, 4 and 6, the one at 8 is that at the viewpoint."""
    here, at = (3.5, 1.5, 2.5, 0.3, 0.1), (3.5, 9.5, 2.5, 1.2, -0.4)
    places = way_of(here, at, 2.0, 0.0, 9)
    assert places[:, 1].tolist() == pytest.approx([3.5, 5.5, 7.5])
    assert (places[:, [0, 2, 3, 4]] == [3.5, 2.5, 1.2, -0.4]).all()
    assert way_of(here, at, 2.0, 1.5, 9)[:, 1].tolist() == pytest.approx([2.0, 4.0, 6.0, 8.0])
    assert way_of(here, at, 2.0, 0.0, 2)[:, 1].tolist() == pytest.approx([5.5, 7.5])  # of three: 2nd, 3rd
    assert way_of(here, at, 2.0, 0.0, 1)[:, 1].tolist() == pytest.approx([7.5])
    for every, most in ((8.0, 9), (math.inf, 9), (2.0, 0)):
        assert len(way_of(here, at, every, 0.0, most)) == 0
    assert len(way_of(here, here, 2.0, 0.0, 9)) == 0  # it stays where it is


@pytest.mark.parametrize("layer", [None, 2])
def test_around_a_corner_by_hand(layer):
    """Four voxels along x, then four along y: driven 0.96 times as far, a scan every 1.92 edges."""
    steps = [(1, 2, 2), (2, 2, 2), (3, 2, 2), (4, 2, 2), (5, 2, 2), *((5, y, 2) for y in (3, 4, 5, 6))]
    path = np.array([np.ravel_multi_index(step, SIZE) for step in steps], np.int32)
    here, at = (1.5, 2.5, 2.1, 0.0, 0.0), (5.5, 6.5, 2.1, 0.0, 0.0)
    places = way_of(here, at, 2.0 * STRAIGHTENED, 0.0, 9, path, layer)
    assert places[:, :2].tolist() == [[3.5, 2.5], [5.5, 2.5], [5.5, 4.5]]
    assert (places[:, 2] == (2.5 if layer is None else 2.1)).all()


def test_a_path_is_that_of_the_search():
    mean, precision = np.zeros(SIZE, np.float32), np.full(SIZE, 100.0, np.float32)
    mean[3, :10] = 1.0  # a wall with a gap at y = 10
    search, lattice = new_search(mean.size), new_lattice(SIZE, 0.0, None)
    start, goal = (int(np.ravel_multi_index(v, SIZE)) for v in ((1, 2, 2), (5, 2, 2)))
    costs = belief_costs(mean, precision, 1e-3)
    search_paths(search, lattice, costs, np.array([start], np.int32), goal, math.inf)
    path = np.zeros(mean.size, np.int32)
    count = planned_path(search, lattice, SIZE, np.array([5.5, 2.5, 2.5, 0.0, 0.0]), path)
    assert path[0] == start and path[count - 1] == goal
    assert (np.stack(np.unravel_index(path[:count], SIZE))[1].max()) == 10
    shut = np.array([3.5, 2.5, 2.5, 0.0, 0.0])
    assert planned_path(search, lattice, SIZE, shut, path) == 0


@given(st.integers(0, 4), seeds)
@drawn(30)
def test_all_scans_bring_what_their_precision_adds_up_to(count, seed):
    """Σ ½ log2(1 + Σ added/p), scan by scan in NumPy; with none on the way that of the viewpoint alone."""
    rng = np.random.default_rng(seed)
    mean = np.where(rng.random(SIZE) < 0.15, 0.9, 0.1).astype(np.float32).reshape(-1)
    precision = np.where(rng.random(SIZE) < 0.5, 1e-3, 100.0).astype(np.float32).reshape(-1)
    scenario = with_settings(BOX, {"sensor": {"angular_step_rad": math.pi / 12}})
    scan, belief = robot_model(scenario, scenario.kinds[0], 1, 0.1).scan, Belief(mean, precision, SIZE)
    longest = longest_crossing(*SIZE, math.inf, scan.voxels_behind + 1)
    scratch = new_scan_scratch(mean.size, longest, len(scan.pitches))
    looks = np.concatenate([rng.random((count + 1, 3)) * SIZE, rng.uniform(-1.5, 1.5, (count + 1, 2))], 1)
    total = np.zeros(mean.size)
    for look in looks:
        touched = imagine_scan(belief, scan, 0.5, look, scratch, 0)
        total += scratch.added
        scratch.added[scratch.touched[:touched]] = 0.0
    found = way_bits(belief, scan, 0.5, looks[:-1], looks[-1], scratch)
    assert found == pytest.approx(0.5 * np.log2(1.0 + total / precision).sum(), rel=1e-4, abs=1e-6)
    assert not scratch.added.any()
    alone = np.zeros(1)
    imagined_bits(belief, scan, 0.5, looks[-1:], np.zeros(0, CONE), scratch, alone)
    assert found >= alone[0] * (1.0 - 1e-6)
    if count == 0:
        assert found == alone[0]

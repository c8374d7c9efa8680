"""What candidates see, computed by hand: one ray through seven voxels."""

import math

import pytest

from entropy_explore_env.planner.model import new_proposers
from entropy_explore_env.planner.recipe import recipe_for
from entropy_explore_env.planner.views import clear_marks, look_from, mark_view
from entropy_explore_env.viewpoints.expected_scan import expected_bits
from tests.planner.situations import ALONG_X, BACK, BY_SEEN, ONE_RAY, PRIOR, unknown_world


def test_one_ray_through_seven_unknown_voxels():
    """The wall is 3.5 m less half a voxel away; each unknown voxel lets 0.98 of the gain through."""
    precision, situation = unknown_world()
    proposer = new_proposers(ONE_RAY)[0]
    precision[:, 7, 2] = 100.0  # known: row 6 would be left one voxel thick
    assert look_from(proposer, situation, ALONG_X, 0, 0.9)
    view, sensor = proposer.scratch.views[0], ONE_RAY.sensor
    gain = (sensor.sigma_min + sensor.sigma_slope_per_m * 3.25) ** -2
    gains = [gain * 0.98**number for number in range(7)]
    bits = sum(0.5 * math.log2(1.0 + g / PRIOR) for g in gains)
    again = sum(0.5 * math.log2(1.0 + g / (PRIOR + g)) for g in gains)
    assert view["bits"] == view["all_bits"] == pytest.approx(bits, rel=1e-5)
    assert view["again_bits"] == pytest.approx(again, rel=1e-5)
    assert (view["seen"], view["unknown"]) == (7, 7)
    assert view["distance"] == pytest.approx(0 + 1 + 2 + 3 + 4 + 5 + 6)
    assert mark_view(proposer, situation.belief, 0, 0) == 7
    assert view["slivers"] == 7
    assert not look_from(proposer, situation, BACK, 1, 0.9)
    assert proposer.scratch.common[1, 0] == 7
    assert look_from(proposer, situation, BACK, 1, 2.0)
    assert mark_view(proposer, situation.belief, 1, 7) == 7
    clear_marks(proposer, 2, 7)
    assert [proposer.scratch.views[k]["unique"] for k in range(2)] == pytest.approx([3.5, 3.5])
    assert not proposer.scratch.marks.any() and not proposer.scratch.scan.added.any()


def test_where_a_mission_ends_by_what_is_seen_known_voxels_bring_nothing():
    """Four of the seven voxels are known: the others count, as do far places' unknown voxels alone."""
    bits = {}
    for scenario in (ONE_RAY, BY_SEEN):
        recipe = recipe_for(scenario, scenario.kinds[0])._replace(stop_probability=0.0, gap_probability=0.0)
        proposer = new_proposers(scenario, recipe)[0]
        precision, situation = unknown_world()
        precision[:4, 5, 2] = 100.0
        scan = proposer.refined
        sensor = scenario.sensor
        gain = (sensor.sigma_min + sensor.sigma_slope_per_m * 3.25) ** -2
        found = expected_bits(situation.belief, scan, ALONG_X, proposer.scratch.scan)
        bits[scenario.ending.by_seen] = found
        assert math.isinf(scan.wanted_precision) != scenario.ending.by_seen
    unknown, known = 0.5 * math.log2(1.0 + gain / PRIOR), 0.5 * math.log2(1.0 + gain / 100.0)
    assert bits[True] == pytest.approx(3 * unknown, rel=1e-5)
    assert bits[False] == pytest.approx(3 * unknown + 4 * known, rel=1e-5)

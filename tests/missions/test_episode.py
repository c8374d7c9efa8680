"""What a mission starts with: maps at the prior, the entropies that are to be reached, nothing of before."""

import pytest

from entropy_explore_env.belief.entropy import map_entropy_bits
from entropy_explore_env.robots.range_sensor import Return
from entropy_explore_env.settings.changes import with_settings
from entropy_explore_env.settings.ending import gaussian_entropy_bits
from entropy_explore_env.settings.scenarios import ROOM, ROOM_FURNISHED
from tests.reference.scenes import started, wander


def test_the_paper_s_room():
    """28,577 voxels, 128 rays, H(0) = 1.987·10⁵ and H_th = -8.6068·10⁴."""
    missions = started(with_settings(ROOM, {"robots": 1}))
    clock = missions.state.missions[0]
    assert missions.grid.voxels == 28_577
    assert missions.scenario.sensor.rays == 128
    assert clock["entropy_start_bits"] == pytest.approx(198_724.06, abs=0.01)
    assert clock["entropy_end_bits"] == pytest.approx(-86_068.15, abs=0.01)
    assert map_entropy_bits(missions.precision[0, 0]) == pytest.approx(198_724.06, abs=0.1)
    wander(missions, 20, 0)
    assert missions.state.robots[0, 0]["measurements"] == 128 * missions.state.robots[0, 0]["scans"]
    assert (missions.state.scan_returned == Return.HIT).all()  # the boundary is a wall


def test_the_threshold_asks_for_nothing_that_cannot_be_seen():
    """A furnished room: solid voxels behind others keep their prior entropy."""
    missions = started(ROOM_FURNISHED, seed=1)
    world, clock = missions.worlds[0], missions.state.missions[0]
    visible = world.layout(ROOM_FURNISHED).visible_voxels
    assert 0.9 * 28_577 < visible < 28_577
    known, unknown = gaussian_entropy_bits(0.03), gaussian_entropy_bits(30.0)
    expected = visible * known + (28_577 - visible) * unknown
    assert clock["entropy_end_bits"] == pytest.approx(expected, rel=1e-9)

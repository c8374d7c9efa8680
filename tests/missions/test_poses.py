"""Where robots are on their drives, how fast, and what is left of them, by hand."""

import numpy as np
import pytest

from entropy_explore_env.missions.poses import note_driven, place_at, pose_at, speed_at, within_grid
from entropy_explore_env.settings.grid import Grid
from tests.reference.scenes import free_box, started

GRID = Grid((7, 11, 5), 0.5, (-1.0, 2.0, 0.5))
"""From (-1, 2, ½) to (2.5, 7.5, 3) m."""


def around_a_corner():
    """2 m along y, 1.5 m along x, from 10 s: 1 s up, 6 s along, 1 s down; it turns over the back; a scan."""
    robot = {"max_speed_m_s": 0.5, "acceleration_m_s2": 0.5, "turn_rate_rad_s": 0.1}
    missions = started(free_box(grid=GRID, robots=2, robot=robot))
    own = missions.state.robots[0, 0]
    own["origin"], own["goal"] = (-0.5, 2.5, 1.0, 3.0, 0.0), (1.0, 4.5, 1.0, -3.0, 0.5)
    own["path"][0], own["corners"], own["path_m"] = (-0.5, 4.5, 1.0), 1, 3.5
    own["depart_s"], own["ready_s"], own["departed_m"] = 10.0, 18.5, 1.5
    return missions, missions.rules.params[0], own


@pytest.mark.parametrize(
    ("time_s", "place", "corners", "speed_m_s"),
    [
        (10.0, (-0.5, 2.5), 0, 0.0),
        (10.5, (-0.5, 2.5625), 0, 0.25),
        (14.0, (-0.5, 4.25), 0, 0.5),  # half of the way
        (16.0, (0.25, 4.5), 1, 0.5),
        (17.5, (0.9375, 4.5), 1, 0.25),
        (18.0, (1.0, 4.5), 1, 0.0),
        (18.5, (1.0, 4.5), 1, 0.0),
    ],
)
def test_a_robot_is_so_far_and_so_fast_on_its_path(time_s, place, corners, speed_m_s):
    missions, params, own = around_a_corner()
    assert place_at(params, own, time_s) == pytest.approx((*place, 1.0, corners), abs=1e-9)
    assert speed_at(params, own, time_s) == pytest.approx(speed_m_s, abs=1e-9)
    note_driven(missions.rules.params, missions.state.robots[0], time_s)
    on_path_m = max(place[1] - 2.5, 0.0) + place[0] + 0.5
    assert missions.state.robots["distance_m"][0] == pytest.approx(
        [1.5 + on_path_m, 0.0], abs=1e-9
    )  # 1.5 m before this drive


@pytest.mark.parametrize(
    ("time_s", "yaw", "pitch"), [(10.0, 3.0, 0.0), (12.0, 3.2, 0.2), (14.0, -3.0, 0.4), (18.0, -3.0, 0.5)]
)
def test_a_robot_turns_the_short_way_round(time_s, yaw, pitch):
    """By 2 π - 6 = 0.28 rad at 0.1 rad/s, and no farther than to its goal."""
    _, params, own = around_a_corner()
    turned = pose_at(params, own, time_s)[3:]
    assert np.cos(turned) == pytest.approx(np.cos((yaw, pitch)), abs=1e-9)
    assert np.sin(turned) == pytest.approx(np.sin((yaw, pitch)), abs=1e-9)


def test_places_in_grid_units_count_voxels_from_the_lower_corner():
    params = around_a_corner()[1]
    assert within_grid(params, (0.25, 3.0, 1.75)) == (2.5, 2.0, 2.5)
    assert within_grid(params, (-1.25, 1.0, 0.25)) == (0.0, 0.0, 0.0)
    assert within_grid(params, (9.0, 9.0, 9.0)) == (7.0, 11.0, 5.0)

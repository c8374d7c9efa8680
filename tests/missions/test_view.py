"""What a robot's view shows, and that nothing can be changed through it."""

import math
import pickle

import numpy as np
import pytest

from entropy_explore_env import EntropyExploreVectorEnv, parallel_env
from entropy_explore_env.errors import SettingError
from entropy_explore_env.missions.view import view_of
from entropy_explore_env.prediction import predictor
from entropy_explore_env.robots.motion import MoveEnd
from tests.reference.scenes import free_box, started, wander


def test_a_view_shows_the_robot_s_own_state():
    missions = started(free_box(robots=3, world="furnished"), seed=4)
    wander(missions, 15, 0)
    for robot in range(3):
        view, own = view_of(missions, 0, robot), missions.state.robots[0, robot]
        assert (view.robot, view.deciding) == (robot, own["deciding"])
        assert view.time_s == missions.state.missions[0]["time_s"]
        assert view.entropy_bits == own["entropy_bits"]
        assert view.move_end is list(MoveEnd)[own["move_end"]]
        np.testing.assert_array_equal(view.mean, missions.mean[0, robot])
        np.testing.assert_array_equal(view.precision, missions.precision[0, robot])
        np.testing.assert_array_equal(view.scan.utility_bits, missions.state.scan_utility_bits[0, robot])
        assert view.scan.pose.tolist() == own["scan_pose"].tolist()
        if view.deciding:
            assert view.pose.tolist() == own["goal"].tolist() == view.scan.pose.tolist()
        assert sorted(view.teammates) == [mate for mate in range(3) if mate != robot]


@pytest.mark.parametrize("kind", ["continuous", "candidates"])
def test_nothing_can_be_changed_through_a_view(kind):
    view = view_of(started(free_box(action={"kind": kind})), 0, 0)
    arrays = [each for part in (view, view.scan, view.teammates[1]) for each in vars(part).values()]
    arrays = [each for each in arrays if isinstance(each, np.ndarray)]
    assert len(arrays) == 17 and not any(array.flags.writeable for array in arrays)
    with pytest.raises(ValueError, match="read-only"):
        view.pose[:2] += 0.5


def test_views_are_compared_and_hashed_by_identity():
    missions = started(free_box(robots=2))
    view, other = view_of(missions, 0, 0), view_of(missions, 0, 0)
    for one, two in ((view, other), (view.scan, other.scan), (view.teammates[1], other.teammates[1])):
        assert one == one and one != two and len({one, one, two}) == 2


def test_a_view_before_anything_was_measured_or_heard():
    view = view_of(started(free_box()), 0, 0)
    assert (view.scan.returned == 0).all()
    assert (view.teammates[1].heard_s, view.teammates[1].announced_s) == (-1.0, -1.0)
    assert not view.teammates[1].viewpoint.any()
    assert view.deciding


def test_texts_of_views_and_spaces_are_short() -> None:
    team = parallel_env("room", robots=3, observation={"patch": True})
    team.reset(seed=0)
    team.step({agent: np.zeros(5, np.float32) for agent in team.agents})
    view = team.view("robot_1")
    for each in (view, view.scan, view.teammates[0], team.observation_space("robot_0"), team.state_space):
        assert 10 < len(repr(each)) < 300 and "\n" not in repr(each)
    assert repr(view).startswith("RobotView(robot_1 of 3 in 'room', 1 s, ")
    assert f"{view.entropy_bits:.6g} bits" in repr(view)
    batch = EntropyExploreVectorEnv("room", 4)
    assert len(repr(batch.observation_space)) < 300
    space = team.observation_space("robot_0")
    assert pickle.loads(pickle.dumps(space)) == space and "Box(0, 1, (4, 11, 11, 5), float32)" in repr(space)


def silent_views(unheard_s, **changes):
    """What robot 0 knows of robot 1, which it heard last at 0.5 s, some seconds later."""
    missions = started(free_box(robot={"turn_rate_rad_s": math.inf}, **changes))
    wander(missions, 3, 0)
    missions.state.missions["time_s"] = 0.5 + unheard_s
    heard = missions.state.heard[0, 0, 1]
    heard["heard_s"] = heard["announced_s"] = 0.5
    heard["pose"], heard["announced"] = (1.0, 1.0, 1.0, 0.1, 0.2), (1.0, 2.0, 1.0, 0.3, 0.4, 2.0, 0.5)
    return view_of(missions, 0, 0)


@pytest.mark.parametrize(
    ("changes", "limit_s"),
    [
        ({}, 10.0 + 2 * 3.0 + 0.5),  # 1 m at 0.5 m/s and 0.5 m/s²: 3 s; the scan takes 0.5 s
        ({"channel": {"delay_s": 2.0}}, 12.0 + 2 * 3.0 + 0.5),
        ({"channel": {"phase_s": 4.0}}, 14.0 + 2 * 3.0 + 0.5),
        ({"faults": {"radio": {"late": 0.5, "late_s": 7.0}}}, 17.0 + 2 * 3.0 + 0.5),
    ],
)
def test_a_teammate_that_is_not_heard_for_long_is_silent_and_its_place_is_free(changes, limit_s):
    heard, silent = (silent_views(limit_s + late_s, **changes).teammates[1] for late_s in (-1e-6, 1e-6))
    assert (heard.silent, heard.announced_s, heard.depth_m) == (False, 0.5, 2.0)
    assert heard.viewpoint.tolist() == [1.0, 2.0, 1.0, 0.3, 0.4]
    assert (silent.silent, silent.announced_s, silent.depth_m) == (True, -1.0, 0.0)
    assert not silent.viewpoint.any() and silent.pose.tolist() == heard.pose.tolist()
    assert silent.heard_s == 0.5 and "silent since" in repr(silent) and "silent" not in repr(heard)


def test_a_teammate_that_was_never_heard_is_not_silent():
    missions = started(free_box(channel={"range_m": 1e-6}))
    missions.state.missions["time_s"] = 1e6
    assert not view_of(missions, 0, 0).teammates[1].silent


def test_a_policy_observes_what_was_heard_as_it_was():
    view = silent_views(100.0)
    assert view.heard[1]["announced_s"] == 0.5 and view.heard[1]["announced"][5] == 2.0
    assert not view.heard.flags.writeable


def test_a_prediction_is_of_the_robot_s_own_map_as_it_first_looks():
    missions = started(free_box(robots=2, channel={"loss_probability": 1.0}), seed=2)
    before = view_of(missions, 0, 0)
    blank = before.prediction.measured.copy()
    wander(missions, 6, 3)
    assert np.array_equal(before.prediction.measured, blank)
    views = [view_of(missions, 0, robot) for robot in (0, 1)]
    for view in views:
        found, edge = view.prediction, missions.grid.voxel_size_m
        known = view.map.known & (np.arange(missions.grid.shape[2]) >= found.layers[0])
        known = known & (np.arange(missions.grid.shape[2]) < found.layers[1])
        for x, y in np.argwhere(found.measured):
            low = found.origin_m + 0.2 * np.array([x, y]) - missions.grid.origin_m[:2]
            first, last = np.floor(low / edge + 1e-6), np.ceil((low + 0.2) / edge - 1e-6)
            over = tuple(slice(int(a), int(b)) for a, b in zip(first, last, strict=True))
            assert found.solid[x, y] == view.mean[over][known[over]].max()
        assert found.measured.any() and not np.array_equal(found.measured, blank)
    assert not np.array_equal(views[0].prediction.solid, views[1].prediction.solid)


@pytest.mark.parametrize("name", ["mean", "precision"])
def test_a_map_with_a_number_that_is_not_finite_is_not_predicted(name):
    missions = started(free_box(), seed=2)
    getattr(missions.state, name)[0, 0, 5] = np.nan
    with pytest.raises(SettingError, match=f"{name} = 'a number that is not finite'"):
        _ = view_of(missions, 0, 0).prediction


def test_without_the_part_no_weights_are_read(monkeypatch):
    monkeypatch.setattr(predictor, "shipped_predictor", lambda: pytest.fail("read"))
    for form in ({}, {"patch": True, "overview": True, "flat": True}):
        missions = started(free_box(observation=form), seed=1)
        assert "prediction" not in missions.layout.parts
        view_of(missions, 0, 0)

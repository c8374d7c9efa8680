"""The Explorer: the decisions of missions, maps that grow and turn, teams, and what it refuses."""

from __future__ import annotations

import math
from itertools import pairwise
from types import SimpleNamespace

import numpy as np
import pytest

import entropy_explore_env as eee
from baselines.experiments.mission import scripted
from baselines.strategies.rules.nearest_frontier import NearestFrontier
from entropy_explore_env.envs.parallel_env import EntropyExploreEnv
from entropy_explore_env.errors import CallOrderError, SettingError
from entropy_explore_env.explorer.explorer import Explorer
from entropy_explore_env.explorer.given_maps import occupancies_of
from entropy_explore_env.explorer.goals import NoGoal, Why
from entropy_explore_env.explorer.planned_rate import PlannedRate
from entropy_explore_env.planner.weights import shipped_weights
from entropy_explore_env.robots.rotations import turned_by
from entropy_explore_env.settings.changes import with_settings
from entropy_explore_env.settings.scenarios import find_scenario
from tests.explorer.hand_drawn import EDGE_M, START, look, plan_by_hand


def from_start(x_m, y_m):
    return START + np.array([x_m, y_m, 0.0, 0.0, 0.0])


@pytest.mark.parametrize(
    ("name", "weights", "decisions", "settings"),
    [
        ("office", None, 40, {"ending": {"seen_share": 1.0}}),
        ("office", "plans", 12, {}),
        ("room", None, 12, {}),
    ],
)
def test_a_mission_through_an_explorer_takes_the_same_decisions(name, weights, decisions, settings):
    """It is fed with the robot's own scans alone; its belief is the robot's, bit for bit."""
    scenario = with_settings(scripted(find_scenario(name)), {"robots": 1, **settings})
    env = EntropyExploreEnv(scenario)
    env.reset(seed=3)
    strategy = PlannedRate(None if weights is None else shipped_weights(weights))
    strategy.reset(env.scenario, env.strategy_generator())
    explorer = Explorer(env.scenario, weights=weights, seed=3)
    for _ in range(decisions):
        view = env.view("robot_0")
        chosen = strategy.choose(view)
        if view.scan.returned.any():
            explorer.add_scan(view.scan.pose, view.scan.range_m)
        goal = explorer.goal(view.pose, ended=view.move_end, time_s=view.time_s)
        assert np.array_equal(goal.viewpoint, chosen)
        assert np.array_equal(explorer.map.precision, view.precision)
        assert np.array_equal(explorer.map.mean, view.mean)
        env.step({"robot_0": view.action_for(chosen)})


def test_it_drives_through_a_map_drawn_by_hand_until_all_is_seen():
    solid = plan_by_hand()
    seen, pose = np.full(solid.shape, -1, np.int8), START.copy()
    explorer = Explorer(voxel_size_m=EDGE_M)
    for _ in range(25):
        look(solid, seen, pose)
        explorer.set_map(seen)
        goal = explorer.goal(pose)
        if goal is None:
            break
        ends = np.vstack([pose[None, :3], goal.path])
        for begin, end in pairwise(ends):
            for share in np.linspace(0.0, 1.0, 50):
                x, y, _ = begin + share * (end - begin)
                assert not solid[int(x / EDGE_M), int(y / EDGE_M)]
        assert goal.seconds > 0.0 and goal.viewpoint[2] == START[2]
        pose = np.array([*goal.path[-1], *goal.viewpoint[3:]])
    assert explorer.no_goal is NoGoal.ALL_SEEN
    assert (seen[~solid] == 0).all()


def test_what_no_body_can_reach_is_said_to_be_out_of_reach():
    solid = plan_by_hand()
    solid[56:66, 40] = True
    solid[59:62, 40] = False  # 0.3 m for a robot of 0.6 m
    seen = np.where(solid, 100, 0).astype(np.int8)
    seen[41:80, 2:40] = -1
    seen[55:66, 36:40] = 0
    explorer = Explorer(voxel_size_m=EDGE_M)
    explorer.set_map(seen)
    assert explorer.goal(START) is None
    assert explorer.no_goal is NoGoal.OUT_OF_REACH


@pytest.mark.parametrize("name", [None, "office"])
def test_where_robots_return_the_last_goal_is_the_way_home(name):
    solid = plan_by_hand()
    seen = np.where(solid, 100, 0).astype(np.int8)
    seen[2:20, 2:9] = -1
    scenario = with_settings(
        find_scenario(name or "office"),
        {"robots": 1, "ending": {"seen_share": 1.0 if name is None else 0.9, "return_to_start": True}},
    )
    explorer, home = Explorer(scenario, voxel_size_m=EDGE_M), from_start(9.0, 5.0)
    explorer.set_map(seen)
    assert explorer.goal(home).why is not Why.RETURNS
    explorer.set_map(np.where(solid, 100, 0).astype(np.int8))
    pose, reasons = from_start(2.0, 0.0), []
    while (goal := explorer.goal(pose)) is not None and len(reasons) < 20:  # stops lie within reach
        pose = np.array([*goal.path[-1], *goal.viewpoint[3:]])
        reasons.append(goal.why)
    assert explorer.no_goal is NoGoal.ALL_SEEN
    assert reasons[-1] is Why.RETURNS and reasons.count(Why.RETURNS) > 1
    assert np.allclose(pose[:2], home[:2], atol=EDGE_M)


def test_a_later_map_replaces_what_was_believed_where_it_lies(seen_from_start):
    explorer = Explorer(voxel_size_m=EDGE_M)
    explorer.set_map(seen_from_start, origin=(0.0, 0.0, 0.0))
    explorer.set_map(np.full((4, 3), 100, np.int8), origin=(1.5, 2.0, 0.0))
    labels, (x, y, _) = explorer.map.labels(), explorer.map.grid.origin_m
    i, j = round((1.5 - x) / EDGE_M), round((2.0 - y) / EDGE_M)
    assert (labels[i : i + 4, j : j + 3, 0] == 1).all() and labels[i + 4, j, 0] == 0
    assert explorer._ground.entropy_bits == pytest.approx(entropy_bits(explorer.map), rel=1e-6)


def entropy_bits(belief):
    return float((0.5 * np.log2(2.0 * math.pi * math.e) + np.log2(belief.sigma, dtype=float)).sum())


def test_goals_on_a_turned_map_are_the_turned_goals(seen_from_start):
    straight, turned = Explorer(voxel_size_m=EDGE_M), Explorer(voxel_size_m=EDGE_M)
    straight.set_map(seen_from_start, origin=(0.5, -0.25, 0.0))
    yaw = 0.7
    corner = turned_by(np.array([0.5, -0.25, 0.0]), yaw)
    turned.set_map(seen_from_start, origin=(corner[0], corner[1], yaw))
    pose = from_start(0.5, -0.25)
    expected, goal = straight.goal(pose), turned.goal(turned_by(pose, yaw))
    assert np.allclose(goal.viewpoint, turned_by(expected.viewpoint, yaw), atol=1e-6)
    assert np.allclose(goal.path, turned_by(expected.path, yaw), atol=1e-6)


def message_of(seen, x, y, yaw):
    at = SimpleNamespace(
        position=SimpleNamespace(x=x, y=y, z=0.0),
        orientation=SimpleNamespace(x=0.0, y=0.0, z=math.sin(yaw / 2), w=math.cos(yaw / 2)),
    )
    size = {"width": seen.shape[0], "height": seen.shape[1]}
    info = SimpleNamespace(resolution=np.float32(EDGE_M), origin=at, **size)
    return SimpleNamespace(info=info, data=seen.T.ravel().tolist())


def test_a_message_has_the_rows_of_ros(seen_from_start):
    arrays, messages = Explorer(voxel_size_m=EDGE_M), Explorer(voxel_size_m=EDGE_M)
    arrays.set_map(seen_from_start, origin=(1.0, 2.0, 0.3))
    messages.set_map_message(message_of(seen_from_start, 1.0, 2.0, 0.3))
    assert np.array_equal(arrays.map.mean, messages.map.mean)
    assert messages.map.yaw_rad == pytest.approx(0.3)


@pytest.mark.parametrize("robots", [1, 3])
def test_the_same_seed_gives_the_same_goals(robots, seen_from_start):
    poses = START + np.arange(robots)[:, None] * [0.0, 0.9, 0.0, 0.0, 0.0]
    chosen = []
    for seed in (5, 5):
        explorer = Explorer("office", voxel_size_m=EDGE_M, robots=robots, seed=seed)
        explorer.set_map(seen_from_start)
        chosen.append([explorer.goal(poses, robot=robot).viewpoint for robot in range(robots)])
    assert np.array_equal(*chosen)


def test_robots_take_different_ends_of_a_corridor_unless_the_other_is_silent():
    """Both are nearer to the western end."""
    seen = np.full((200, 60), -1, np.int8)
    seen[60:140, 20:40], seen[60:140, 19], seen[60:140, 40] = 0, 100, 100
    poses = np.array([[8.5, 2.6, 0.0, 0.0, 0.0], [8.8, 3.4, 0.0, 0.0, 0.0]])
    near = eee.RangeSensor((2.0 * math.pi, 0.0), math.pi / 90, max_range_m=2.0)
    for heard, east in ((poses, True), ({1: poses[1]}, False)):
        explorer = Explorer(sensor=near, voxel_size_m=EDGE_M, robots=2)
        explorer.set_map(seen)
        first = explorer.goal(poses, robot=0)
        assert first.why is Why.EXPLORES and first.viewpoint[0] < 7.0
        assert bool(explorer.goal(heard, robot=1).viewpoint[0] > 10.0) is east


def test_scans_alone_make_a_map_that_grows():
    explorer, solid = Explorer(voxel_size_m=EDGE_M), plan_by_hand()
    seen = np.full(solid.shape, -1, np.int8)
    look(solid, seen, START)
    hits = (np.argwhere(seen == 100) + 0.5) * EDGE_M
    points = np.column_stack([hits, np.zeros(len(hits))])
    assert explorer.add_scan(START, points) > 0.0
    before = explorer.map.grid.shape
    assert explorer.goal(START).expected_bits > 0.0
    far = from_start(9.0, 0.0)
    explorer.add_scan(far, np.full(180, np.inf))
    assert explorer.map.grid.shape[0] > before[0]
    assert entropy_bits(explorer.map) == pytest.approx(explorer._ground.entropy_bits, rel=1e-6)


class Listener:
    """Notes the bits of the latest scan, and goes to and fro."""

    def __init__(self):
        self.came_bits = []

    def reset(self, scenario, rng):
        self.step_m = 0.5

    def choose(self, view):
        arrays = [each for part in (view, view.scan) for each in vars(part).values()]
        arrays = [each for each in arrays if isinstance(each, np.ndarray) and each.size]
        assert len(arrays) > 6 and not any(each.flags.writeable for each in arrays)
        self.came_bits.append(view.scan.utility_bits.sum())
        self.step_m = -self.step_m
        return view.pose - [self.step_m, 0.0, 0.0, 0.0, 0.0]

    def search(self):
        """Share a name with what strategies lend."""


def test_what_a_map_brought_counts_for_one_decision(seen_from_start):
    listener = Listener()
    explorer = Explorer(voxel_size_m=EDGE_M, strategy=listener)
    part = seen_from_start.copy()
    part[12:16, 12:16] = -1
    explorer.set_map(part)
    for end in (eee.MoveEnd.ARRIVED, eee.MoveEnd.ARRIVED):
        explorer.goal(START, ended=end)
    explorer.set_map(seen_from_start)
    for end in (eee.MoveEnd.UNDER_WAY, eee.MoveEnd.OBSTACLE, eee.MoveEnd.ARRIVED):
        explorer.goal(START, ended=end)
    first, again, under_way, blocked, after = listener.came_bits
    assert first > under_way == blocked > 0.0
    assert again == after == 0.0


def test_a_new_map_is_decided_by_even_at_the_same_time():
    solid = plan_by_hand()
    seen = np.where(solid, 100, 0).astype(np.int8)
    task = with_settings(find_scenario("office"), {"robots": 1, "ending": {"seen_share": 0.9}})
    explorer = Explorer(task, voxel_size_m=EDGE_M)
    explorer.set_map(seen)
    assert explorer.goal(START) is None
    seen[2:20, 30:70] = -1
    explorer.set_map(seen)
    assert explorer.goal(START).why is Why.EXPLORES


def test_a_map_of_a_belief_is_taken_as_it_is():
    env = EntropyExploreEnv("box-7x11x5", robots=1)
    env.reset(seed=0)
    view = env.view("robot_0")
    first = Explorer(env.scenario)
    first.add_scan(view.pose, np.full(view.kind.sensor.rays, 1.2))
    second = Explorer(env.scenario)
    second.set_map(first.map)
    assert np.array_equal(second.map.precision, first.map.precision)
    assert second.map.grid == env.scenario.grid
    goals = [each.goal(view.pose).viewpoint for each in (first, second)]
    assert np.allclose(*goals)


def test_occupancies_in_all_their_forms():
    percent = np.array([[-1, 0, 100, 50, 30, 70]], np.int16)
    log_odds = np.array([[0.0, -9.0, 9.0, np.nan, -0.85, 0.85]])
    expected = np.array([0.5, 0.0, 1.0, 0.5, 0.3, 0.7])
    for grid, values in (
        (percent, None),
        (log_odds, "log_odds"),
        (np.append(np.nan, expected[1:])[None], None),
    ):
        mean, known = occupancies_of(grid, values).rows(0, 1)
        assert known.ravel().tolist() == [False, True, True, False, True, True]
        assert np.allclose(mean.ravel(), expected, atol=2e-3)
    assert occupancies_of(np.eye(3, dtype=bool)).rows(0, 3)[1].all()


def bad_calls(explorer, seen):
    poses = np.array([START, from_start(0.0, 1.0)])
    far, wall, lost = poses.copy(), poses.copy(), poses.copy()
    far[1, 0], wall[0, :2], lost[1, 1] = 500.0, (0.15, 1.0), np.nan
    wide = np.full((121, 80), -1, np.int8)
    return [
        (lambda: explorer.goal(far), r"poses\[1\] = .*a place on the map, from \["),
        (lambda: explorer.goal(wall), r"poses\[0\] = .*does not say is solid"),
        (lambda: explorer.goal(lost), r"poses\[1\] = .*five finite numbers"),
        (lambda: explorer.goal(poses[0]), r"poses = .*\(2, 5\) numbers"),
        (lambda: explorer.goal({1: poses[1]}), r"poses = .*robot 0 among them"),
        (lambda: explorer.goal(poses, robot=2), r"robot = 2: .*from 0 to 1"),
        (lambda: explorer.goal(poses, time_s=0.0), r"time_s = 0.0: .*not before 7"),
        (lambda: explorer.goal(poses, ended="arrived"), r"ended = 'arrived': .*a MoveEnd"),
        (lambda: explorer.set_map(wide), r"origin = None: .*no longer \(120, 80, 1\)"),
        (lambda: explorer.set_map(wide, origin=(0.0, 0.0, 0.0)), "grid = .*something is known"),
        (lambda: explorer.set_map(seen, origin=(0.0, np.inf, 0.0)), "origin = .*three finite numbers"),
        (
            lambda: explorer.set_map(seen, origin=(1e9, 0.0, 0.0)),
            r"origin = \(1000000000.0, 0.0, 0.0\): .*near",
        ),
        (lambda: explorer.set_map(explorer.map, origin=(9.0, 0.0, 0.0)), "origin = .*no value beside a Map"),
        (lambda: explorer.set_map(seen.tolist()), r"grid = .*a NumPy array \(X, Y\)"),
        (lambda: explorer.set_map(seen + 4.5), "grid = .*probabilities from 0 to 1"),
        (lambda: explorer.set_map((seen > 50).astype(int)), "grid = .*booleans, or values='percent'"),
        (lambda: explorer.set_map(seen, values="odds"), "values = 'odds': .*log_odds"),
        (lambda: explorer.set_map(np.zeros((9, 9, 9), np.int8)), "origin = None"),
        (lambda: explorer.set_map(np.zeros((9, 9, 9)), (0, 0, 0)), "grid = .*as many dimensions"),
        (lambda: explorer.set_map_message(SimpleNamespace()), "message = .*OccupancyGrid"),
        (lambda: explorer.add_scan(START, np.ones(7)), r"measured = \(7,\): .*\(180,\) ranges"),
        (lambda: explorer.add_scan(far[0] * np.nan, np.ones(180)), "pose = .*five finite numbers"),
        (lambda: explorer.add_scan(START, np.full((2, 3), np.nan)), "measured = .*finite points"),
        (lambda: explorer.set_map(explorer.map, bottom_m=np.zeros(3)), "bottom_m = .*no value beside a Map"),
        (lambda: explorer.add_scan(START, np.zeros(4, [("x", "f4"), ("y", "f4")])), "measured = .*numbers"),
        (lambda: explorer.add_scan(START, ["1.0"] * 180), "measured = .*numbers"),
        (lambda: explorer.add_scan(START, [10**400] * 180), "measured = .*numbers"),
    ]


def test_bad_input_is_named_and_changes_nothing(seen_from_start):
    explorer = Explorer(voxel_size_m=EDGE_M, robots=2)
    explorer.set_map(seen_from_start)
    poses = np.array([START, from_start(0.0, 1.0)])
    explorer.goal(poses, time_s=7.0)
    before = explorer.map
    for call, message in bad_calls(explorer, seen_from_start):
        with pytest.raises(SettingError, match=message):
            call()
    assert np.array_equal(explorer.map.precision, before.precision) and explorer.map.grid == before.grid
    other = Explorer(voxel_size_m=EDGE_M, robots=2)
    other.set_map(seen_from_start)
    other.goal(poses, time_s=7.0)
    goals = [each.goal(poses, robot=1, time_s=8.0).viewpoint for each in (explorer, other)]
    assert np.array_equal(*goals)


def test_without_a_clock_time_passes_as_the_robot_drives_however_often_it_is_asked(seen_from_start):
    explorer = Explorer(voxel_size_m=EDGE_M)
    explorer.set_map(seen_from_start)
    looked_s = explorer.goal(START).seconds  # around, on the spot
    for _ in range(10):
        goal = explorer.goal(START)
    explorer.goal(START, time_s=looked_s + 1e-6)
    explorer.goal(np.append(0.5 * (START[:3] + goal.path[0]), START[3:]))
    with pytest.raises(SettingError, match="time_s"):
        explorer.goal(START, time_s=looked_s + 0.3 * goal.seconds)


def test_a_later_map_may_begin_below_the_first_one():
    explorer = Explorer(voxel_size_m=0.1)
    explorer.set_map(np.zeros((30, 30, 8), np.int8), (0.0, 0.0, 0.0))
    explorer.set_map(np.zeros((30, 30, 12), np.int8), (0.0, 0.0, 0.0), bottom_m=-0.4)
    assert explorer.map.known.sum() == 30 * 30 * 12 and explorer.map.grid.origin_m[2] == pytest.approx(-0.4)
    assert explorer.goal([1.5, 1.5, 0.0, 0.0, 0.0]) is not None


def test_beams_beyond_the_range_say_that_they_are_free_up_to_it():
    near, far = (Explorer("office") for _ in range(2))
    pose = np.array([12.0, 9.0, 0.05, 0.0, 0.0])
    near.add_scan(pose, np.full(180, 8.0))
    far.add_scan(pose, np.full(180, 80.0))
    assert np.array_equal(near.map.precision, far.map.precision)
    assert not (near.map.mean > 0.5).any()


def test_settings_are_checked_and_a_map_comes_first():
    with pytest.raises(CallOrderError, match="set_map"):
        Explorer(voxel_size_m=EDGE_M).goal(START)
    for settings, message in [
        ({"voxel_size_m": 0.0}, "voxel_size_m = 0.0"),
        ({"robots": 0}, r"Scenario.robots = 0"),
        ({"weights": "plants"}, "weights = 'plants'.*plans"),
        ({"arrival_m": -1.0}, "arrival_m = -1.0"),
        ({"weights": "plans", "strategy": NearestFrontier()}, "None where a strategy is given"),
        ({"seed": -1}, "seed = -1"),
        ({"strategy": "tour"}, r"strategy = 'tour': .*with reset and choose.*make_strategy\('tour'\)"),
        ({"strategy": NearestFrontier}, "strategy = <class .*an object with reset and choose or choose_all$"),
        ({"strategy": np.zeros(3)}, "strategy = .*an object with reset"),
    ]:
        with pytest.raises(SettingError, match=message):
            Explorer(**settings)

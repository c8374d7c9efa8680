"""The node for Nav2: its logic on the messages that rosbags knows, and the node itself on a false rclpy.

The false rclpy has the calls that the node makes, and a false Nav2 that drives robots through a plan.
"""

from __future__ import annotations

import importlib.util
import math
import sys
from collections.abc import Callable
from pathlib import Path
from types import ModuleType, SimpleNamespace

import numpy as np
import pytest
from rosbags.typesys import get_types_from_msg

from entropy_explore_env.explorer.navigation import (
    ABORTED,
    CANCELED,
    SUCCEEDED,
    Navigation,
    fill_marker,
    fill_pose,
    move_end_of,
)
from entropy_explore_env.interop.bag_writer import typestore
from entropy_explore_env.interop.messages import pose_of
from entropy_explore_env.robots.motion import MoveEnd
from tests.explorer.hand_drawn import EDGE_M, START, look, plan_by_hand

NODE = Path(__file__).parents[2] / "docs" / "ros2" / "entropy_explore_ros" / "explorer_node.py"
STORE = typestore()
STORE.register(get_types_from_msg("geometry_msgs/PoseStamped pose\nstring behavior_tree", "nav2/msg/Goal"))
_ZEROS = {"string": "", "bool": False, "float32": 0.0, "float64": 0.0}


def blank(name):
    """A message of a type with all fields at zero, as rclpy makes them."""
    _, fields = STORE.fielddefs[name]
    return STORE.types[name](**{field: _zero(kind) for field, kind in fields})


def _zero(kind):
    node, value = int(kind[0]), kind[1]
    if node == 1:  # a basic type
        return _ZEROS.get(value[0], 0)
    if node == 2:  # a message
        return blank(value)
    return np.zeros(36) if node == 3 else []  # an array, or a sequence


def grid_message(seen):
    message = blank("nav_msgs/msg/OccupancyGrid")
    message.info.resolution, message.info.origin.orientation.w = float(np.float32(EDGE_M)), 1.0
    message.info.width, message.info.height = seen.shape
    message.data = np.ascontiguousarray(seen.T).ravel()
    return message


def test_a_pose_and_an_arrow_are_filled_in():
    pose = np.array([1.0, -2.0, 0.3, 2.5, 0.4])
    filled = fill_pose(blank("geometry_msgs/msg/Pose"), pose)
    assert np.allclose(pose_of(filled.position, filled.orientation), [1.0, -2.0, 0.3, 2.5, 0.0])
    goal = SimpleNamespace(viewpoint=pose)
    marker = fill_marker(blank("visualization_msgs/msg/Marker"), goal, 2)
    assert (marker.ns, marker.id, marker.action, marker.pose.position.y) == ("goals", 2, 0, -2.0)
    assert fill_marker(blank("visualization_msgs/msg/Marker"), None, 2).action == 2


def test_statuses_say_how_drives_ended():
    ends = [move_end_of(status) for status in (SUCCEEDED, CANCELED, ABORTED)]
    assert ends == [MoveEnd.ARRIVED, MoveEnd.FAILED, MoveEnd.OBSTACLE]


def test_an_aborted_goal_is_not_sent_again():
    seen = np.full(plan_by_hand().shape, -1, np.int8)
    look(plan_by_hand(), seen, START)
    navigation, at = Navigation(1), fill_pose(blank("geometry_msgs/msg/Pose"), START)
    assert navigation.decide(0, 0.0) is None and not navigation.idle()
    navigation.hear_pose(0, at.position, at.orientation)
    assert navigation.hear_map(grid_message(seen))
    first = navigation.decide(0, 1.0)
    assert not navigation.idle()
    navigation.end(0, ABORTED)
    second = navigation.decide(0, 2.0)
    assert np.linalg.norm(first.viewpoint[:2] - second.viewpoint[:2]) > EDGE_M


def test_what_cannot_be_used_is_said():
    navigation = Navigation(1)
    far = fill_pose(blank("geometry_msgs/msg/Pose"), np.array([90.0, 0.0, 0.0, 0.0, 0.0]))
    navigation.hear_pose(0, far.position, far.orientation)
    assert not navigation.hear_map(grid_message(np.full((4, 5), -1, np.int8)))
    assert "something is known" in navigation.trouble
    assert not navigation.idle() and navigation.decide(0, 1.0) is None
    coarse = grid_message(np.ones((40, 50), np.int8))  # one per cent everywhere
    coarse.info.resolution = 2.0 * EDGE_M
    assert navigation.hear_map(coarse)
    assert navigation.decide(0, 1.0) is None and "a place on the map" in navigation.trouble
    assert not navigation.finished


class Future(SimpleNamespace):
    """A future that is done."""

    def add_done_callback(self, call):
        call(self)

    def result(self):
        return self.value


class World:
    """What the false rclpy shares: the plan, what is seen of it, and where the robots are."""

    def __init__(self, poses, aborts=0):
        self.solid, self.aborts = plan_by_hand(), aborts
        self.seen = np.full(self.solid.shape, -1, np.int8)
        self.poses, self.sent, self.logged, self.markers = poses, [], [], []
        self.now_s, self.parameters = 0.0, {}
        self.tick: Callable = print  # set by the node
        self.hear_map: Callable = print
        for pose in poses.values():
            look(self.solid, self.seen, pose)

    def drive(self, frame, goal):
        self.sent.append((frame, np.array([goal.pose.pose.position.x, goal.pose.pose.position.y])))
        if self.aborts > 0:
            self.aborts -= 1
            return ABORTED
        pose = pose_of(goal.pose.pose.position, goal.pose.pose.orientation)
        self.poses[frame] = pose
        look(self.solid, self.seen, pose)
        return SUCCEEDED


def modules_of(world):
    """The modules that the node imports, on a world."""

    class Node:
        def __init__(self, name):
            self._values = {}

        def declare_parameter(self, name, value):
            self._values[name] = world.parameters.get(name, value)

        def get_parameter(self, name):
            return SimpleNamespace(value=self._values[name])

        def create_subscription(self, kind, topic, call, qos):
            world.hear_map = call

        def create_publisher(self, kind, topic, depth):
            return SimpleNamespace(publish=world.markers.append)

        def create_timer(self, period_s, call):
            world.tick = call

        def get_clock(self):
            now = SimpleNamespace(nanoseconds=int(world.now_s * 1e9), to_msg=lambda: None)
            return SimpleNamespace(now=lambda: now)

        def get_logger(self):
            return SimpleNamespace(info=world.logged.append, warning=world.logged.append)

    class ActionClient:
        def __init__(self, node, kind, name):
            self.frame = name.replace("navigate_to_pose", "base_link")

        def server_is_ready(self):
            return True

        def send_goal_async(self, goal):
            status = SimpleNamespace(status=world.drive(self.frame, goal))
            handle = SimpleNamespace(accepted=True, get_result_async=lambda: Future(value=status))
            return Future(value=handle)

    class Buffer:
        def lookup_transform(self, above, frame, time):
            if frame not in world.poses:
                raise LookupError
            at = fill_pose(blank("geometry_msgs/msg/Pose"), world.poses[frame])
            return SimpleNamespace(
                transform=SimpleNamespace(translation=at.position, rotation=at.orientation)
            )

    def made(name, **content):
        module = ModuleType(name)
        module.__dict__.update(content)
        return module

    goal = SimpleNamespace(Goal=lambda: blank("nav2/msg/Goal"))
    return [
        made("rclpy", time=SimpleNamespace(Time=lambda: None)),
        made("rclpy.action", ActionClient=ActionClient),
        made("rclpy.node", Node=Node),
        made(
            "rclpy.qos",
            DurabilityPolicy=SimpleNamespace(TRANSIENT_LOCAL=1),
            QoSProfile=lambda **_: None,
        ),
        made("nav2_msgs.action", NavigateToPose=goal),
        made("nav_msgs.msg", OccupancyGrid=object),
        made("tf2_ros", Buffer=Buffer, TransformException=LookupError, TransformListener=lambda *_: None),
        made(
            "visualization_msgs.msg",
            Marker=lambda: blank("visualization_msgs/msg/Marker"),
            MarkerArray=lambda markers: markers,
        ),
    ]


def node_in(world, monkeypatch, **parameters):
    world.parameters = parameters
    for module in modules_of(world):
        monkeypatch.setitem(sys.modules, module.__name__, module)
    for package in ("nav2_msgs", "nav_msgs", "visualization_msgs"):
        monkeypatch.setitem(sys.modules, package, ModuleType(package))
    spec = importlib.util.spec_from_file_location("explorer_node", NODE)
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module.ExplorerNode()


@pytest.mark.parametrize("robots", [1, 2])
def test_the_node_explores_a_plan_and_says_when_nothing_is_left(monkeypatch, robots):
    frames = ["base_link"] if robots == 1 else ["a/base_link", "b/base_link"]
    start = START + np.arange(robots)[:, None] * np.array([0.0, 1.2, 0.0, 0.0, 0.0])
    world = World(dict(zip(frames, start, strict=True)), aborts=1)
    names = [""] if robots == 1 else ["a", "b"]
    assert node_in(world, monkeypatch, robots=names) is not None
    world.tick()
    assert not world.sent
    for _ in range(40):
        world.hear_map(grid_message(world.seen))
        world.now_s += 1.0
        world.tick()
        if any("nothing reachable is left" in text for text in world.logged):
            break
    assert "nothing reachable is left" in world.logged[-1], world.logged
    assert (world.seen[~world.solid] == 0).all()
    assert {frame for frame, _ in world.sent} == set(frames)
    first, second = [goal for frame, goal in world.sent if frame == frames[0]][:2]
    assert np.linalg.norm(first - second) > EDGE_M  # the first one was aborted
    assert world.markers[0][0].action == 0 and world.markers[-1][0].action == 2
    assert len(NODE.read_text("utf-8").splitlines()) <= 200
    assert math.isfinite(world.now_s)

"""A ROS 2 node that explores with Nav2: a map and poses in, NavigateToPose goals and markers out.

It listens to `map` (OccupancyGrid of a SLAM), looks the robots' poses up in tf, and sends each idle robot to
the goal that the Explorer chooses. A goal that Nav2 aborts or refuses is not tried again at once. What it
decides is `entropy_explore_env.explorer.navigation`; this file ties it to rclpy.
"""

from __future__ import annotations

import math
from functools import partial
from typing import Any

import rclpy
from nav2_msgs.action import NavigateToPose
from nav_msgs.msg import OccupancyGrid
from rclpy.action import ActionClient
from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, QoSProfile
from tf2_ros import Buffer, TransformException, TransformListener
from visualization_msgs.msg import Marker, MarkerArray

from entropy_explore_env import RangeSensor, Robot
from entropy_explore_env.explorer.goals import Goal
from entropy_explore_env.explorer.navigation import Navigation, fill_marker, fill_pose

PARAMETERS = {
    "robots": [""],  # namespaces; an empty one = no namespace
    "base_frame": "base_link",
    "map_frame": "map",
    "period_s": 1.0,
    "radius_m": 0.3,
    "max_speed_m_s": 0.5,
    "max_range_m": 8.0,
    "field_of_view_rad": 2.0 * math.pi,
    "angular_step_rad": math.pi / 90.0,
    "seed": 0,
}


class ExplorerNode(Node):
    """Sends robots to where there is something to see."""

    def __init__(self) -> None:
        """Declare the parameters, subscribe, and begin to decide."""
        super().__init__("explorer")
        for name, value in PARAMETERS.items():
            self.declare_parameter(name, value)
        self._names = list(self._value("robots"))
        robot = Robot(
            motion="planar",
            navigator="planned",
            reach_m=math.inf,
            max_speed_m_s=self._value("max_speed_m_s"),
            body_radius_m=self._value("radius_m"),
        )
        sensor = RangeSensor(
            (self._value("field_of_view_rad"), 0.0),
            self._value("angular_step_rad"),
            max_range_m=self._value("max_range_m"),
        )
        self._navigation = Navigation(len(self._names), robot, sensor, self._value("seed"))
        self._clients = [
            ActionClient(self, NavigateToPose, f"{name}/navigate_to_pose".lstrip("/")) for name in self._names
        ]
        self._transforms = Buffer()
        self._listener = TransformListener(self._transforms, self)
        latched = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
        self.create_subscription(OccupancyGrid, "map", self._hear_map, latched)
        self._markers = self.create_publisher(MarkerArray, "exploration_goals", 1)
        self.create_timer(self._value("period_s"), self._tick)
        self._said = ""

    def _value(self, name: str) -> Any:  # noqa: ANN401
        return self.get_parameter(name).value

    def _hear_map(self, message: OccupancyGrid) -> None:
        if not self._navigation.hear_map(message):
            self.get_logger().warning(self._navigation.trouble)

    def _hear_poses(self) -> None:
        """Look up where the robots are; those without a transform are silent."""
        for robot, name in enumerate(self._names):
            frame = f"{name}/{self._value('base_frame')}".lstrip("/")
            try:
                found = self._transforms.lookup_transform(self._value("map_frame"), frame, rclpy.time.Time())
            except TransformException:
                self._navigation.forget_pose(robot)
                continue
            self._navigation.hear_pose(robot, found.transform.translation, found.transform.rotation)

    def _tick(self) -> None:
        """Send the robots that wait to their goals."""
        self._hear_poses()
        for robot in self._navigation.idle():
            if not self._clients[robot].server_is_ready():
                continue
            goal = self._navigation.decide(robot, self.get_clock().now().nanoseconds * 1e-9)
            if self._navigation.trouble:
                self.get_logger().warning(f"robot {robot}: {self._navigation.trouble}")
            else:
                self._mark(robot, goal)
            if goal is not None:
                self._send(robot, goal)
        if self._navigation.finished:
            self._say("nothing reachable is left: " + " ".join(set(filter(None, self._navigation.left))))

    def _say(self, text: str) -> None:
        """Log a text once."""
        if text != self._said:
            self.get_logger().info(text)
        self._said = text

    def _send(self, robot: int, goal: Goal) -> None:
        """Send a goal to Nav2."""
        message = NavigateToPose.Goal()
        message.pose.header.frame_id = self._value("map_frame")
        message.pose.header.stamp = self.get_clock().now().to_msg()
        fill_pose(message.pose.pose, goal.viewpoint)
        x, y = goal.viewpoint[:2]
        self._say(f"robot {robot} → ({x:.2f}, {y:.2f}), {goal.expected_bits:.0f} bits, {goal.seconds:.0f} s")
        self._clients[robot].send_goal_async(message).add_done_callback(partial(self._accepted, robot))

    def _accepted(self, robot: int, future: Any) -> None:  # noqa: ANN401
        """Follow a goal that was accepted."""
        handle = future.result()
        if handle is None or not handle.accepted:
            self.get_logger().warning(f"robot {robot}: Nav2 refused the goal")
            self._navigation.refuse(robot)
            return
        handle.get_result_async().add_done_callback(partial(self._ended, robot))

    def _ended(self, robot: int, future: Any) -> None:  # noqa: ANN401
        """Note how a drive ended; the next goal follows at the next tick."""
        self._navigation.end(robot, future.result().status)

    def _mark(self, robot: int, goal: Goal | None) -> None:
        """Publish an arrow at a robot's goal."""
        marker = fill_marker(Marker(), goal, robot)
        marker.header.frame_id = self._value("map_frame")
        marker.header.stamp = self.get_clock().now().to_msg()
        self._markers.publish(MarkerArray(markers=[marker]))


def main() -> None:
    """Run the node until it is stopped."""
    rclpy.init()
    node = ExplorerNode()
    try:
        rclpy.spin(node)
    except KeyboardInterrupt:
        pass
    finally:
        node.destroy_node()
        rclpy.try_shutdown()

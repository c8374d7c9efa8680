"""Starts the node with its parameters: `ros2 launch entropy_explore_ros explorer.launch.py`."""

from __future__ import annotations

from pathlib import Path

from ament_index_python.packages import get_package_share_directory
from launch import LaunchDescription
from launch_ros.actions import Node


def generate_launch_description() -> LaunchDescription:
    """Return the node of this package."""
    parameters = Path(get_package_share_directory("entropy_explore_ros")) / "config" / "explorer.yaml"
    node = Node(
        package="entropy_explore_ros",
        executable="explorer_node",
        name="explorer",
        output="screen",
        parameters=[str(parameters)],
    )
    return LaunchDescription([node])

"""Builds the ROS 2 package with colcon."""

from pathlib import Path

from setuptools import setup

NAME = "entropy_explore_ros"

setup(
    name=NAME,
    version="0.3.0",
    packages=[NAME],
    data_files=[
        ("share/ament_index/resource_index/packages", [f"resource/{NAME}"]),
        (f"share/{NAME}", ["package.xml"]),
        (f"share/{NAME}/launch", [str(path) for path in Path("launch").glob("*.py")]),
        (f"share/{NAME}/config", [str(path) for path in Path("config").glob("*.yaml")]),
    ],
    install_requires=["entropy_explore_env"],
    entry_points={"console_scripts": [f"explorer_node = {NAME}.explorer_node:main"]},
)

"""Scratch memory of a step, one for each thread: nothing in it is state."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import NamedTuple

import numpy as np

from entropy_explore_env.belief.map_update import Scan
from entropy_explore_env.belief.raycast import Crossing, longest_crossing
from entropy_explore_env.missions.backlog import Selection, new_selection
from entropy_explore_env.missions.records import WAYPOINTS
from entropy_explore_env.missions.scan_log import ScanLog, new_scan_log
from entropy_explore_env.robots.map_summary import new_summary_tree
from entropy_explore_env.robots.map_tree import Tree
from entropy_explore_env.robots.navigator import Navigator, footprints
from entropy_explore_env.robots.range_sensor import new_scan
from entropy_explore_env.settings.scenario import Scenario


class Workspace(NamedTuple):
    """Scratch memory of one thread."""

    scan: Scan
    drive: Crossing
    """Voxels on the longest drive."""
    braking: np.ndarray | None
    """(W, 3) float64, points on which a robot comes to rest; None = no robot of the team decides under way,
    and nothing of that is compiled."""
    bodies: np.ndarray
    """(A, 4) float64, teammates' bodies: centre and radius in grid units."""
    recipients: np.ndarray
    """(A,) bool, whom a message reaches."""
    air: Crossing | None
    """Voxels between two robots; None = the channel reaches by distance alone: nothing else is compiled."""
    tree: Tree | None
    """For summaries of maps; None = robots send none: nothing of that is compiled."""
    selection: Selection | None
    """For messages by need; None = robots send none: nothing of that is compiled."""
    footprints: np.ndarray
    """(K, B, 3) int64, offsets of the voxels that bodies of each kind of robot touch; B = 0 if none plans."""
    covariances: np.ndarray | None
    """(2, 4, 4) float64; None = no robot chooses landmarks in its own map: nothing of that is compiled."""
    log: ScanLog
    """All scans, where `Missions.log_scans` was called; else no room for any."""


def new_workspace(scenario: Scenario, navigators: Mapping[int, Navigator]) -> Workspace:
    """Return scratch memory for steps of a scenario, with the navigators of its kinds of robots that plan."""
    kinds, grid = scenario.kinds, scenario.grid
    sensors, robots = [kind.sensor for kind in kinds], [kind.robot for kind in kinds]
    longest_m = max(math.inf if robot.navigator == "planned" else robot.reach_m for robot in robots)
    longest = longest_crossing(*grid.shape, longest_m / grid.voxel_size_m, 1)
    return Workspace(
        scan=new_scan(grid, sensors, max(sensor.rays for sensor in sensors)),
        drive=Crossing(np.zeros(longest, np.int32), np.zeros(longest, np.int64)),
        braking=np.zeros((WAYPOINTS, 3)) if any(robot.redecide != "at_stop" for robot in robots) else None,
        bodies=np.zeros((scenario.robots, 4)),
        recipients=np.zeros(scenario.robots, np.bool_),
        air=_new_air(scenario),
        tree=new_summary_tree(grid.voxels) if scenario.shares_summaries else None,
        selection=new_selection(scenario),
        footprints=footprints(navigators, len(kinds))
        if navigators
        else np.zeros((len(kinds), 0, 3), np.int64),
        covariances=np.zeros((2, 4, 4)) if scenario.drifts and scenario.fiducials.own_number else None,
        log=new_scan_log(0, 0),
    )


def _new_air(scenario: Scenario) -> Crossing | None:
    """Return scratch memory for lines between robots, if the channel needs them."""
    if scenario.channel.reach == "distance":
        return None
    longest = longest_crossing(*scenario.grid.shape, math.inf, 1)
    return Crossing(np.zeros(longest, np.int32), np.zeros(longest, np.int64))

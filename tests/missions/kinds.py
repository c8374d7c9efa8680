"""A scenario for all that the state of a mission may hold: what holds for every mission is tested on each."""

import math
from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from entropy_explore_env.missions.simulation import Missions
from entropy_explore_env.missions.state import MissionState
from entropy_explore_env.reports.state_digest import state_digest
from entropy_explore_env.settings.robot import Robot
from entropy_explore_env.settings.robot_kind import RobotKind
from entropy_explore_env.settings.scenario import Scenario
from entropy_explore_env.settings.scenarios import BOX
from entropy_explore_env.settings.sensor import RangeSensor
from entropy_explore_env.worlds.world import World
from tests.reference.scenes import free_box, wander

DRIFT = {"xy_m_per_sqrt_m": 0.05, "z_m_per_sqrt_m": 0.02, "yaw_rad_per_sqrt_m": 0.02}
FAULTS = {
    "stop": {"mean_s": 20.0, "lasts_s": 3.0},
    "blind": {"mean_s": 15.0, "lasts_s": 6.0},
    "silent": {"mean_s": 10.0, "lasts_s": 5.0, "robots": (0, 2)},
    "sensor": {"lost_rays": 0.2, "range_factor": 1.05, "range_bias_m": -0.02, "robots": (1,)},
    "radio": {"garbled": 0.2, "repeated": 0.3, "late": 0.3, "late_s": 4.0},
}
GROUND = RobotKind(
    Robot(
        motion="planar",
        reach_m=1.2,
        max_speed_m_s=0.3,
        acceleration_m_s2=0.2,
        turn_rate_rad_s=0.7,
        body_radius_m=0.0,
        sensor_height_m=0.9,
    ),
    RangeSensor((math.pi, 0.0), math.pi / 12, max_range_m=2.5, sigma_min=0.2, range_noise_m=0.1),
)
SCOUT = RobotKind(
    Robot(reach_m=0.8, max_speed_m_s=1.0, acceleration_m_s2=1.5, body_radius_m=0.0, navigator="planned"),
    RangeSensor((math.pi / 6, math.pi / 6), math.pi / 30, voxels_behind=0, scan_time_s=0.8, scan_every_m=0.3),
)
LATE = {"delay_s": 3.0, "i_min_bits": 0.0}
SUMMARIES = {"content": "summaries", "summary_every_s": 1.0}
WANDERERS = free_box(
    robots=3,
    world="furnished",
    robot={"navigator": "planned", "reach_m": math.inf, "body_radius_m": 0.2},
    sensor={"scan_every_m": 0.4, "field_of_view_rad": (2.0, 0.5)},
    channel={"delay_s": 0.7, "i_min_bits": 0.0},
    decision_period_s=0.7,
    ending={"sigma_end": 1e-3},
)
CANDIDATES = free_box(
    action={"kind": "candidates", "candidates": 9},
    observation={"panorama": False, "action_mask": True, "overlaps": True},
)


def under_way(redecide: str | float) -> Scenario:
    """Return a team that decides again while it drives."""
    robot = {"navigator": "planned", "redecide": redecide, "reach_m": 3.0}
    return free_box(robot=robot, sensor={"scan_every_m": 0.3}, decision_period_s=0.3)


def unsure() -> Scenario:
    """Return a team that drifts past glass, sights its own landmarks, loses late summaries, and fails."""
    return free_box(
        robots=3,
        robot={"localization": {**DRIFT, "yaw_rad_per_sqrt_m": 0.05}},
        sensor={
            "field_of_view_rad": (1.6, 1.0),
            "angular_step_rad": 0.2,
            "scan_every_m": 0.4,
            "range_noise_m": 0.02,
        },
        fiducials={"number": 30, "own_number": 4, "own_score": 0.1},
        channel={**SUMMARIES, "delay_s": 0.4, "loss_probability": 0.2, "reach": "line_of_sight"},
        faults=FAULTS,
        decision_period_s=1.0,
        track_truth=True,
    )


def partly_unreadable() -> World:
    """Return the box with two blocks in it: one gives no return, and neither does a wall's lower half."""
    occupied, unreadable = np.zeros(BOX.grid.shape, bool), np.zeros(BOX.grid.shape, bool)
    occupied[2, 7:9, :3] = occupied[5, 2:4, :] = occupied[:, 10, :] = True
    unreadable[2, 7:9, :3] = unreadable[:, 10, :2] = True
    return World(BOX.grid, occupied, "half glass", unreadable=unreadable)


class Kind(NamedTuple):
    """A scenario, and whether what it is there for has happened in a mission."""

    scenario: Scenario
    happened: Callable[[MissionState], object]
    given: tuple[World, ...] = ()


KINDS = {
    "late messages": Kind(
        free_box(channel=LATE, track_truth=True, observation={"overview": True}),
        lambda state: np.isfinite(state.in_flight["due_s"]).any(),
    ),
    "phases": Kind(
        free_box(channel={"phase_s": 4.0, "repeats": 2, "loss_probability": 0.3, "i_min_bits": 0.0}),
        lambda state: state.phases["broadcasts"].any(),
    ),
    "summaries": Kind(
        free_box(robots=3, channel={**SUMMARIES, "delay_s": 3.0, "loss_probability": 0.2}, faults=FAULTS),
        lambda state: state.summaries["sent"].all(),
    ),
    "drift": Kind(
        free_box(
            robots=3,
            robot={"localization": {**DRIFT, "yaw_rad_per_sqrt_rad": 0.02}, "redecide": "on_scan"},
            sensor={"scan_every_m": 0.4, "range_noise_m": 0.02},
            channel={"i_min_bits": 0.0, "loss_probability": 0.1, "delay_s": 0.3},
            fiducials={"number": 4},
            decision_period_s=1.0,
        ),
        lambda state: state.estimates["sightings"].any() and state.estimates["error"].all(),
    ),
    "everything at once": Kind(
        unsure(),
        lambda state: state.landmarks["used"].any() and (state.truth == 2.0).any(),
        (partly_unreadable(),),
    ),
    "faults": Kind(
        free_box(robots=3, faults=FAULTS, channel={"i_min_bits": 0.0, "loss_probability": 0.1}),
        lambda state: all(
            state.faults[name].any()
            for name in "stopped blind_scans rays_lost messages_silenced messages_garbled".split()
        ),
    ),
    "need": Kind(
        free_box(
            robots=3,
            robot={"localization": DRIFT},
            channel={"order": "need", "loss_probability": 0.5, "i_min_bits": 0.1, "i_min_fill": 0.5},
        ),
        lambda state: state.backlog_heard_s.any() and state.backlog_covariances.any(),
    ),
    "candidates": Kind(CANDIDATES, lambda state: state.experience["decided_s"].any()),
    "planned paths": Kind(WANDERERS, lambda state: state.robots["corners"].any()),
    "decisions on scans": Kind(under_way("on_scan"), lambda state: state.robots["lead_s"].any()),
    "decisions in time": Kind(under_way(0.4), lambda state: state.robots["lead_s"].any()),
    "two kinds of robots": Kind(
        free_box(
            robots=3,
            robot=GROUND.robot,
            sensor=GROUND.sensor,
            extra_kinds=(SCOUT,),
            world="furnished",
            ending={"sigma_end": 1e-3, "time_limit_s": math.inf},
        ),
        lambda state: (state.robots["scans"] > 5).all(),
    ),
}


def walked(kind: str, steps: int, seed: int = 1, missions: int = 2) -> Missions:
    """Return missions of a kind after this many steps of random actions."""
    these = Missions(KINDS[kind].scenario, missions, given=KINDS[kind].given)
    these.reset_some(range(missions), range(seed, seed + missions))
    wander(these, steps, seed)
    return these


def everything(missions: Missions) -> tuple[object, ...]:
    """All that a step may change."""
    digests = [state_digest(missions, mission) for mission in range(missions.count)]
    return digests, missions.seeds, missions.episodes, missions.observations.tobytes()

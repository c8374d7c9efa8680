"""Bodies neither overlap nor enter what is solid, wherever drives lead."""

import math

import numpy as np
import pytest

from entropy_explore_env.missions.poses import pose_at
from entropy_explore_env.robots.motion import MoveEnd
from entropy_explore_env.settings.changes import with_settings
from entropy_explore_env.settings.robot import Robot
from entropy_explore_env.settings.robot_kind import RobotKind
from entropy_explore_env.settings.scenarios import OFFICE, ROOM_FURNISHED
from entropy_explore_env.settings.sensor import RangeSensor
from tests.reference.scenes import ENDLESS, NO_PARTS, TIGHT, free_box, started, wander

SCANNING = with_settings(
    ROOM_FURNISHED,
    {
        "robots": 5,
        "robot": {"body_radius_m": 0.4, "reach_m": 9.0, "max_speed_m_s": 1.0, "navigator": "planned"},
        "sensor": {"angular_step_rad": math.pi / 12, "scan_every_m": 0.5},
        "decision_period_s": 0.1,
        "observation": NO_PARTS,
        "ending": ENDLESS,
    },
)
BODIES = [
    RobotKind(
        Robot(reach_m=3.0, body_radius_m=radius_m, navigator=navigates, max_speed_m_s=speed_m_s),
        RangeSensor((0.0, 0.0), 0.1),
    )
    for radius_m, navigates, speed_m_s in (
        (0.1, "planned", 0.3),
        (0.24, "straight", 0.9),
        (0.45, "planned", 0.5),
    )
]
THREE_SIZES = free_box(
    robots=6,
    world="furnished",
    robot=BODIES[0].robot,
    sensor=BODIES[0].sensor,
    extra_kinds=tuple(BODIES[1:]),
    decision_period_s=0.6,
    observation=NO_PARTS,
    ending=ENDLESS,
)
OFFICE_CROWD = {
    "robots": 5,
    "robot": {"reach_m": 6.0, "body_radius_m": 0.25},
    "sensor": {"angular_step_rad": math.pi / 30},
    "decision_period_s": None,
    "observation": {**NO_PARTS, "patch": True, "patch_shape": (1, 1, 1)},
    "ending": ENDLESS,
}
CROWDS = {
    "big bodies in the tiny box": (with_settings(TIGHT, {"ending": ENDLESS}), 100),
    "a plan": (with_settings(OFFICE, OFFICE_CROWD), 150),
    "scans that end planned drives": (SCANNING, 900),
    "three sizes that plan": (THREE_SIZES, 240),
}


@pytest.mark.parametrize("crowd", CROWDS)
def test_bodies_never_overlap_and_never_stand_in_solid_voxels(crowd):
    """At any time within a step; where scans under way may end a drive, when a step ends."""
    scenario, steps = CROWDS[crowd]
    missions, kinds = started(scenario, seed=6), [scenario.kind_of(a) for a in range(scenario.robots)]
    radii = np.array([kind.robot.body_radius_m for kind in kinds])
    blocked = [missions.worlds[0].layout(scenario, kind).collision_mask > 0 for kind in kinds]
    robots, grid, params = missions.state.robots[0], missions.grid, missions.rules.params
    looks = 9 if math.isinf(scenario.sensor.scan_every_m) else 1
    pairs, closest, before_s, ends = np.triu_indices(len(radii), 1), math.inf, 0.0, set()

    def look(_step):
        nonlocal before_s, closest
        now_s = missions.state.missions[0]["time_s"]
        for time_s in np.linspace(now_s, before_s, looks, endpoint=False):
            places = np.array([pose_at(*each, time_s)[:3] for each in zip(params, robots, strict=True)])
            apart = np.linalg.norm(places[:, None] - places[None], axis=-1) - radii[:, None] - radii
            closest = min(closest, apart[pairs].min())
            assert closest >= 0.0
            voxels = grid.voxel_of(places)
            assert ((voxels >= 0) & (voxels < grid.shape)).all()
            assert not any(mask[tuple(voxel)] for mask, voxel in zip(blocked, voxels, strict=True))
        before_s = now_s
        ends.update(list(MoveEnd)[end].name for end in robots["move_end"][robots["deciding"]])

    wander(missions, steps, 3, look)
    assert closest < 0.1 * 2 * radii.max()  # they did meet
    assert "TEAMMATE" in ends and ends & {"ARRIVED", "SEEN"} and robots["blocked_moves"].min() > 1
    assert ("NO_PATH" in ends) == (scenario.robot.navigator == "planned")

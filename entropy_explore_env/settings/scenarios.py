"""The named scenarios: one frozen Scenario each."""

from __future__ import annotations

import dataclasses
import math
from types import MappingProxyType

from entropy_explore_env.errors import SettingError, one_of
from entropy_explore_env.settings.channel import Channel, Signal
from entropy_explore_env.settings.ending import Ending
from entropy_explore_env.settings.grid import Grid
from entropy_explore_env.settings.reward import Reward
from entropy_explore_env.settings.robot import Robot
from entropy_explore_env.settings.robot_kind import RobotKind
from entropy_explore_env.settings.scenario import Scenario
from entropy_explore_env.settings.sensor import RangeSensor
from entropy_explore_env.settings.validation import is_whole

COST_PER_S_ALONE = MappingProxyType(
    {
        "room": 0.00247,
        "room-furnished": 0.000886,
        "box-7x11x5": 0.00727,
        "office": 0.000346,
        "office-signal": 0.000346,
        "office-3d": 0.000268,
        "corridor": 0.0005,
        "cluttered": 0.000574,
        "hybrid": 0.000244,
        "cave": 0.000657,
        "terrain": 0.000112,
        "terrain-smooth": 0.000109,
        "terrain-rough": 0.000107,
        "lab": 0.000812,
        "bhattacharya-office": 0.000584,
    }
)
"""Name → `Reward.cost_per_s` where one robot explores a scenario of a team, which takes longer.

These numbers and those beside the scenarios are 0.2 over the median time of a good strategy's missions: a
mission as long as that returns about 0.8, one twice as long 0.6. With each robot's own reward,
`kind="individual"`, it is less by what teammates sent: as a mean over three robots that share, about 0.2."""

_ROOM_GRID = Grid((41, 41, 17), 0.25, (-0.125, -0.125, -0.125))
"""Voxel centres on 0, 0.25, …, 10 m: 28,577 voxels, as Rocha04's H(0) and H_th ask for."""

ROOM = Scenario(
    name="room",
    reward=Reward("team", 0.00606),
    grid=_ROOM_GRID,
    world="empty",
    robot=Robot(turn_rate_rad_s=math.inf),
)
"""Rocha04's room, tables 1-2: 10 × 10 × 4 m, empty. Its turn rate is unlimited and its scan takes
0.5 s, neither of which the paper gives; the walls stand on the outer faces of the outer voxels."""

ROOM_FURNISHED = Scenario(
    name="room-furnished", reward=Reward("team", 0.00326), grid=_ROOM_GRID, world="furnished"
)
"""The same room with boxes on its floor, drawn from the seed; robots turn at π/2 rad/s."""

BOX = Scenario(
    name="box-7x11x5",
    reward=Reward("team", 0.0112),
    grid=Grid((7, 11, 5), 0.5),
    world="empty",
    robots=2,
    robot=Robot(reach_m=1.0, max_speed_m_s=0.5, acceleration_m_s2=0.5),
    sensor=RangeSensor((math.pi / 6, math.pi / 12), math.pi / 36),
    channel=Channel(burst=8, i_min_bits=0.1),
)
"""A tiny box of 3.5 × 5.5 × 2.5 m with no two edges equal, for tests and examples."""

_LIDAR = RangeSensor((2 * math.pi, 0.0), math.pi / 90, max_range_m=8.0)
"""A planar scanner, 180 rays all around, for the 2-D worlds whose papers do not give one."""
_WHEELED = Robot(
    motion="planar",
    navigator="planned",
    reach_m=5.0,
    max_speed_m_s=0.5,
    acceleration_m_s2=0.5,
    body_radius_m=0.3,
    sensor_height_m=0.3,
)
"""A ground robot of a Pioneer 3-DX's size, which Sawhney explores with. Its reach leads from a room into
the next one; `reach_m=math.inf` is for strategies that choose goals in the whole workspace."""

OFFICE = Scenario(
    name="office",
    reward=Reward("team", 0.000865),
    grid=Grid((240, 180, 1), 0.1),
    world="office",
    robot=_WHEELED,
    sensor=_LIDAR,
    ending=Ending(time_limit_s=3600.0),
)
"""24 × 18 m of rooms and corridors, 2-D."""

OFFICE_SIGNAL = dataclasses.replace(
    OFFICE,
    name="office-signal",
    reward=Reward("team", 0.00037),
    robots=4,
    channel=Channel(
        burst=180,
        i_min_bits=0.0,
        reach="signal",
        signal=Signal(budget_db=25.0, exponent=2.5, wall_loss_db_per_m=60.0),
    ),
    ending=Ending(termination="shared", time_limit_s=3600.0),
)
"""The same for four robots that have to meet to share: whole scans reach a teammate within 10 m in the open,
and within 3 m behind 0.2 m of wall. A mission lasts until every robot has the map."""

OFFICE_3D = Scenario(
    name="office-3d",
    reward=Reward("team", 0.000443),
    grid=Grid((96, 72, 10), 0.25),
    world="office",
    robot=Robot(
        navigator="planned", reach_m=3.0, max_speed_m_s=0.5, acceleration_m_s2=0.5, body_radius_m=0.3
    ),
    sensor=RangeSensor((math.pi / 2, math.pi / 3), math.pi / 60, max_range_m=6.0),
    ending=Ending(time_limit_s=7200.0),
)
"""24 × 18 × 2.5 m with furniture, for flying robots with depth cameras."""

OFFICE_MIXED = dataclasses.replace(
    OFFICE_3D,
    name="office-mixed",
    reward=Reward("team", 0.000365),
    robot=dataclasses.replace(_WHEELED, reach_m=OFFICE_3D.robot.reach_m),
    sensor=RangeSensor((2 * math.pi, math.pi / 6), math.pi / 60, max_range_m=8.0),
    extra_kinds=(RobotKind(OFFICE_3D.robot, OFFICE_3D.sensor),),
)
"""The same office for mixed teams: ground robots with a scanner, 120 × 11 rays all around, take turns with
the flying ones."""

CORRIDOR = Scenario(
    name="corridor",
    reward=Reward("team", 0.00131),
    grid=Grid((300, 200, 1), 0.1),
    world="corridor",
    robot=_WHEELED,
    sensor=_LIDAR,
    ending=Ending(time_limit_s=3600.0),
)
"""30 × 20 m of corridors, 2-D."""

CLUTTERED = Scenario(
    name="cluttered",
    reward=Reward("team", 0.00212),
    grid=Grid((200, 160, 1), 0.1),
    world="cluttered",
    robot=_WHEELED,
    sensor=_LIDAR,
    ending=Ending(time_limit_s=3600.0),
)
"""20 × 16 m of convex obstacles, 2-D."""

HYBRID = Scenario(
    name="hybrid",
    reward=Reward("team", 0.000585),
    grid=Grid((320, 240, 1), 0.1),
    world="hybrid",
    robot=_WHEELED,
    sensor=_LIDAR,
    ending=Ending(time_limit_s=7200.0),
)
"""32 × 24 m: office, corridors and clutter side by side, 2-D."""

CAVE = Scenario(
    name="cave",
    reward=Reward("team", 0.00108),
    grid=Grid((80, 60, 25), 0.4),
    world="cave",
    robot=Robot(
        navigator="planned", reach_m=4.0, max_speed_m_s=1.0, acceleration_m_s2=1.0, body_radius_m=0.3
    ),
    sensor=RangeSensor((math.pi / 2, math.pi / 3), math.pi / 60, max_range_m=10.0),
    ending=Ending(time_limit_s=7200.0),
)
"""32 × 24 × 10 m of halls and tunnels, for flying robots with depth cameras."""

TERRAIN = Scenario(
    name="terrain",
    reward=Reward("team", 0.000152),
    grid=Grid((96, 72, 24), 1.0),
    world="terrain",
    robot=Robot(reach_m=6.0, max_speed_m_s=3.0, acceleration_m_s2=2.0, body_radius_m=0.3),
    sensor=RangeSensor((math.pi / 2, math.pi / 2), math.pi / 45, max_range_m=20.0),
    ending=Ending(time_limit_s=3600.0),
)
"""96 × 72 m of hills up to 18 m high, for UAVs that stay below the exposure surface (Sawhney)."""

TERRAIN_SMOOTH = dataclasses.replace(
    TERRAIN, name="terrain-smooth", world="terrain-smooth", reward=Reward("team", 0.000144)
)
"""The same, gentler: Hurst exponent 0.95 instead of 0.8."""

TERRAIN_ROUGH = dataclasses.replace(
    TERRAIN, name="terrain-rough", world="terrain-rough", reward=Reward("team", 0.000162)
)
"""The same, rugged: Hurst exponent 0.5."""

OCCLUSIONS = Scenario(
    name="occlusions",
    reward=Reward("team", 0.000136),
    grid=Grid((200, 200, 1), 0.5),
    world="occlusions",
    robots=1,
    robot=Robot(
        motion="planar",
        navigator="planned",
        reach_m=15.0,
        max_speed_m_s=1.0,
        acceleration_m_s2=1.0,
        body_radius_m=0.3,
    ),
    sensor=RangeSensor((math.pi / 2, 0.0), math.pi / 180, max_range_m=15.0),
    ending=Ending(time_limit_s=10_000.0),
)
"""Sujan's 100 × 100 m with convex occlusions, one robot with a view of 90° and 15 m. Cells of 0.5 m, speed
and reach are ours; with two robots the paper takes 75° and 10 m."""

CLIFF = Scenario(
    name="cliff",
    reward=Reward("team", 0.000227),
    grid=Grid((120, 96, 36), 0.125),
    world="cliff",
    robots=1,
    robot=Robot(
        motion="planar",
        reach_m=3.0,
        max_speed_m_s=0.3,
        acceleration_m_s2=0.3,
        body_radius_m=0.3,
        sensor_height_m=4.0,
        tilts=True,
        above_ground_m=1.0,
    ),
    sensor=RangeSensor((math.pi / 2, math.pi / 4), math.pi / 180, max_range_m=6.0),
    ending=Ending(time_limit_s=3600.0),
)
"""A plateau 3 m above the floor, a cliff, and rocky ground below, a part of it unreadable: Sujan's cliff, for
one rover with a camera on a mast, which pans and tilts. 15 × 12 m, mast, view and speed are ours. The ground
must carry the rover: at the edge a drive ends."""

LAB = Scenario(
    name="lab",
    reward=Reward("team", 0.00124),
    grid=Grid((50, 46, 20), 0.1),
    world="lab",
    robots=2,
    robot=Robot(motion="planar", navigator="planned", reach_m=1.0, body_radius_m=0.2, sensor_height_m=0.45),
    sensor=RangeSensor((math.pi / 4, math.pi / 6), math.pi / 90, max_range_m=4.0),
)
"""RochaMI's laboratory: 23 m², ε = 0.1 m, two ground robots with stereo vision. The paper gives neither
height nor field of view: 2 m, and 45° × 30° up to 4 m, are ours, as is the Scout's radius of 0.2 m."""

BHATTACHARYA_OFFICE = Scenario(
    name="bhattacharya-office",
    reward=Reward("team", 0.00231),
    grid=Grid((170, 200, 1), 0.1),
    world="bhattacharya-office",
    robots=5,
    robot=_WHEELED,
    sensor=_LIDAR,
    ending=Ending(time_limit_s=3600.0),
)
"""Bhattacharya's office of 170 × 200 cells with five robots; metres, robots and sensor are ours."""

BHATTACHARYA_CLUTTERED = Scenario(
    name="bhattacharya-cluttered",
    reward=Reward("team", 0.000076),
    grid=Grid((1000, 783, 1), 0.1),
    world="bhattacharya-cluttered",
    robots=4,
    robot=dataclasses.replace(_WHEELED, max_speed_m_s=1.0),
    sensor=dataclasses.replace(_LIDAR, max_range_m=15.0),
    ending=Ending(time_limit_s=20_000.0),
)
"""Bhattacharya's 1000 × 783 cells with four robots; metres, robots and sensor are ours."""

SCENARIOS = MappingProxyType(
    {
        scenario.name: scenario
        for scenario in (
            ROOM,
            ROOM_FURNISHED,
            BOX,
            OFFICE,
            OFFICE_SIGNAL,
            OFFICE_3D,
            OFFICE_MIXED,
            CORRIDOR,
            CLUTTERED,
            HYBRID,
            CAVE,
            TERRAIN,
            TERRAIN_SMOOTH,
            TERRAIN_ROUGH,
            OCCLUSIONS,
            CLIFF,
            LAB,
            BHATTACHARYA_OFFICE,
            BHATTACHARYA_CLUTTERED,
        )
    }
)
"""Name → Scenario."""


def find_scenario(scenario: str | Scenario, robots: object = None) -> Scenario:
    """Return the scenario with a name; a Scenario is given back as it is.

    Args:
        scenario: The name.
        robots: The team size that it will be given, if any: seconds cost less where one robot explores a
            scenario of a team.

    Raises:
        SettingError: No scenario has this name.
    """
    if isinstance(scenario, Scenario):
        return scenario
    if not isinstance(scenario, str) or scenario not in SCENARIOS:
        raise SettingError("scenario", scenario, one_of(scenario, SCENARIOS))
    found = SCENARIOS[scenario]
    if is_whole(robots, 1, 1) and scenario in COST_PER_S_ALONE:
        return dataclasses.replace(found, reward=Reward("team", COST_PER_S_ALONE[scenario]))
    return found

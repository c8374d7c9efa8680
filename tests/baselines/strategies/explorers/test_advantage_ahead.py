"""How planned-rate explores plans: by advantage, with what turning, slivers and teammates change about it."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from baselines.strategies.explorers.advantage_ahead import AdvantageAhead, AheadConfig
from baselines.strategies.explorers.distance_advantage import DistanceAdvantage, DistanceAdvantageConfig
from baselines.strategies.frontier.voxel.map import EDGE
from entropy_explore_env.scenario import with_settings
from tests.baselines.strategies.explorers.scenes import cell, random_plan, scenario_of, scene_of
from tests.baselines.strategies.explorers.test_coordination import mate, with_mates
from tests.baselines.strategies.explorers.test_rules import room_with_a_sliver
from tests.reference import explorers as reference
from tests.reference.scenes import drawn, seeds


def pose_in(place):
    return np.array([0.1 * (place[0] + 0.5), 0.1 * (place[1] + 0.5), 0.05, 0.0, 0.0])


def picked(plan, robot, config=None, came_from=None, ending=None, mates=()):
    """The cell that is picked by a robot that stood elsewhere before."""
    rule = AdvantageAhead(config)
    rule.reset(with_settings(scenario_of(plan.shape), {"ending": ending or {}}), np.random.default_rng(0))
    scene = with_mates(scene_of(plan, robot), list(mates))
    for place in ([came_from] if came_from else []) + [robot]:
        scene.view.pose = pose_in(place)  # type: ignore[misc]
        voxel = rule.pick(scene)
        scene.paths.start(scene.here)
    return cell(plan, voxel)


def straight(length=30):
    """A corridor, known in the middle and open at both ends."""
    plan = np.full((length, 3), reference.WALL, np.int8)
    plan[1:-1, 1] = reference.FREE
    plan[0, 1] = plan[-1, 1] = reference.UNKNOWN
    return plan


BARE = {"opening": 0.0, "gain": 0.0, "turn": 0.0, "passing": 0.0, "around": 0.0125}
"""With these every frontier cell is an opening, and only lengths count."""


@given(st.sampled_from([(17, 11), (31, 14), (90, 13)]), seeds)
@drawn(40)
def test_where_neither_turns_nor_what_is_seen_count_it_is_distance_advantage(shape, seed):
    plan, robot = random_plan(shape, np.random.default_rng(seed))
    scene = scene_of(plan, robot)
    voxel = DistanceAdvantage(DistanceAdvantageConfig(opening=0.0)).pick(scene)
    reached = len(scene_of(plan, robot).paths.frontiers_within(61.0)[0])
    ours = picked(plan, robot, AheadConfig(**BARE)) if voxel >= 0 and reached else None
    assert ours is None or ours == cell(plan, voxel)


@pytest.mark.parametrize(
    ("came_from", "turn", "wanted"), [((9, 1), 0.5, 28), ((13, 1), 0.5, 1), ((9, 1), 0.0, 1)]
)
def test_it_goes_on_where_it_came_for_unless_turning_costs_nothing_by_hand(came_from, turn, wanted):
    """The left end is 10 steps away, the right one 17; means are alike, and half a range is 40 steps."""
    config = AheadConfig(**BARE | {"turn": turn})
    assert picked(straight(), (11, 1), config, came_from) == (wanted, 1)


OPENINGS = {"around": 0.05, "opening": 0.05, "turn": 0.0, "passing": 0.0}
"""An opening has four known free voxels beside unknown ones, none more than four voxels off."""


@pytest.mark.parametrize("ending", [{}, {"unseen_free_voxels": 5}])
def test_slivers_wait_by_hand(ending):
    """The sliver is four steps off and the opening 18."""
    plan, robot = room_with_a_sliver(4)
    assert picked(plan, robot, AheadConfig(**OPENINGS), ending=ending)[0] == 24
    assert picked(plan, robot, AheadConfig(**OPENINGS | {"opening": 0.0, "gain": 0.0}), ending=ending)[0] == 2


@pytest.mark.parametrize("ending", [{}, {"seen_share": 0.9}, {"unseen_free_voxels": 5}])
def test_slivers_count_where_there_is_nothing_else(ending):
    plan, robot = room_with_a_sliver(9)
    plan[25, 2:6] = reference.WALL
    assert picked(plan, robot, ending=ending) == (2, 4)


def room_with_two_ends():
    """Known rooms, a wall with a gap between them; 4 unknown voxels at the left end, 80 at the right one."""
    plan = np.full((70, 9), reference.WALL, np.int8)
    plan[25:46, 1:8] = reference.FREE
    plan[35, 2:8] = reference.WALL
    plan[24, 3:7] = reference.UNKNOWN
    plan[46:66, 3:7] = reference.UNKNOWN
    return plan


@pytest.mark.parametrize(("gain", "depth", "wanted"), [(0.0, 0.25, 25), (0.25, 0.25, 45), (0.25, 0.0125, 25)])
def test_what_shows_more_is_worth_a_longer_way_by_hand(gain, depth, wanted):
    """Eight steps and two more to the left, ten and two to the right; ln 20 quarters of a range are 60 steps.

    A depth of one voxel says that no more lies behind the one than behind the other.
    """
    config = AheadConfig(**OPENINGS | {"gain": gain, "depth": depth})
    assert picked(room_with_two_ends(), (34, 1), config)[0] == wanted


def corridor_with_a_sliver():
    """A corridor that is open at the right, and at whose left end a voxel of its wall is unknown."""
    plan = np.full((60, 7), reference.WALL, np.int8)
    plan[2:50, 2:5] = reference.FREE
    plan[50:58, 2:5] = plan[2, 1] = reference.UNKNOWN
    return plan


ROUND_ABOUT = OPENINGS | {"around": 0.0375, "opening": 0.0375, "passing": 0.5}


@pytest.mark.parametrize(
    ("robot", "passing", "wanted"), [(11, 0.5, 2), (11, 0.0, 49), (11, 0.2, 49), (20, 0.5, 49)]
)
def test_a_sliver_that_would_be_left_behind_is_visited_before_by_hand(robot, passing, wanted):
    """From place 11 the way round by it is 19 steps, from place 20 37; other frontier cells are 47 off."""
    config = AheadConfig(**ROUND_ABOUT | {"passing": passing})
    assert picked(corridor_with_a_sliver(), (robot, 3), config)[0] == wanted


@pytest.mark.parametrize(("robot", "wanted"), [(20, 2), (30, 179)])
def test_a_sensor_that_sees_far_makes_no_long_way_round_by_hand(robot, wanted):
    """Nothing else is unknown for 150 steps, which count as 90: the way round may be 45, and is 37 or 57."""
    plan = np.full((190, 7), reference.WALL, np.int8)
    plan[2:180, 2:5] = reference.FREE
    plan[180:188, 2:5] = plan[2, 1] = reference.UNKNOWN
    rule = AdvantageAhead(AheadConfig(**ROUND_ABOUT | {"around": 0.015, "opening": 0.015}))
    rule.reset(scenario_of(plan.shape), np.random.default_rng(0))
    scene = scene_of(plan, (robot, 3))
    scene.cells.reach, scene.view.pose = 200.0, pose_in((robot, 3))  # type: ignore[misc]
    assert cell(plan, rule.pick(scene))[0] == wanted


def test_slivers_on_the_way_are_left_to_be_seen_in_passing():
    plan = corridor_with_a_sliver()
    plan[30, 1] = reference.UNKNOWN
    assert picked(plan, (26, 3), AheadConfig(**ROUND_ABOUT))[0] == 49
    assert picked(plan, (32, 3), AheadConfig(**ROUND_ABOUT))[0] == 30


def test_slivers_near_the_goal_of_a_teammate_are_left_to_it_by_hand():
    plan = straight()
    assert picked(plan, (8, 1)) == (1, 1)
    assert picked(plan, (8, 1), mates=[mate((4, 1), (1, 1))]) == (28, 1)
    plan[-1, 1] = reference.WALL
    assert picked(plan, (8, 1), mates=[mate((4, 1), (1, 1))]) == (1, 1)


def test_openings_beyond_the_horizon_come_before_slivers_by_hand():
    plan = np.full((130, 9), reference.WALL, np.int8)
    plan[2:125, 1:8] = reference.FREE
    plan[125, 2:6] = plan[1, 4] = reference.UNKNOWN
    assert picked(plan, (6, 4), AheadConfig(**OPENINGS))[0] == 124
    plan[125, 2:6] = reference.WALL
    assert picked(plan, (60, 4), AheadConfig(**OPENINGS)) == (2, 4)


def test_a_robot_leaves_the_end_to_which_another_goes_by_hand():
    plan, config = straight(), AheadConfig(**BARE)
    assert picked(plan, (8, 1), config) == (1, 1)
    assert picked(plan, (8, 1), config, mates=[mate((4, 1), (1, 1))]) == (28, 1)


@given(seeds)
@drawn(30)
def test_crowds_are_counted_edge_by_edge(seed):
    rng = np.random.default_rng(seed)
    plan, robot = random_plan((23, 17), rng)
    scene = scene_of(plan, robot)
    edge = (scene.cells._map.flags.reshape(plan.shape) & EDGE) > 0
    voxels = rng.integers(0, plan.size, 6).astype(np.int32)
    radius = int(rng.integers(0, 6))
    wanted = [
        int(edge[max(x - radius, 0) : x + radius + 1, max(y - radius, 0) : y + radius + 1].sum())
        for x, y in (cell(plan, voxel) for voxel in voxels)
    ]
    assert scene.cells.crowds(voxels, radius, 10_000).tolist() == wanted
    assert scene.cells.crowds(voxels, radius, 2).tolist() == [min(count, 2) for count in wanted]

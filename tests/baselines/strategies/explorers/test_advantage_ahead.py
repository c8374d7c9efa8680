"""How planned-rate explores plans: by advantage, with what turning, slivers and teammates change about it."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from baselines.experiments.mission import run_mission, scripted
from baselines.strategies.explorers.advantage_ahead import AdvantageAhead, AheadConfig
from baselines.strategies.explorers.distance_advantage import DistanceAdvantage, DistanceAdvantageConfig
from baselines.strategies.frontier.voxel.map import EDGE
from baselines.strategies.planned_rate import PlannedRate, explores_frontiers
from entropy_explore_env.envs.parallel_env import EntropyExploreEnv
from entropy_explore_env.reports.metrics import joint_figures, mission_figures
from entropy_explore_env.scenario import with_settings
from entropy_explore_env.scenarios import OFFICE, find_scenario
from tests.baselines.strategies.explorers.scenes import cell, random_plan, scenario_of, scene_of
from tests.baselines.strategies.explorers.test_coordination import mate, with_mates
from tests.baselines.strategies.explorers.test_missions import small_plan
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


@given(st.sampled_from([(17, 11), (31, 14), (90, 13)]), seeds)
@drawn(40)
def test_where_neither_turns_nor_slivers_cost_anything_it_is_distance_advantage(shape, seed):
    plan, robot = random_plan(shape, np.random.default_rng(seed))
    voxel = DistanceAdvantage(DistanceAdvantageConfig(opening=0.0)).pick(scene_of(plan, robot))
    ours = picked(plan, robot, AheadConfig(sliver=1.0, turn=0.0)) if voxel >= 0 else None
    assert ours is None or ours == cell(plan, voxel)


@pytest.mark.parametrize(
    ("came_from", "turn", "wanted"), [((9, 1), 0.5, 28), ((13, 1), 0.5, 1), ((9, 1), 0.0, 1)]
)
def test_it_goes_on_where_it_came_for_unless_turning_costs_nothing_by_hand(came_from, turn, wanted):
    """The left end is 10 steps away, the right one 17; means are alike, and half a range is 40 steps."""
    assert picked(straight(), (11, 1), AheadConfig(turn=turn), came_from) == (wanted, 1)


@pytest.mark.parametrize(("ending", "wanted"), [({}, 2), ({"unseen_free_voxels": 5}, 24)])
def test_slivers_wait_where_something_may_stay_unseen_by_hand(ending, wanted):
    """The sliver is four steps off and the opening 18."""
    plan, robot = room_with_a_sliver(4)
    config = AheadConfig(opening=0.05, around=0.05, turn=0.0)
    assert picked(plan, robot, config, ending=ending)[0] == wanted


@pytest.mark.parametrize("ending", [{}, {"seen_share": 0.9}, {"unseen_free_voxels": 5}])
def test_slivers_count_where_there_is_nothing_else(ending):
    plan, robot = room_with_a_sliver(9)
    plan[25, 2:6] = reference.WALL
    assert picked(plan, robot, ending=ending) == (2, 4)


def test_slivers_cost_more_than_openings_by_hand():
    """From the middle, the sliver is 11 steps off and the opening 12: the means favour neither by so much."""
    plan, robot = room_with_a_sliver(11)
    cells = {
        sliver: picked(plan, robot, AheadConfig(opening=0.05, around=0.05, turn=0.0, sliver=sliver))[0]
        for sliver in (1.0, 3.0)
    }
    assert cells == {1.0: 2, 3.0: 24}


def test_a_robot_leaves_the_end_to_which_another_goes_by_hand():
    plan = straight()
    assert picked(plan, (8, 1)) == (1, 1)
    assert picked(plan, (8, 1), mates=[mate((4, 1), (1, 1))]) == (28, 1)


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


@pytest.mark.parametrize(
    ("name", "settings", "wanted"),
    [
        ("office", {}, False),
        ("office", {"robot": {"redecide": "on_scan"}, "sensor": {"scan_every_m": 0.5}}, True),
        ("office", {"ending": {"seen_share": 0.9}, "track_truth": True}, True),
        ("office-3d", {"ending": {"seen_share": 0.9}, "track_truth": True}, False),
        ("room", {"robot": {"redecide": 0.5}}, False),
    ],
)
def test_it_goes_for_frontiers_in_plans_where_it_decides_under_way_or_all_is_to_be_seen(
    name, settings, wanted
):
    scenario = with_settings(find_scenario(name), settings)
    assert explores_frontiers(scenario, scenario.kind_of(0)) == wanted


@pytest.mark.parametrize("redecide", ["at_stop", "on_scan"])
def test_planned_rate_sees_all_of_a_plan(redecide):
    ending = {"seen_share": 1.0, "time_limit_s": 2000.0}
    scenario = small_plan(ending=ending, robot={"body_radius_m": 0.0, "redecide": redecide})
    env = EntropyExploreEnv(scenario)
    run_mission(env, PlannedRate(), 3)
    assert mission_figures(env.missions, 0)["finished"]
    assert joint_figures(env.missions, 0)["explored"] == 1.0


def test_a_team_in_a_plan_finishes_sooner_than_one_robot():
    settings = {
        "robot": {"redecide": "on_scan"},
        "sensor": {"scan_every_m": 0.5},
        "ending": {"seen_share": 0.9},
        "track_truth": True,
    }
    seconds = []
    for robots in (1, 3):
        env = EntropyExploreEnv(with_settings(scripted(OFFICE), {**settings, "robots": robots}))
        run_mission(env, PlannedRate(), 1)
        seconds.append(mission_figures(env.missions, 0)["t_mission_s"])
    assert seconds[1] < 0.75 * seconds[0]

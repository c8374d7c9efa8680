"""How planned-rate explores plans: where it goes for frontiers, and tours that a team shares."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from baselines.experiments.mission import run_mission, scripted
from entropy_explore_env.envs.parallel_env import EntropyExploreEnv
from entropy_explore_env.explorer.planned_rate import PlannedRate, explores_frontiers
from entropy_explore_env.planner.tour import SharedTour, Tour
from entropy_explore_env.reports.metrics import joint_figures, mission_figures
from entropy_explore_env.settings.changes import with_settings
from entropy_explore_env.settings.scenarios import OFFICE, find_scenario
from tests.planner.scenes import cell, corridor, mate, random_plan, scene_of, small_plan, with_mates
from tests.reference.scenes import drawn, seeds


def picked(plan, robot, *mates):
    """The cell to which a robot goes, with teammates under way."""
    scene = with_mates(scene_of(plan, robot), list(mates))
    return cell(plan, SharedTour().pick(scene).target)


def test_a_robot_leaves_to_a_teammate_what_that_is_nearer_to_by_hand():
    plan = corridor()
    assert picked(plan, (8, 1)) == (1, 1)
    assert picked(plan, (8, 1), mate((4, 1), (1, 1))) == (27, 1)
    assert picked(plan, (3, 1), mate((20, 1), (27, 1))) == (1, 1)


def test_where_teammates_are_nearer_to_all_a_robot_helps_by_hand():
    plan = corridor()
    assert picked(plan, (8, 1), mate((4, 1), (1, 1)), mate((20, 1), (27, 1))) == (1, 1)


@given(st.sampled_from([(17, 11), (31, 14)]), seeds)
@drawn(30)
def test_alone_it_is_tour_and_in_a_team_cells_are_split_by_distance(shape, seed):
    rng = np.random.default_rng(seed)
    plan, robot = random_plan(shape, rng)
    assert SharedTour().pick(scene_of(plan, robot)).target == Tour().pick(scene_of(plan, robot))
    target = tuple(int(rng.integers(1, size)) for size in shape)
    scene = with_mates(scene_of(plan, robot), [mate((0, 0), target)])
    voxels, lengths = scene.paths.frontiers_within(np.inf)
    places = [cell(plan, voxel) for voxel in voxels]
    apart = [np.hypot(place[0] - target[0], place[1] - target[1]) for place in places]
    wanted = [length <= far for length, far in zip(lengths, apart, strict=True)]
    own = scene.nearer_than_teammates(voxels, lengths)
    assert own.tolist() == (wanted if any(wanted) else [True] * len(places))


@pytest.mark.parametrize(
    ("name", "settings", "wanted"),
    [
        ("office", {}, False),
        ("office", {"robot": {"redecide": "on_scan"}, "sensor": {"scan_every_m": 0.5}}, False),
        ("office", {"ending": {"seen_share": 1.0}, "track_truth": True}, True),
        ("office", {"ending": {"seen_share": 0.99}, "track_truth": True}, False),
        ("office", {"ending": {"unseen_free_voxels": 79}, "track_truth": True}, True),  # its rays: 80 voxels
        ("office", {"ending": {"unseen_free_voxels": 80}, "track_truth": True}, False),
        ("office", {"robot": {"redecide": 2.0}, "ending": {"seen_share": 0.9}, "track_truth": True}, False),
        ("office-3d", {"ending": {"seen_share": 1.0}, "track_truth": True}, False),
        ("room", {"robot": {"redecide": 0.5}}, False),
    ],
)
def test_it_goes_for_frontiers_in_plans_where_all_is_to_be_seen(name, settings, wanted):
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

"""What ends a mission: one map, all of them, what the team shares, what it has seen, time or cycles."""

import numpy as np
import pytest

from entropy_explore_env.missions.records import MissionEnd
from entropy_explore_env.reports.metrics import mission_figures
from tests.reference.scenes import free_box, started, wander

SHARES = {"i_min_bits": 0.0}


@pytest.mark.parametrize(
    ("termination", "complete", "end"),
    [
        ("any", [False, False], MissionEnd.RUNNING),
        ("any", [False, True], MissionEnd.MAPPED),
        ("all", [False, True], MissionEnd.RUNNING),
        ("all", [True, True], MissionEnd.MAPPED),
        ("shared", [True, False], MissionEnd.RUNNING),
        ("shared", [True, True], MissionEnd.MAPPED),
        ("one", [False, False], MissionEnd.RUNNING),
        ("one", [False, True], MissionEnd.MAPPED),
    ],
)
def test_a_mission_ends_at_the_first_event_at_which_enough_maps_are_complete(termination, complete, end):
    missions = started(free_box(robots=2, channel={"burst": 0}, ending={"termination": termination}))
    enough_bits = missions.state.missions[0]["entropy_end_bits"]
    missions.state.robots["entropy_bits"][0] = np.where(complete, enough_bits, enough_bits + 1e6)
    missions.step(np.zeros((1, 2, 5)), np.zeros((1, 2), np.int64))
    assert missions.over(0) is end


def maps_passed(missions):
    """(A,) whether each robot's map has passed the threshold."""
    return missions.state.robots["entropy_bits"][0] <= missions.state.missions["entropy_end_bits"][0]


def play(scenario, seed=0, steps=4000):
    """A mission of random actions until its end, and which maps had passed before its last step."""
    missions, before = started(scenario, seed), np.zeros(scenario.robots, bool)
    rng = np.random.default_rng(seed)
    for _ in range(steps):
        if missions.over(0) is not MissionEnd.RUNNING:
            break
        before = maps_passed(missions)
        missions.step(rng.uniform(-1, 1, (1, scenario.robots, 5)), np.zeros((1, scenario.robots), np.int64))
    return missions, before


def test_robots_that_have_stopped_for_good_do_not_count():
    faults = {"stop": {"at_s": 3.0, "robots": (1,)}}
    ending = {"sigma_end": 0.2, "time_limit_s": 2000.0}
    shared, _ = play(
        free_box(robots=3, faults=faults, channel=SHARES, ending={**ending, "termination": "shared"})
    )
    assert shared.over(0) is MissionEnd.MAPPED and maps_passed(shared).tolist() == [True, False, True]
    everybody, _ = play(
        free_box(robots=3, faults=faults, channel=SHARES, ending={**ending, "termination": "all"})
    )
    assert everybody.over(0) is MissionEnd.TIME_UP


def test_a_robot_that_stands_still_for_a_while_counts():
    faults = {"stop": {"at_s": 3.0, "lasts_s": 500.0, "robots": (1,)}}
    ending = {"sigma_end": 0.2, "termination": "shared"}
    missions, _ = play(free_box(robots=3, faults=faults, channel=SHARES, ending=ending))
    assert missions.over(0) is MissionEnd.MAPPED and missions.state.missions["time_s"][0] > 503.0
    assert maps_passed(missions).all()


@pytest.mark.parametrize("goal", [{"seen_share": 0.7}, {"unseen_free_voxels": 60}])
@pytest.mark.parametrize(("termination", "enough"), [("shared", np.all), ("one", np.any)])
def test_what_was_seen_has_to_be_in_every_map_or_in_one(goal, termination, enough):
    """The slow reference counts the voxels that each map holds."""

    def held(missions):
        state, prior = missions.state, missions.rules.params["prior_precision"][0]
        seen = (state.precision[0] > np.float32(prior)) & state.visible[0]
        free = seen & (state.truth[0] <= 0.5)
        clock = state.missions[0]
        return (seen.sum(axis=1) >= clock["explored_end"]) & (free.sum(axis=1) >= clock["explored_free_end"])

    together, _ = play(free_box(robots=3, channel={"burst": 2}, ending=goal))
    assert together.over(0) is MissionEnd.SEEN and not held(together).any()
    scenario = free_box(robots=3, channel={"burst": 2}, ending={**goal, "termination": termination})
    missions, told = started(scenario), []
    rng = np.random.default_rng(0)
    while missions.over(0) is MissionEnd.RUNNING:
        told.append(bool(enough(held(missions))))
        missions.step(rng.uniform(-1, 1, (1, 3, 5)), np.zeros((1, 3), np.int64))
    assert missions.over(0) is MissionEnd.SEEN and enough(held(missions)) and not any(told)
    names = [f"robot_{robot}" for robot in np.flatnonzero(held(missions))]
    assert mission_figures(missions, 0)["ended_by"] == names
    assert missions.state.missions["time_s"][0] > together.state.missions["time_s"][0]


def test_shared_knowledge_needs_a_robot_that_works():
    """All stop at once: nobody has shared anything."""
    missions = started(free_box(robots=2, faults={"stop": {"at_s": 2.0}}, ending={"termination": "shared"}))
    wander(missions, 20, 0)
    assert missions.over(0) is MissionEnd.STOPPED


@pytest.mark.parametrize("period", [None, 0.8])
def test_a_mission_is_cut_off_at_its_time_limit(period):
    missions = started(free_box(decision_period_s=period, ending={"time_limit_s": 7.3}), seed=5)
    while missions.over(0) is MissionEnd.RUNNING:
        assert missions.state.missions[0]["time_s"] < 7.3
        wander(missions, 1, 0)
    assert missions.over(0) is MissionEnd.TIME_UP
    assert missions.state.missions[0]["time_s"] == 7.3


def test_a_mission_is_cut_off_after_its_last_cycle_and_then_stands_still():
    missions = started(free_box(ending={"max_cycles": 6}), seed=5)
    wander(missions, 6, 0)
    assert missions.over(0) is MissionEnd.CYCLES_UP
    before = [array.tobytes() for array in missions.state]
    wander(missions, 2, 1)
    assert [array.tobytes() for array in missions.state] == before
    assert missions.state.missions[0]["cycles"] == 6

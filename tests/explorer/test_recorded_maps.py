"""Goals on recorded partial maps are those of the missions in which they were recorded."""

from __future__ import annotations

import time

import numpy as np
import pytest

from baselines.experiments.mission import scripted
from baselines.suites.public_worlds import in_world
from entropy_explore_env.envs.parallel_env import EntropyExploreEnv
from entropy_explore_env.explorer.explorer import Explorer
from entropy_explore_env.explorer.planned_rate import PlannedRate
from entropy_explore_env.settings.changes import with_settings
from entropy_explore_env.settings.scenarios import SCENARIOS
from tests.public_worlds import needs_public_worlds

SEEN = {"ending": {"seen_share": 0.99}}


def check_goals(scenario, decisions, **world):
    """Play a mission, and ask two Explorers: one is given the robot's maps, the other its own scans alone.

    A decision takes an Explorer no more than three times as long as in the mission: what it answers says
    path, bits and seconds, too.
    """
    env = EntropyExploreEnv(with_settings(scripted(scenario), {"robots": 1}), **world)
    env.reset(seed=0)
    strategy, of_maps, of_scans = PlannedRate(), *(Explorer(env.scenario, seed=0) for _ in range(2))
    strategy.reset(env.scenario, env.strategy_generator())
    spent_s: list[tuple[float, ...]] = []
    for _ in range(decisions):
        view = env.view("robot_0")
        if view.map.known.any():
            of_maps.set_map(view.map)
            of_scans.add_scan(view.scan.pose, view.scan.range_m)
        moments, goals = [time.perf_counter()], []
        chosen = strategy.choose(view)
        moments.append(time.perf_counter())
        for explorer in (of_maps, of_scans):
            goals.append(explorer.goal(view.pose, ended=view.move_end, time_s=view.time_s))
            moments.append(time.perf_counter())
        spent_s.append(tuple(np.diff(moments)))
        assert np.allclose(goals[0].viewpoint, chosen, atol=1e-6)
        assert np.array_equal(goals[1].viewpoint, chosen)
        env.step({"robot_0": view.action_for(chosen)})
    in_mission_s, *in_explorers_s = np.median(spent_s, axis=0)
    print("ms a decision:", *(round(1e3 * each, 1) for each in (in_mission_s, *in_explorers_s)))
    assert max(in_explorers_s) < 3.0 * in_mission_s + 0.02


@pytest.mark.parametrize(
    ("world", "scenario", "settings"),
    [
        (None, "office", SEEN),
        (None, "cave", SEEN),
        (None, "hybrid", SEEN),
        ("warehouse", "office", SEEN),
        ("geb079", "office-3d", {}),
        ("octa_maze", "office-3d", {}),
    ],
    ids=lambda value: value if isinstance(value, str) else "",
)
def test_in_offices_caves_and_buildings(world, scenario, settings):
    task = SCENARIOS[scenario]
    if world is not None:
        needs_public_worlds(world)
    check_goals(with_settings(task, settings) if world is None else in_world(task, world, settings), 6)

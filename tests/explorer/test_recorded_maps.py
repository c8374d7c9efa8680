"""Goals on recorded partial maps are those of the missions in which they were recorded."""

from __future__ import annotations

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
    """Play a mission, and ask an Explorer that is given the robot's maps, and nothing of its scans."""
    env = EntropyExploreEnv(with_settings(scripted(scenario), {"robots": 1}), **world)
    env.reset(seed=0)
    strategy, explorer = PlannedRate(), Explorer(env.scenario, seed=0)
    strategy.reset(env.scenario, env.strategy_generator())
    for _ in range(decisions):
        view = env.view("robot_0")
        chosen = strategy.choose(view)
        if view.map.known.any():
            explorer.set_map(view.map)
        goal = explorer.goal(view.pose, ended=view.move_end, time_s=view.time_s)
        assert np.allclose(goal.viewpoint, chosen, atol=1e-6)
        env.step({"robot_0": view.action_for(chosen)})


@pytest.mark.parametrize(
    ("world", "scenario", "settings"),
    [
        (None, "cave", SEEN),
        (None, "hybrid", SEEN),
        ("warehouse", "office", SEEN),
        ("geb079", "office-3d", {}),
    ],
    ids=lambda value: value if isinstance(value, str) else "",
)
def test_in_offices_caves_and_buildings(world, scenario, settings):
    task = SCENARIOS[scenario]
    if world is not None:
        needs_public_worlds(world)
    check_goals(with_settings(task, settings) if world is None else in_world(task, world, settings), 6)

"""Missions that end when all is seen and the team is home."""

import numpy as np
import pytest

from baselines.experiments.mission import run_mission, scripted
from entropy_explore_env.envs.parallel_env import EntropyExploreEnv
from entropy_explore_env.errors import SettingError
from entropy_explore_env.explorer.planned_rate import PlannedRate
from entropy_explore_env.missions.records import MissionEnd
from entropy_explore_env.settings.changes import with_settings
from entropy_explore_env.settings.ending import Ending
from entropy_explore_env.settings.scenarios import find_scenario


def mission(name, share, returns):
    ending = {"seen_share": share, "return_to_start": returns, "time_limit_s": 2000.0}
    scenario = with_settings(scripted(find_scenario(name)), {"robots": 2, "ending": ending})
    env, seen_s = EntropyExploreEnv(scenario), []

    def note(env):
        clock = env.missions.state.missions[0]
        if clock["explored_visible"] >= share * clock["visible"]:
            seen_s.append(float(clock["time_s"]))

    run_mission(env, PlannedRate(), 0, note)
    return env, seen_s


@pytest.mark.parametrize(("name", "share"), [("bhattacharya-office", 1.0), ("cluttered", 0.9)])
def test_the_mission_ends_when_enough_is_seen_and_the_team_is_home(name, share):
    """The planner goes for frontier cells in the first one, and by bits in the other."""
    env, seen_s = mission(name, share, returns=True)
    clock, robots = env.missions.state.missions[0], env.missions.state.robots[0]
    assert env.missions.over(0) is MissionEnd.SEEN
    assert clock["explored_visible"] >= share * clock["visible"]
    assert clock["time_s"] > seen_s[0]
    starts = env.missions._returning.homes[0]
    assert (np.linalg.norm(robots["goal"][:, :3] - starts, axis=1) <= 0.6).all()
    earlier, _ = mission(name, share, returns=False)
    assert earlier.missions.over(0) is MissionEnd.SEEN
    assert earlier.missions.state.missions[0]["time_s"] == pytest.approx(seen_s[0])


def test_only_missions_that_end_by_what_was_seen_may_ask_for_it():
    for settings in ({}, *({"seen_share": 1.0, "termination": whose} for whose in ("shared", "one"))):
        with pytest.raises(SettingError, match=r"Ending.return_to_start = True: .*seen"):
            Ending(return_to_start=True, **settings)


def test_a_team_that_drives_home_is_not_exhausted():
    ending = {"seen_share": 1.0, "return_to_start": True}
    env = EntropyExploreEnv(with_settings(find_scenario("bhattacharya-office"), {"ending": ending}))
    env.reset(seed=0)
    missions, clock = env.missions, env.missions.state.missions[0]
    for seen, end in ((clock["visible"], MissionEnd.RUNNING), (0, MissionEnd.EXHAUSTED)):
        clock["explored_visible"], clock["end"] = seen, MissionEnd.EXHAUSTED.code
        missions.state.robots[0]["goal"][:, 0] += 5.0
        missions._returning.end(missions.rules, missions.state)
        assert missions.over(0) is end

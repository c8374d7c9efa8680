"""Teams go on when a teammate falls silent: nobody waits for it, and what it was to see is seen by others."""

from __future__ import annotations

import numpy as np
import pytest

from baselines.experiments.mission import run_mission, scripted
from baselines.strategies import make_strategy
from baselines.suites.faults import STRATEGIES
from entropy_explore_env.envs.parallel_env import EntropyExploreEnv
from entropy_explore_env.missions.records import MissionEnd
from entropy_explore_env.settings.changes import with_settings
from entropy_explore_env.settings.grid import Grid
from entropy_explore_env.settings.scenarios import OFFICE
from entropy_explore_env.worlds.world import World

GRID = Grid((61, 87, 1), 0.1)
STARTS = [[1.0, 1.0, 0.05, 0.0, 0.0], [3.0, 2.0, 0.05, 1.5, 0.0], [5.0, 1.0, 0.05, 2.0, 0.0]]
LIMIT_S, STILL_S = 400.0, 60.0
FAULTS = {
    "stopped": {"stop": {"at_s": 3.0, "robots": (1,)}},
    "silent": {"silent": {"at_s": 3.0, "robots": (1,)}},
    "stopped for a while": {"stop": {"at_s": 3.0, "lasts_s": 40.0, "robots": (1,)}},
    "blind": {"blind": {"at_s": 3.0, "robots": (1,)}},
    "a bad radio": {"radio": {"garbled": 0.3, "repeated": 0.3, "late": 0.3, "late_s": 5.0}},
}


def two_rooms() -> World:
    """A plan of two rooms with a door of 2 m between them."""
    occupied = np.zeros(GRID.shape, bool)
    occupied[[0, -1]] = occupied[:, [0, -1]] = True
    occupied[:, 43] = True
    occupied[20:40, 43] = False
    return World(GRID, occupied, name="two-rooms")


def ended(strategy: str, fault: str) -> tuple[MissionEnd, float]:
    """How a mission of three robots ended, and the longest time that one which had not stopped stood still.

    What a robot did not hear nobody tells it again: only robots that work all the time, and hear all, know
    all that the team has seen.
    """
    termination = "shared" if fault == "stopped" else "any"
    settings = {
        "grid": GRID,
        "robots": 3,
        "faults": FAULTS[fault],
        "ending": {"seen_share": 0.97, "termination": termination, "time_limit_s": LIMIT_S},
        "robot": {"reach_m": 3.0},
        "sensor": {"max_range_m": 3.0},
    }
    env = EntropyExploreEnv(with_settings(scripted(OFFICE), settings))
    since, places, longest = np.zeros(3), np.full((3, 3), np.inf), 0.0

    def note(env: EntropyExploreEnv) -> None:
        nonlocal longest
        state = env.missions.state
        time_s, robots = float(state.missions[0]["time_s"]), state.robots[0]
        active = np.linalg.norm(robots["origin"][:, :3] - places, axis=1) >= 0.2
        active |= state.faults[0]["stopped"] if len(state.faults[0]) else False
        places[active], since[active] = robots["origin"][active, :3], time_s
        longest = max(longest, float((time_s - since).max()))

    run_mission(env, make_strategy(strategy), 1, note, options={"world": two_rooms(), "starts": STARTS})
    return env.missions.over(0), longest


@pytest.mark.parametrize("strategy", STRATEGIES)
def test_the_others_see_what_a_lost_teammate_was_to_see(strategy):
    end, longest_s = ended(strategy, "stopped")
    assert end is MissionEnd.SEEN and longest_s < STILL_S


@pytest.mark.long
@pytest.mark.parametrize("fault", list(FAULTS)[1:])
@pytest.mark.parametrize("strategy", STRATEGIES)
def test_the_team_sees_all_whatever_fails(strategy, fault):
    end, longest_s = ended(strategy, fault)
    assert end is MissionEnd.SEEN and longest_s < STILL_S


@pytest.mark.parametrize(
    "strategy", ["coordinated-frontier", "assigned-frontier", "voronoi", "per-time-visibility"]
)
def test_nothing_is_left_to_teammates_whose_scans_do_not_come(strategy):
    """Only announced, teammates' viewpoints take no frontier: all go where they would go in silence.

    Bodies are points: where bodies stop each other, those of which a robot has heard decide which one waits.
    """
    went = []
    for channel in ({"burst": 0}, {"burst": 0, "announcements": False}, {}):
        settings = {
            "grid": GRID,
            "robots": 3,
            "channel": channel,
            "ending": {"time_limit_s": 60.0},
            "robot": {"reach_m": 3.0, "body_radius_m": 0.0},
            "sensor": {"max_range_m": 3.0},
        }
        env, places = EntropyExploreEnv(with_settings(scripted(OFFICE), settings)), []

        def note(env: EntropyExploreEnv, places: list = places) -> None:
            places.append(env.missions.state.robots[0]["origin"].copy())

        run_mission(env, make_strategy(strategy), 1, note, options={"world": two_rooms(), "starts": STARTS})
        went.append(np.array(places))
    np.testing.assert_array_equal(went[0], went[1])
    assert not np.array_equal(went[0], went[2])

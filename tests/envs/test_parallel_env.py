"""A team's environment: how it is made, how missions begin and end, rewards, state, views, pictures."""

import copy
import math
import pickle
from typing import Any

import numpy as np
import pettingzoo
import pygame
import pytest
from pettingzoo import AECEnv

from entropy_explore_env import (
    SCENARIOS,
    EntropyExploreEnv,
    MissionEnd,
    SettingError,
    environment_id,
    find_scenario,
    parallel_env,
    with_settings,
)
from entropy_explore_env.envs.conformance import leaves, require_same, snapshot
from entropy_explore_env.reports.animation import Window
from tests.reference.scenes import SMALL

BOX = "box-7x11x5"
BOX_VOXELS = 7 * 11 * 5
QUICK = {"max_cycles": 40}


def team_actions(team: EntropyExploreEnv, rng: np.random.Generator) -> dict[str, Any]:
    space = team.action_space("robot_0")
    if hasattr(space, "n"):
        return {agent: int(rng.integers(space.n)) for agent in team.agents}  # type: ignore[attr-defined]
    return {agent: rng.uniform(-1, 1, space.shape).astype(np.float32) for agent in team.agents}


def played(team: EntropyExploreEnv, seed: int = 0) -> list[tuple[Any, ...]]:
    """What step returned, from reset to the end, under random actions."""
    rng = np.random.default_rng(seed)
    results: list[tuple[Any, ...]] = []
    team.reset(seed=seed)
    while team.agents:
        results.append(team.step(team_actions(team, rng)))
    return results


@pytest.mark.parametrize(
    ("scenario", "name"), [("room", "Room"), ("room-furnished", "RoomFurnished"), (BOX, "Box7x11x5")]
)
def test_every_scenario_has_an_id_that_pettingzoo_makes(scenario: str, name: str) -> None:
    assert environment_id(scenario) == f"entropy_explore_env/{name}-v1"
    made = pettingzoo.make("parallel", environment_id(scenario), robots=4, channel={"burst": 3})
    assert isinstance(made, EntropyExploreEnv)
    assert made.possible_agents == ["robot_0", "robot_1", "robot_2", "robot_3"]
    expected = with_settings(find_scenario(scenario), {"robots": 4, "channel": {"burst": 3}})
    assert made.scenario == expected
    turns = pettingzoo.make("aec", environment_id(scenario), robots=2)
    assert isinstance(turns, AECEnv)
    assert turns.possible_agents == ["robot_0", "robot_1"]


def test_ids_are_those_of_all_scenarios() -> None:
    assert len({environment_id(scenario) for scenario in SCENARIOS}) == len(SCENARIOS) == 19


def test_the_mission_ends_for_all_robots_together_when_a_map_is_known() -> None:
    """With σ_end = 10 the threshold is V log2(30 / 10) bits below the start."""
    team = parallel_env(BOX, robots=3, ending={"sigma_end": 10.0})
    results = played(team)
    for _, _, terminations, truncations, infos in results[:-1]:
        assert not any([*terminations.values(), *truncations.values()])
        assert {info["end"] for info in infos.values()} == {MissionEnd.RUNNING}
    _, _, terminations, truncations, infos = results[-1]
    assert list(terminations.values()) == [True] * 3
    assert list(truncations.values()) == [False] * 3
    assert {info["end"] for info in infos.values()} == {MissionEnd.MAPPED}
    threshold = BOX_VOXELS * math.log2(math.sqrt(2 * math.pi * math.e) * 10.0)
    assert min(info["entropy_bits"] for info in infos.values()) <= threshold
    assert min(info["entropy_bits"] for info in results[-2][4].values()) > threshold
    assert team.agents == [] and len(team.possible_agents) == 3


@pytest.mark.parametrize("flat", [False, True])
@pytest.mark.parametrize("kind", ["continuous", "discrete"])
def test_state_is_what_all_robots_observe(flat: bool, kind: str) -> None:
    observation = {"flat": flat, "patch": True, "overview": True, "action_mask": True}
    team = parallel_env(BOX, robots=3, observation=observation, action={"kind": kind}, **QUICK)
    space = team.state_space
    observations = played(team)[-1][0].values()
    parts = [list(robot.values()) if isinstance(robot, dict) else [robot] for robot in observations]
    expected = np.concatenate([part.ravel() for robot in parts for part in robot]).astype(np.float32)
    assert space.contains(team.state())
    np.testing.assert_array_equal(team.state(), expected)
    assert team.state_space is space and team.state() is not team.state()


def test_view_wants_a_robot_of_the_team() -> None:
    team = parallel_env(BOX)
    team.reset(seed=0)
    for asked in (team.view, team.observation_space, team.action_space):
        with pytest.raises(SettingError, match="robot_0, robot_1"):
            asked("robot_2")


def test_without_any_seed_missions_differ() -> None:
    starts = {tuple(parallel_env("room").reset()[0]["robot_0"]["self"]) for _ in range(4)}
    assert len(starts) == 4


@pytest.mark.parametrize("scenario", SMALL)
def test_pictures(scenario: str) -> None:
    team = parallel_env(scenario, robots=2, render_mode="rgb_array", max_cycles=5)
    silent = parallel_env(scenario, robots=2, max_cycles=5)
    with pytest.warns(UserWarning, match="render_mode='rgb_array'"):
        assert silent.render() is None
    team.reset(seed=0)
    first = team.render()
    assert first is not None and first.shape == (480, 640, 3) and first.dtype == np.uint8
    require_same("picture or not", leaves(played(silent)), leaves(played(team)))
    last = team.render()
    assert last is not None and (first != last).any() and np.ptp(last) > 100
    team.close()
    team.close()


def test_a_window_shows_every_step(monkeypatch: pytest.MonkeyPatch) -> None:
    shown: list[np.ndarray] = []
    show = Window.show
    monkeypatch.setattr(Window, "show", lambda window, rgb: shown.append(rgb) or show(window, rgb))
    team = parallel_env(BOX, render_mode="human", max_cycles=3)
    assert len(played(team)) == 3 and len(shown) == 4
    assert team.render() is None
    assert pygame.display.get_surface().get_size() == (640, 480)
    team.close()
    assert pygame.display.get_surface() is None
    team.reset(seed=0)  # a closed environment can go on
    team.close()


def test_an_environment_with_a_window_can_be_copied() -> None:
    team = parallel_env(BOX, render_mode="human", max_cycles=3)
    team.reset(seed=0)
    try:
        copied = copy.deepcopy(team)
        pickled = pickle.loads(pickle.dumps(team))
        require_same("copy", snapshot(team), snapshot(copied))
        require_same("pickle", snapshot(team), snapshot(pickled))
    finally:
        team.close()

"""Infos say what is true, and the action mask marks the moves that make sense."""

import pickle

import numpy as np
import pytest

from entropy_explore_env import (
    CallOrderError,
    EntropyExploreEnv,
    MissionEnd,
    MoveEnd,
    parallel_env,
)
from entropy_explore_env.envs.infos import END_FIGURES
from entropy_explore_env.reports.metrics import mission_figures

BOX = "box-7x11x5"
DISCRETE = {"kind": "discrete", "yaws": 5, "pitches": 3}


@pytest.mark.parametrize("flat", [False, True])
def test_infos_and_observations_hold_the_same_masks(flat: bool) -> None:
    observation = {"action_mask": True, "flat": flat}
    env = parallel_env(BOX, robots=3, action=DISCRETE, observation=observation, max_cycles=25)
    env.reset(seed=1)
    seen = set()
    while env.agents:
        actions = {agent: env.action_space(agent).sample() for agent in env.agents}
        observations, _, _, _, infos = env.step(actions)
        for agent, info in infos.items():
            mask = info["action_mask"]
            assert mask.dtype == np.int8 and mask.shape == (env.action_space(agent).n,)  # type: ignore[attr-defined]
            told = observations[agent][-len(mask) :] if flat else observations[agent]["action_mask"]
            np.testing.assert_array_equal(told, mask)
            seen.add(mask.tobytes())
    assert len(seen) > 2


def test_continuous_actions_have_no_mask() -> None:
    env = parallel_env(BOX, observation={"action_mask": True})
    observations, infos = env.reset(seed=0)
    assert "action_mask" not in infos["robot_0"] and "action_mask" not in observations["robot_0"]
    env = parallel_env(BOX, action=DISCRETE)
    observations, infos = env.reset(seed=0)
    assert "action_mask" in infos["robot_0"] and "action_mask" not in observations["robot_0"]


def test_infos_agree_with_views_and_are_plain_python() -> None:
    env = parallel_env(BOX, robots=3, max_cycles=60)
    rng = np.random.default_rng(0)
    kinds = {
        "deciding": bool,
        "time_s": float,
        "world_number": int,
        "entropy_bits": float,
        "own_bits": float,
        "received_bits": float,
    }
    kinds |= {"move_end": MoveEnd, "end": MissionEnd, **dict.fromkeys(END_FIGURES, float)}
    _, infos = env.reset(seed=0)
    deciding = set()
    while env.agents:
        for agent, info in infos.items():
            view = env.view(agent)
            assert {name: type(value) for name, value in info.items()} == kinds
            assert (info["deciding"], info["time_s"]) == (view.deciding, view.time_s)
            assert (info["entropy_bits"], info["move_end"]) == (view.entropy_bits, view.move_end)
            assert info["own_bits"] >= 0.0 and info["received_bits"] >= 0.0
            deciding.add(info["deciding"])
        actions = {agent: rng.uniform(-1, 1, 5).astype(np.float32) for agent in env.agents}
        observations, _, _, _, infos = env.step(actions)
        for agent, observation in observations.items():
            assert observation["self"][9] == infos[agent]["deciding"]
    assert deciding == {True, False}


def test_an_environment_says_all_figures_of_a_scored_mission() -> None:
    env = parallel_env(BOX, robots=2, max_cycles=30, track_truth=True)
    rng = np.random.default_rng(0)
    with pytest.raises(CallOrderError, match="figures"):
        env.figures()
    env.reset(seed=0)
    while env.agents:
        env.step({agent: rng.uniform(-1, 1, 5).astype(np.float32) for agent in env.agents})
    first = env.figures()
    assert first == mission_figures(env.missions, 0, floor=True)
    marks = {
        figure for share in (50, 90, 95, 99, 100) for figure in (f"t{share}_seen_s", f"path{share}_seen_m")
    }
    whole = {"entropy_bits", "explored", "error", "wrong", "unseen_free_voxels", "driven_m"}
    assert first["scans_over_floor"] > 0 and set(first["joint"]) == whole | marks
    assert mission_figures(env.missions, 0, floor=False)["scans_over_floor"] is None


def test_infos_are_numbers_with_the_same_names_from_reset_to_end():
    env = EntropyExploreEnv(BOX, action=DISCRETE, ending={"max_cycles": 3})
    _, infos = env.reset(seed=0)
    names = list(infos["robot_0"])
    while env.agents:
        assert infos["robot_0"]["t_mission_s"] == 0.0
        infos = env.step(dict.fromkeys(env.agents, 0))[4]
        for info in infos.values():
            assert list(info) == names
            assert all(isinstance(value, bool | int | float | np.ndarray) for value in info.values())
    end = infos["robot_0"]["end"]
    assert end is MissionEnd.CYCLES_UP and end == end.code == 3
    assert (str(end), f"{end}", repr(end)) == ("CYCLES_UP", "CYCLES_UP", "MissionEnd.CYCLES_UP")
    assert pickle.loads(pickle.dumps(end)) is end and MissionEnd(end.value) is end
    assert infos["robot_0"]["t_mission_s"] == infos["robot_0"]["time_s"]


@pytest.mark.parametrize(
    ("ending", "named"),
    [
        ({"sigma_end": 20.0}, {"robot_0"}),
        ({"sigma_end": 20.0, "termination": "all"}, {"robot_0", "robot_1"}),
        ({"seen_share": 0.01}, {"team"}),
        ({"seen_share": 0.01, "termination": "shared"}, {"robot_0", "robot_1"}),
        ({"max_cycles": 1}, set()),
    ],
)
def test_figures_say_whose_maps_ended_the_mission(ending, named):
    env = EntropyExploreEnv(BOX, robots=2, channel={"burst": 0}, ending={"time_limit_s": 500.0, **ending})
    env.reset(seed=0)
    for agent in env.agents:
        env.action_space(agent).seed(0)
    while env.agents:
        env.step({agent: env.action_space(agent).sample() for agent in env.agents})
    ended_by = env.figures()["ended_by"]
    assert set(ended_by) == named or (
        ending.get("termination") is None and "sigma_end" in ending and ended_by
    )


def test_environments_and_scenarios_are_shown_in_a_line():
    env = EntropyExploreEnv(BOX, robots=2)
    said = f"'{BOX}', 2 robots, 7 × 11 × 5 voxels of {env.scenario.grid.voxel_size_m:g} m"
    assert repr(env) == f"EntropyExploreEnv({said})" and repr(env.scenario) == f"Scenario({said})"

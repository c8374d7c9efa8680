"""Teams with all that makes them unsure at once: the same bit for bit in every adapter, copied and recorded.

Robots drift past surfaces that give no return, sight fiducials and landmarks of their own maps, and send
summaries that come late or get lost.
"""

from __future__ import annotations

import copy
import pickle
from pathlib import Path

import numpy as np
import pytest

from entropy_explore_env.envs.conformance import check_conformance
from entropy_explore_env.envs.parallel_env import EntropyExploreEnv
from entropy_explore_env.envs.vector_env import EntropyExploreVectorEnv
from entropy_explore_env.reports.state_digest import state_digest
from entropy_explore_env.settings.changes import with_settings
from entropy_explore_env.settings.scenarios import BOX
from entropy_explore_env.worlds.load import save_world
from entropy_explore_env.worlds.world import World
from tests.missions.replays import check_replay

ROBOTS, STEPS = 3, 25
SENSOR = {
    "field_of_view_rad": (1.6, 1.0),
    "angular_step_rad": 0.2,
    "scan_every_m": 0.4,
    "range_noise_m": 0.02,
}
SETTINGS = {
    "robots": ROBOTS,
    "robot": {
        "localization": {"xy_m_per_sqrt_m": 0.05, "z_m_per_sqrt_m": 0.02, "yaw_rad_per_sqrt_m": 0.05},
    },
    "sensor": SENSOR,
    "fiducials": {"number": 30, "own_number": 4, "own_score": 0.1},
    "channel": {"content": "summaries", "summary_every_s": 1.0, "delay_s": 0.4, "loss_probability": 0.2},
    "decision_period_s": 1.0,
    "max_cycles": STEPS,
}


def partly_unreadable() -> World:
    """The box with two blocks in it, of which one gives no return, and neither does a wall's lower half."""
    occupied, unreadable = np.zeros(BOX.grid.shape, bool), np.zeros(BOX.grid.shape, bool)
    occupied[2, 7:9, :3] = occupied[5, 2:4, :] = occupied[:, 10, :] = True
    unreadable[2, 7:9, :3] = unreadable[:, 10, :2] = True
    return World(BOX.grid, occupied, "half glass", unreadable=unreadable)


def drawn_actions(seed: int) -> np.ndarray:
    """(STEPS, ROBOTS, 5) float32."""
    return np.random.default_rng(seed).uniform(-1.0, 1.0, (STEPS, ROBOTS, 5)).astype(np.float32)


def played(env: EntropyExploreEnv, actions: np.ndarray) -> list[tuple[np.ndarray, np.ndarray]]:
    """Observations (A, F) and rewards (A,) of each step."""
    told = []
    for step in actions:
        observed, rewards, _, _, _ = env.step(dict(zip(env.possible_agents, step, strict=True)))
        told.append(
            (
                np.stack([flat(observed[agent]) for agent in env.possible_agents]),
                np.array([rewards[agent] for agent in env.possible_agents]),
            )
        )
    return told


def flat(observed: object) -> np.ndarray:
    """All numbers of an observation, in the order of its parts' names."""
    if isinstance(observed, dict):
        return np.concatenate([np.ravel(observed[name]) for name in sorted(observed)])
    return np.ravel(np.asarray(observed))


def same(ours: list[tuple[np.ndarray, np.ndarray]], theirs: list[tuple[np.ndarray, np.ndarray]]) -> bool:
    """Whether two missions were told the same, bit for bit."""
    return all(
        a.tobytes() == b.tobytes()
        for one, other in zip(ours, theirs, strict=True)
        for a, b in zip(one, other, strict=True)
    )


def test_all_that_is_on_happens() -> None:
    env = EntropyExploreEnv(BOX, world=partly_unreadable(), **SETTINGS)
    env.reset(seed=5)
    played(env, drawn_actions(0))
    state = env.missions.state
    assert (state.estimates["error"] != 0.0).any() and (state.estimates["sightings"] > 0).any()
    assert state.landmarks["used"].any() and (state.truth == 2.0).any()
    assert (state.summaries["sent"] > 1).all() and (state.robots["messages_lost"] > 0).any()
    told = []
    for world in (partly_unreadable(), World(BOX.grid, partly_unreadable().occupied, "no glass")):
        other = EntropyExploreEnv(BOX, world=world, **SETTINGS)
        other.reset(seed=5)
        told.append(played(other, drawn_actions(0)))
    assert not same(*told)  # what gives no return is seen otherwise


def test_it_conforms(in_this_process: int) -> None:
    said: list[str] = []
    changes = {name: value for name, value in SETTINGS.items() if name not in ("robots", "max_cycles")}
    check_conformance(
        BOX, robots=ROBOTS, steps=STEPS, report=said.append, world=partly_unreadable(), **changes
    )
    assert len(said) == in_this_process


@pytest.mark.parametrize("threads", [1, 2])
def test_missions_of_a_vector_environment_are_those_of_teams_by_themselves(threads: int) -> None:
    world = partly_unreadable()
    envs = EntropyExploreVectorEnv(BOX, 3, threads=threads, world=world, **SETTINGS)
    envs.reset(seed=[7, 8, 9])
    actions = np.stack([drawn_actions(mission) for mission in range(3)], axis=1)
    for step in actions:
        envs.step(step)
    for mission in range(3):
        alone = EntropyExploreEnv(BOX, world=world, **SETTINGS)
        alone.reset(seed=7 + mission)
        played(alone, actions[:, mission])
        assert state_digest(alone.missions, 0) == state_digest(envs.missions, mission)


def test_copies_and_pickles_go_on_alike() -> None:
    env = EntropyExploreEnv(BOX, world=partly_unreadable(), **SETTINGS)
    env.reset(seed=3)
    actions = drawn_actions(1)
    played(env, actions[:12])
    others = [copy.deepcopy(env), pickle.loads(pickle.dumps(env))]
    told = played(env, actions[12:])
    for other in others:
        assert same(played(other, actions[12:]), told)
        assert state_digest(other.missions, 0) == state_digest(env.missions, 0)


def test_a_record_runs_again_bit_for_bit(tmp_path: Path) -> None:
    save_world(partly_unreadable(), tmp_path / "glass.npz")
    env = EntropyExploreEnv(with_settings(BOX, {**SETTINGS, "world": str(tmp_path / "glass.npz")}))
    env.reset(seed=4)
    rng = np.random.default_rng(6)
    record = check_replay(env, lambda: rng.uniform(-1, 1, 5).astype(np.float32), None, tmp_path / "m.npz")
    assert record.scenario == env.scenario

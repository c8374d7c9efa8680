"""What others ask of an environment: the checkers of PettingZoo, Gymnasium and Stable-Baselines3."""

import functools
from typing import Any

import gymnasium
import pytest
from gymnasium.utils.env_checker import check_env
from pettingzoo.test import (
    api_test,
    max_cycles_test,
    parallel_api_test,
    parallel_seed_test,
    render_test,
    seed_test,
)

import entropy_explore_env
from entropy_explore_env import env, environment_id, parallel_env
from entropy_explore_env.envs.parallel_env import EntropyExploreEnv
from entropy_explore_env.settings.scenarios import SCENARIOS
from tests.envs.pairwise import params
from tests.reference.scenes import SMALL

PARTS: dict[str, dict[str, Any]] = {
    "nothing": {"panorama": False, "self_state": False, "team": False},
    "self": {"panorama": False, "team": False},
    "default": {},
    "everything": {"drive": True, "patch": True, "overview": True, "action_mask": True},
    "flat": {"drive": True, "patch": True, "overview": True, "action_mask": True, "flat": True},
}
KINDS = ("continuous", "discrete")
TEAMS = (SMALL, (1, 2, 5), KINDS)
SINGLES = (SMALL, KINDS, [parts for parts in PARTS if parts != "nothing"])
"""Without `nothing`: Gymnasium does not allow an empty observation space."""

# PettingZoo wants arrays; ours is a Dict of parts, as PettingZoo's own games with an action mask
# have it. `flat` gives an array, and is checked without this exception.
OBSERVATIONS_ARE_DICTS = (
    "ignore:Observation is not a NumPy array:UserWarning",
    "ignore:Observation space for each agent probably should be:UserWarning",
)


def settings(robots: int, kind: str, parts: str) -> dict[str, Any]:
    return {"robots": robots, "action": {"kind": kind}, "observation": PARTS[parts]}


@pytest.mark.parametrize(
    ("scenario", "robots", "kind", "parts"), params(*TEAMS, ("nothing", "default", "everything", "flat"))
)
def test_pettingzoo_parallel_api(scenario: str, robots: int, kind: str, parts: str) -> None:
    parallel_api_test(parallel_env(scenario, max_cycles=8, **settings(robots, kind, parts)), num_cycles=10)


@pytest.mark.filterwarnings(*OBSERVATIONS_ARE_DICTS)
@pytest.mark.parametrize(
    ("scenario", "robots", "kind", "parts"), params(*TEAMS, ("nothing", "default", "everything"))
)
def test_pettingzoo_api(scenario: str, robots: int, kind: str, parts: str) -> None:
    api_test(env(scenario, max_cycles=8, **settings(robots, kind, parts)), num_cycles=10 * robots)


@pytest.mark.parametrize(("scenario", "robots", "kind"), params(*TEAMS))
def test_pettingzoo_api_with_flat_observations(scenario: str, robots: int, kind: str) -> None:
    api_test(env(scenario, max_cycles=8, **settings(robots, kind, "flat")), num_cycles=10 * robots)


@pytest.mark.parametrize(("scenario", "robots", "kind"), params(*TEAMS))
def test_pettingzoo_seeds(scenario: str, robots: int, kind: str) -> None:
    given = settings(robots, kind, "everything")
    parallel_seed_test(functools.partial(parallel_env, scenario, **given), num_cycles=10)
    seed_test(functools.partial(env, scenario, **given), num_cycles=10)


def test_pettingzoo_max_cycles() -> None:
    max_cycles_test(entropy_explore_env)


@pytest.mark.parametrize(("scenario", "robots"), list(zip(SMALL, (1, 2, 5), strict=True)))
def test_pettingzoo_rendering(scenario: str, robots: int) -> None:
    shapes = []

    def is_picture(picture: Any) -> bool:
        shapes.append(picture.shape)
        return True

    render_test(functools.partial(env, scenario, robots=robots), {"rgb_array": is_picture})
    assert shapes == [(480, 640, 3)] * 5


def test_the_environment_s_name_ends_in_the_version_of_the_ids():
    (version,) = {environment_id(name).rpartition("-")[2] for name in SCENARIOS}
    assert EntropyExploreEnv.metadata["name"] == f"entropy_explore_env_{version}"


@pytest.mark.parametrize(("scenario", "kind", "parts"), params(*SINGLES))
def test_gymnasium_check_env(scenario: str, kind: str, parts: str) -> None:
    made = gymnasium.make(
        environment_id(scenario),
        disable_env_checker=True,
        **settings(1, kind, parts),
        render_mode="rgb_array",
    )
    check_env(made.unwrapped, skip_render_check=parts != "default")
    made.close()


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("scenario", SMALL)
def test_stable_baselines3_check_env(scenario: str, kind: str) -> None:
    from stable_baselines3.common import env_checker  # slow to import: brings torch

    for parts in ({"flat": True}, PARTS["flat"]):
        made = gymnasium.make(environment_id(scenario), action={"kind": kind}, observation=parts)
        env_checker.check_env(made.unwrapped, skip_render_check=True)
        made.close()

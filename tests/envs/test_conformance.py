"""The conformance test holds for every scenario, and fails where the contract is broken."""

import json
from typing import Any

import numpy as np
import pytest

from entropy_explore_env import SCENARIOS, SettingError
from entropy_explore_env.envs import conformance
from entropy_explore_env.envs.conformance import ConformanceError, check_conformance, leaves, require_same
from entropy_explore_env.settings.changes import with_settings
from entropy_explore_env.settings.grid import Grid
from entropy_explore_env.worlds.world import World
from tests.envs.pairwise import pairwise
from tests.missions.kinds import KINDS
from tests.reference.scenes import SMALL

BOX = SCENARIOS["box-7x11x5"]
PARTS = {"patch": True, "overview": True, "action_mask": True}


OWN: dict[str, dict[str, Any]] = {
    "flat observations, until time is up": {
        "decision_period_s": None,
        "ending": {"time_limit_s": 25.0},
        "observation": {"flat": True},
    },
    "until a map is known": {"decision_period_s": None, "ending": {"sigma_end": 25.0}},
    "until much is seen": {"ending": {"seen_share": 0.6, "time_limit_s": 60.0}},
    "a crowd": {
        "robots": 9,
        "robot": {"body_radius_m": 0.24},
        "reward": {"kind": "team", "cost_per_s": 0.001},
        "ending": {"max_cycles": 20},
    },
    "far goals in a plane": {
        "robot": {"motion": "planar", "reach_m": float("inf")},
        "channel": {"range_m": 1.5},
        "ending": {"max_cycles": 20},
    },
    "a plan": {
        "grid": Grid((9, 6, 1), 0.5),
        "world": "furnished",
        "ending": {"sigma_end": 3.0, "termination": "all", "max_cycles": 20},
        "observation": {"prediction": True, "prediction_shape": (9, 21)},
    },
}


@pytest.mark.parametrize("settings", OWN.values(), ids=OWN)
def test_scenarios_of_one_s_own_conform(in_this_process: int, settings: dict[str, Any]) -> None:
    said: list[str] = []
    check_conformance(with_settings(BOX, settings), steps=None, seed=3, report=said.append)
    assert len(said) == in_this_process


@pytest.mark.parametrize(("scenario", "robots", "kind"), pairwise(SMALL, (1, 3), ("continuous", "discrete")))
def test_scenarios_conform(in_this_process: int, scenario: str, robots: int, kind: str) -> None:
    said: list[str] = []
    settings = {"robots": robots, "action": {"kind": kind}, "observation": PARTS}
    check_conformance(scenario, steps=20, seed=robots, report=said.append, **settings)
    assert len(said) == in_this_process == 8


@pytest.mark.parametrize("kind", KINDS)
def test_missions_of_every_kind_conform(in_this_process: int, kind: str) -> None:
    scenario, _, given = KINDS[kind]
    said: list[str] = []
    check_conformance(scenario, steps=12, report=said.append, **({"world": list(given)} if given else {}))
    assert len(said) == in_this_process


def test_chance_in_given_worlds_conforms_in_fresh_processes_too() -> None:
    said: list[str] = []
    worlds = [World(BOX.grid, np.arange(385).reshape(7, 11, 5) % 13 == number, "dots") for number in (0, 1)]
    channel = {"loss_probability": 0.3, "delay_s": 2.0, "i_min_bits": 0.0}
    settings = {"channel": channel, "sensor": {"range_noise_m": 0.1}, "world": worlds}
    check_conformance(BOX, steps=8, robots=3, report=said.append, **settings)
    assert len(said) == len(conformance.CHECKS) == 9


def test_bad_settings_are_refused() -> None:
    with pytest.raises(SettingError, match=r"Scenario\.speed"):
        check_conformance(BOX, speed=3)
    with pytest.raises(SettingError, match="seed"):
        check_conformance(BOX, seed=-1)
    with pytest.raises(SettingError, match="max_cycles"):
        check_conformance(BOX, steps=0)


@pytest.mark.parametrize(
    ("first", "second", "where"),
    [
        ({"a": 1.0}, {"a": np.nextafter(1.0, 2.0)}, "a"),
        ({"a": 1.0}, {"a": 1}, "a"),
        ({"a": 0.0}, {"a": -0.0}, "a"),
        ({"a": True}, {"a": 1}, "a"),
        ({"a": 1, "b": 2}, {"b": 2, "a": 1}, "another order"),
        ({"a": 1}, {"a": 1, "b": None}, "b: nothing"),
        ([1, [2, {"c": 3}]], [1, [2, {"c": 4}]], "1 › 1 › c: int 3, then int 4"),
        (np.zeros((2, 3)), np.zeros((3, 2)), "(2, 3)"),
        (np.zeros(3, np.float32), np.zeros(3), "<f4"),
        (np.array([[0, 1], [2, 3]]), np.array([[0, 1], [9, 3]]), "at (1, 0) np.int64(2), then np.int64(9)"),
        (np.array([0.0, 0.0]), np.array([0.0, -0.0]), "at (1,)"),
        (np.array([{"a": 1}, None]), np.array([{"a": 2}, None]), "0 › a"),
        ((1, 2), [1, 2], "tuple, then list"),
    ],
)
def test_differences_are_found_and_named(first: object, second: object, where: str) -> None:
    with pytest.raises(ConformanceError) as caught:
        require_same("what", leaves(first), leaves(second))
    assert where in str(caught.value)


def test_nan_is_the_same_as_nan_and_bytes_between_fields_mean_nothing() -> None:
    kind = np.dtype([("a", "?"), ("b", "f8")], align=True)
    first, second = np.zeros(2, kind), np.full(16 * 2, 255, np.uint8).view(kind)
    second["a"], second["b"] = first["a"], first["b"]
    require_same("padding", leaves(first), leaves(second))
    require_same("NaN", leaves([np.nan, np.array([np.nan])]), leaves([np.nan, np.array([np.nan])]))


def test_the_command_says_what_it_checked(capsys: pytest.CaptureFixture[str]) -> None:
    assert conformance.main(["box-7x11x5", "--robots", "2", "--steps", "2", "--seed", "5"]) == 0
    lines = capsys.readouterr().out.splitlines()
    assert [line.split(":")[0] for line in lines] == [check.__name__ for check in conformance.CHECKS]


def test_the_command_s_results_as_one_object(
    in_this_process: int, capsys: pytest.CaptureFixture[str]
) -> None:
    assert conformance.main(["box-7x11x5", "--steps", "3", "--json"]) == 0
    said = json.loads(capsys.readouterr().out)
    assert said["broken"] is None and len(said["held"]) == in_this_process

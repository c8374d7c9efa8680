"""The pages of scenarios that are written from the code: what they say of every number and setting is so."""

from __future__ import annotations

import dataclasses
import math
import re
from typing import Any

import numpy as np
import pytest
from gymnasium.spaces import Discrete

from baselines.experiments.origin import Origin
from baselines.experiments.rows import Row, write_table
from baselines.experiments.trials import CellTrial
from baselines.suites import find_suite
from baselines.suites.page import archive_of
from docs.extensions import scenario_times
from docs.extensions.attribute_docs import attribute_docs, constant_docs
from docs.extensions.scenario_cards import card, gallery
from docs.extensions.space_numbers import action_numbers, discrete_actions, observation_numbers
from entropy_explore_env import Channel, Ending, RangeSensor, Robot, environment_id
from entropy_explore_env.envs.parallel_env import EntropyExploreEnv
from entropy_explore_env.missions.action import action_space
from entropy_explore_env.missions.observation.layout import ObservationLayout
from entropy_explore_env.settings import scenarios
from entropy_explore_env.settings.changes import with_settings
from entropy_explore_env.settings.scenario import Scenario
from entropy_explore_env.settings.scenarios import SCENARIOS
from tests.code_blocks import FENCED

ALL_PARTS = {
    "observation": dict.fromkeys(("drive", "patch", "overview", "prediction", "action_mask"), True),
    "action": {"kind": "discrete", "moves": "axes"},
}


@pytest.mark.parametrize("name", SCENARIOS)
def test_every_number_is_told_of_once(name):
    scenario = with_settings(SCENARIOS[name], ALL_PARTS)
    parts = ObservationLayout(scenario).parts
    told = observation_numbers(scenario)
    assert list(told) == list(parts)
    for part, (shape, rows, numbers) in told.items():
        assert shape == parts[part].shape
        assert [n.first for n in numbers] == np.cumsum([0] + [n.count for n in numbers])[:-1].tolist()
        assert rows * sum(n.count for n in numbers) == math.prod(shape)
    assert len(action_numbers(SCENARIOS[name])) == math.prod(action_space(SCENARIOS[name]).shape)
    discrete = action_space(scenario)
    assert isinstance(discrete, Discrete) and math.prod(discrete_actions(scenario)) == discrete.n


def test_a_mission_s_numbers_are_in_the_ranges_told():
    env = EntropyExploreEnv("box-7x11x5", **ALL_PARTS)
    told = observation_numbers(env.scenario)
    observations, _ = env.reset(seed=0)
    rng = np.random.default_rng(0)
    actions_in_all = math.prod(discrete_actions(env.scenario))
    for _ in range(60):
        for observation in observations.values():
            for part, (_, rows, numbers) in told.items():
                values = np.asarray(observation[part], float).reshape(rows, -1)
                for n in numbers:
                    block = values[:, n.first : n.first + n.count]
                    assert n.low - 1e-6 <= block.min() and block.max() <= n.high * (1 + 1e-6), (
                        part,
                        n.meaning,
                    )
        actions = {a: rng.integers(actions_in_all) for a in env.agents}
        observations, *_ = env.step(actions)
        if not env.agents:
            break


@pytest.mark.parametrize("kind", [Scenario, Channel, Ending, RangeSensor, Robot])
def test_every_setting_has_its_text(kind):
    parts = {"channel", "ending", "reward", "action", "observation"}  # classes with texts of their own
    assert set(attribute_docs(kind)) >= {field.name for field in dataclasses.fields(kind)} - parts


def test_texts_are_read_from_docstrings():
    class Thing:
        """A thing.

        Attributes:
            a, b: Both of
                them.
            c: One: with a colon.

        Raises:
            Error: No.
        """

    assert attribute_docs(Thing) == {"a": "Both of them.", "b": "Both of them.", "c": "One: with a colon."}
    assert constant_docs(scenarios)["ROOM"].startswith("Rocha04's room, tables 1-2: 10 × 10 × 4 m")


@pytest.mark.parametrize("name", SCENARIOS)
def test_the_example_of_a_card_runs(name, tmp_path):
    (block,) = FENCED.findall(card(SCENARIOS[name], tmp_path))
    made: dict[str, Any] = {}
    exec(compile(block, name, "exec"), made)
    assert set(made["observations"]) == set(made["infos"]) == set(SCENARIOS[name].agents)
    made["env"].close()


@pytest.mark.parametrize("name", SCENARIOS)
def test_a_card_says_what_the_scenario_sets(name, tmp_path):
    scenario = SCENARIOS[name]
    text = card(scenario, tmp_path)
    assert text.startswith(f"# {name}\n") and f'eee.parallel_env("{name}")' in text
    assert f"`{environment_id(name)}`" in text and f"{scenario.grid.voxels:,}" in text
    for part in ("robot", "sensor", "channel", "faults", "ending", "reward", "action", "observation"):
        for field in dataclasses.fields(getattr(scenario, part)):
            assert f"| `{field.name}` | " in text, (part, field.name)
    assert f"| `robots` | {scenario.robots} | " in text
    assert f"[{name}]({name}.md)" in gallery()
    (words,) = re.findall(r"^    python -m (baselines.run .*)$", text, re.MULTILINE)
    strategy = "cliff-next-best-view" if name == "cliff" else "best"
    assert f"{name} --robots {scenario.robots} --strategy {strategy} " in words


def test_a_card_shows_what_fails_and_whose_map_counts_then(tmp_path):
    settings = {"faults": {"stop": {"at_s": 30.0, "robots": (1,)}}, "ending": {"termination": "shared"}}
    text = card(with_settings(scenarios.ROOM, settings), tmp_path)
    assert "| `stop` | `Outage(at_s=30.0, robots=(1,))` | `Outage()` | " in text
    assert "the entropy of the map of the last robot that still works falls to H_th" in text
    assert "the entropy of any robot's map falls to H_th" in card(scenarios.ROOM, tmp_path)


def test_times_come_from_the_suites_of_the_scoreboard(tmp_path):
    """Of missions by hand: three of one cell finish, and one of them has no time to 99 %."""
    for suite, strategy, seconds in (
        ("plans", "nearest-frontier", [100, 200, 300]),
        ("teams", "random", [9]),
    ):
        cells = {cell.id: cell for cell in find_suite(suite).cells}
        cell = cells[f"office/{strategy}" if suite == "plans" else f"office-4-robots/{strategy}"]
        rows = [
            Row(
                cell.id,
                seed,
                "office",
                CellTrial(cell, seed).settings,
                Origin(),
                {"finished": True, "t_mission_s": 2.0 * time_s, "joint": {"t99_seen_s": float(time_s)}},
            )
            for seed, time_s in enumerate(seconds)
        ]
        write_table(archive_of(tmp_path, suite), rows)
    text = scenario_times.times_table(SCENARIOS["office"], tmp_path)
    assert "| 1 robot (to 99 % seen) | `nearest-frontier` | 200 (100 … 300) | 3 of 3 |" in text
    assert "4 robots" not in text and "`random`" not in text
    bare = with_settings(SCENARIOS["office"], {"name": "mine"})
    assert scenario_times.times_table(bare, tmp_path) == ""

"""Weights of the planner's features: logits by hand, files that are refused, missions without PyTorch."""

from __future__ import annotations

import json
import math
import subprocess
import sys

import numpy as np
import pytest

from baselines.experiments.mission import run_mission, scripted_env
from baselines.strategies import make_strategy
from entropy_explore_env.errors import SettingError
from entropy_explore_env.explorer.planned_rate import PlannedRate
from entropy_explore_env.planner.candidate_features import COLUMNS, FEATURES
from entropy_explore_env.planner.weights import PlannerWeights, read_weights, shipped_weights
from entropy_explore_env.settings.changes import with_settings
from entropy_explore_env.settings.scenarios import find_scenario

SCENARIO = with_settings(find_scenario("box-7x11x5"), {"robots": 2, "ending": {"time_limit_s": 12.0}})


def features(robots: int, candidates: int) -> np.ndarray:
    return np.zeros((robots, candidates, len(FEATURES)), np.float32)


def test_a_choice_by_hand():
    """β ln 1 + m = 0.1 of the first one, 8 ln 0.9 + 0.2 · 5 = 0.157 of the second, which alone has `far`."""
    seen = features(1, 4)
    seen[0, :, COLUMNS["score"]] = (1.0, 0.9, 0.0, 1.0)
    seen[0, 0, COLUMNS["chosen"]], seen[0, 1, COLUMNS["far"]] = 1.0, 0.2
    assert 8.0 * math.log(0.9) + 1.0 > 0.1 > 8.0 * math.log(0.9) + 0.8
    three = np.array([3])  # the fourth does not exist
    assert PlannerWeights({"far": 5.0}).choices(seen, three) == [1]
    assert PlannerWeights({"far": 4.0}).choices(seen, three) == [0]
    assert PlannerWeights({"far": 4.0}, margin=0.0, beta=1.0).choices(seen, three) == [1]
    assert PlannerWeights({"far": -4.0}, margin=0.0).choices(seen, three) == [0]


def test_choices_of_a_batch_are_those_of_each_alone_and_those_of_numpy():
    rng = np.random.default_rng(0)
    seen, counts = rng.uniform(0, 1, (40, 7, len(FEATURES))).astype(np.float32), rng.integers(0, 8, 40)
    weights = PlannerWeights({name: float(rng.normal()) for name in COLUMNS})
    together = weights.choices(seen, counts)
    logits = 8.0 * np.log(np.clip(seen[..., COLUMNS["score"]].astype(float), 1e-3, 1.0))
    logits += 0.1 * seen[..., COLUMNS["chosen"]] + seen.astype(float) @ weights.row()
    logits[np.arange(7) >= counts[:, None]] = -np.inf
    assert np.array_equal(together, np.where(counts > 0, logits.argmax(axis=1), 0))
    assert np.array_equal(
        together, [weights.choices(seen[k : k + 1], counts[k : k + 1])[0] for k in range(40)]
    )
    assert len(set(together.tolist())) > 3


def test_without_weights_the_first_candidate_is_taken():
    seen = features(2, 3)
    seen[:, :, COLUMNS["score"]], seen[:, 0, COLUMNS["chosen"]] = 1.0, 1.0
    assert np.array_equal(PlannerWeights().choices(seen, np.array([3, 1])), [0, 0])


def first_actions(strategy: str) -> np.ndarray:
    """What the robot of an office does in the first seconds."""
    env = scripted_env(with_settings(find_scenario("office"), {"ending": {"time_limit_s": 25.0}}))
    taken: list[np.ndarray] = []
    run_mission(env, make_strategy(strategy), 0, before_step=lambda actions: taken.append(actions["robot_0"]))
    return np.array(taken)


def test_the_shipped_weights_lead_missions_and_choose_otherwise_than_the_planner():
    weights = shipped_weights("plans")
    assert len(weights.weights) == 19 and weights.tasks == ("office:1", "office:3", "hybrid:1")
    chosen = [first_actions(name) for name in ("pretrained:plans", "planned-rate")]
    assert not np.array_equal(*chosen)
    with pytest.raises(SettingError, match=r"did you mean plans\?$"):
        shipped_weights("plan")


def test_a_file_of_weights_is_a_strategy(tmp_path):
    file = tmp_path / "weights.json"
    file.write_text(PlannerWeights({"seconds": -2.0}, candidates=5, tasks=("room:3",)).text())
    assert read_weights(file) == PlannerWeights({"seconds": -2.0}, candidates=5, tasks=("room:3",))
    env, strategy = scripted_env(SCENARIO), make_strategy(str(file))
    assert isinstance(strategy, PlannedRate)
    run_mission(env, strategy, 0)
    with pytest.raises(SettingError, match="a file that can be read"):
        make_strategy(str(tmp_path / "none.json"))


@pytest.mark.parametrize(
    ("changes", "named"),
    [
        ({"features_version": 1}, "features_version = 1: expected 2: these weights are of other features"),
        ({"features_version": True}, "features_version = True"),
        ({"weights": {"second": 1.0}}, r"weights = 'second': .*did you mean seconds\?"),
        ({"weights": {"seconds": "much"}}, "weights: seconds = 'much'"),
        ({"weights": {"seconds": math.inf}}, "weights: seconds = inf"),
        ({"weights": [1.0]}, "weights"),
        ({"beta": -1.0}, "beta"),
        ({"margin": None}, "margin"),
        ({"candidates": 65}, "candidates = 65"),
        ({"tasks": [3]}, "tasks"),
        ({"gamma": 1.0}, "gamma"),
        ({"weights": None}, "weights"),
    ],
)
def test_files_of_something_else_are_refused_by_name(changes, named, tmp_path):
    file = tmp_path / "weights.json"
    file.write_text(json.dumps({**json.loads(PlannerWeights({"seconds": -1.0}).text()), **changes}))
    with pytest.raises(SettingError, match=named):
        read_weights(file)


@pytest.mark.parametrize("text", ["", "[1]", "{", '{"weights": {}}', "\x00"])
def test_broken_files_are_refused(text, tmp_path):
    file = tmp_path / "weights.json"
    file.write_text(text)
    with pytest.raises(SettingError, match=r"weights.*a file that training\.search wrote"):
        read_weights(file)


def test_nothing_of_it_needs_pytorch():
    code = "import sys; from baselines.strategies import make_strategy; make_strategy('pretrained:plans'); "
    code += "assert 'torch' not in sys.modules"
    subprocess.run([sys.executable, "-c", code], check=True)

"""The suite of predictions: its planners, what the bound is told, and its table."""

from __future__ import annotations

import numpy as np
import pytest

from baselines.experiments.mission import SuiteMission, scripted_env
from baselines.experiments.statistics import Interval
from baselines.suites import find_suite, prediction
from baselines.suites.results import Results
from entropy_explore_env.errors import SettingError
from entropy_explore_env.missions.foresight import predictions_pay
from entropy_explore_env.prediction.volumes import VOLUMES
from entropy_explore_env.prediction.weights import features_of
from entropy_explore_env.settings.changes import with_settings
from entropy_explore_env.settings.scenarios import SCENARIOS
from tests.prediction.networks import file_bytes, random_tensors

CORRIDOR = with_settings(SCENARIOS["corridor"], {"split": "validation", "track_truth": True})


def test_its_worlds_are_tests_and_its_missions_those_in_which_predictions_pay():
    suite = find_suite("prediction")
    assert {task.name for task in suite.tasks} >= set(prediction.GOALS)
    scenarios = [place.scenario for task in suite.tasks for place in task.places]
    assert all(map(predictions_pay, scenarios))
    dungeons = [place.name for place in suite.tasks[-1].places]
    assert dungeons == [f"dungeon-{number}" for number in range(2, 101, 2)]
    assert {each.split for each in scenarios[: len(prediction.TEAMS)]} == {"test"}


def test_the_bound_is_told_the_true_map():
    bound = prediction.TrueMap()
    env = scripted_env(CORRIDOR, ending={"time_limit_s": 20.0})
    env.reset(seed=3)
    bound.tell_truth(env)
    world = env.missions.worlds[0]
    assert np.array_equal(bound._solid(None).reshape(world.grid.shape), world.occupied)
    with pytest.raises(SettingError, match="in the suite `prediction`"):
        prediction.TrueMap()._solid(None)


def test_a_recipe_is_left_out_by_weights_that_the_training_command_wrote(tmp_path, monkeypatch):
    """They are read where the docstring says, by the recipe of the mission; these are drawn."""
    monkeypatch.chdir(tmp_path)
    env = scripted_env(CORRIDOR, ending={"time_limit_s": 60.0})
    with pytest.raises(SettingError, match="--leave-out corridor --out runs"):
        SuiteMission()(env, prediction.LEFT_OUT, 3)
    file = tmp_path / "runs" / "without-corridor" / "predictor.safetensors"
    file.parent.mkdir(parents=True)
    file.write_bytes(file_bytes(random_tensors()))
    ends = [
        SuiteMission()(env, name, 3)["entropy_end_bits"] for name in (prediction.LEFT_OUT, "planned-rate")
    ]
    assert ends[0] != ends[1]


def test_recipes_of_volumes_are_left_out_by_weights_for_volumes(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    cave = with_settings(SCENARIOS["cave"], {"robots": 1, "ending": {"time_limit_s": 10.0}})
    strategy, rng = prediction.LeftOut(), np.random.default_rng(0)
    with pytest.raises(SettingError, match="--recipes cave office-3d --leave-out cave --out runs"):
        strategy.reset(cave, rng)
    file = tmp_path / "runs" / "without-cave" / "predictor.safetensors"
    file.parent.mkdir(parents=True)
    file.write_bytes(file_bytes(random_tensors()))
    with pytest.raises(SettingError, match="cell_m"):
        strategy.reset(cave, rng)
    file.write_bytes(file_bytes(random_tensors(form=VOLUMES), features_of(VOLUMES)))
    assert SuiteMission()(scripted_env(cave), prediction.LEFT_OUT, 3)["scans"] > 1


def test_missions_of_all_planners_differ():
    env = scripted_env(CORRIDOR, ending={"time_limit_s": 60.0})
    ends = [SuiteMission()(env, name, 3)["entropy_end_bits"] for name in prediction.STRATEGIES]
    assert len(set(ends)) == len(ends)


@pytest.mark.parametrize(
    ("ratio", "met"),
    [((0.8, 0.7, 0.9), "0.90, yes"), ((0.85, 0.8, 0.95), "0.90, by the mean"), ((0.91, 0.8, 1.0), "**no**")],
)
def test_goals_are_judged_by_the_whole_interval(monkeypatch, ratio, met):
    suite = find_suite("prediction")
    monkeypatch.setattr(Results, "ratio", lambda *_: Interval(*ratio))
    assert prediction._judged(Results(suite, {}), suite.tasks[0]).endswith(met)
    assert prediction._judged(Results(suite, {}), suite.tasks[4]) == "-"

"""Checkpoints come back as they were; what is broken, foreign or made for something else is named."""

import hashlib
import json
import pickle
import shutil

import numpy as np
import pytest
import torch
from safetensors.torch import save_file

from baselines.experiments.mission import run_mission
from baselines.run import main as run_main
from baselines.strategies import make_strategy
from entropy_explore_env.command import BAD_INPUT
from entropy_explore_env.envs.parallel_env import EntropyExploreEnv
from entropy_explore_env.errors import SettingError
from entropy_explore_env.planner.weights import PlannerWeights
from entropy_explore_env.reports.metrics import mission_figures
from entropy_explore_env.settings.changes import with_settings
from entropy_explore_env.settings.observation import Observation
from entropy_explore_env.settings.scenarios import find_scenario
from training import evaluate
from training.advantages import Normaliser
from training.checkpoints import (
    Checkpoint,
    CheckpointError,
    PolicySettings,
    TrainerState,
    checkpoint_name,
    latest_checkpoint,
    load_checkpoint,
    save_checkpoint,
)
from training.policy import PRETRAINED, LearnedPolicy, load_policy, make_policy, weights_of
from training.validation import learning_seeds, validation_seeds

FORM = {"robots": 2, "action": {"kind": "discrete", "moves": "axes"}, "observation": {"flat": True}}
SCENARIO = with_settings(find_scenario("box-7x11x5"), FORM)
SETTINGS = PolicySettings(SCENARIO, "vector", (6, 5))


def fresh(settings: PolicySettings = SETTINGS) -> Checkpoint:
    policy = make_policy(settings)
    stats = Normaliser(policy.observation_space.shape[0])  # pyright: ignore
    normalisation = stats.arrays("observations") | Normaliser().arrays("returns")
    return Checkpoint(settings, {"steps": 12}, weights_of(policy), normalisation)


@pytest.fixture
def saved(tmp_path):
    folder = tmp_path / "run" / checkpoint_name("best", 12)
    save_checkpoint(folder, fresh())
    return folder


def test_a_checkpoint_comes_back_as_it_was(tmp_path):
    kept = fresh()
    kept.trainer = TrainerState(
        {"a": torch.arange(3), "b": torch.tensor(2.5)},
        {"x": np.array(["text"]), "y": np.zeros(2, [("p", "f8"), ("q", "?")])},
        {"big": 2**127},
    )
    save_checkpoint(tmp_path / "step-3", kept)
    back = load_checkpoint(tmp_path / "step-3", training=True)
    assert back.settings == kept.settings and back.progress == kept.progress
    trainer, again = kept.trainer, back.trainer
    assert again is not None and again.counters == trainer.counters
    for ours, theirs in ((kept.weights, back.weights), (trainer.tensors, again.tensors)):
        assert ours.keys() == theirs.keys() and all(torch.equal(ours[key], theirs[key]) for key in ours)
    for ours, theirs in ((kept.normalisation, back.normalisation), (trainer.arrays, again.arrays)):
        assert ours.keys() == theirs.keys() and all((ours[key] == theirs[key]).all() for key in ours)
    assert load_checkpoint(tmp_path / "step-3").trainer is None


def test_the_latest_two_of_a_kind_stay_and_the_latest_is_taken(tmp_path):
    for kind, steps in (("step", 1), ("step", 20), ("best", 7), ("step", 300)):
        save_checkpoint(tmp_path / checkpoint_name(kind, steps), fresh())
    assert sorted(path.name for path in tmp_path.iterdir()) == [
        checkpoint_name("best", 7),
        checkpoint_name("step", 20),
        checkpoint_name("step", 300),
    ]
    assert latest_checkpoint(tmp_path, "best", "step").name == checkpoint_name("best", 7)
    assert latest_checkpoint(tmp_path, "step").name == checkpoint_name("step", 300)
    with pytest.raises(CheckpointError, match="a folder that"):
        latest_checkpoint(tmp_path / "nowhere", "best")


def spoil(name, change):
    """Change the bytes of a file of a checkpoint; None = it goes."""

    def spoilt(folder):
        file = folder / name
        file.unlink() if change is None else file.write_bytes(change(file.read_bytes()))

    return spoilt


def heading(**changes):
    """Change what the head says."""
    return spoil("policy.json", lambda head: json.dumps(json.loads(head) | changes).encode())


SPOILT = {
    "missing": spoil("policy.safetensors", None),
    "truncated": spoil("policy.safetensors", lambda content: content[:-7]),
    "no head": spoil("policy.json", None),
    "broken head": spoil("policy.json", lambda _: b"\xff{" * 9),
    "foreign": spoil("policy.json", lambda _: b'["something else"]'),
    "pickled": spoil("normalisation.npz", lambda _: pickle.dumps([1])),
    "format": heading(format=99),
    "features": heading(features="magic"),
    "hidden": heading(hidden=[0]),
    "scenario": heading(scenario={"name": 3}),
    "digests": heading(sha256=None),
}


@pytest.mark.parametrize("what", SPOILT)
def test_what_is_broken_or_foreign_is_named(saved, what, capsys):
    SPOILT[what](saved)
    with pytest.raises(CheckpointError):
        LearnedPolicy(saved)
    words = ["box-7x11x5", "--robots", "2", "--strategy", str(saved.parent)]
    from baselines.cli.arguments import run_command

    assert run_command(run_main, words) == BAD_INPUT
    assert len(capsys.readouterr().err.splitlines()) == 1


@pytest.mark.parametrize("what", ["missing", "shape", "more", "nan", "scale"])
def test_weights_that_do_not_fit_are_named(tmp_path, what):
    kept = fresh()
    name = "action_net.weight"
    if what == "missing":
        del kept.weights[name]
    elif what == "shape":
        kept.weights[name] = kept.weights[name][:3].clone()
    elif what == "more":
        kept.weights["extra.weight"] = torch.zeros(2)
    elif what == "nan":
        kept.weights[name] = kept.weights[name] * np.nan
    else:
        kept.normalisation["observations_mean"] = np.zeros(2)
    save_checkpoint(tmp_path / "step-1", kept)
    with pytest.raises(CheckpointError, match="observations_mean" if what == "scale" else "weight"):
        load_policy(load_checkpoint(tmp_path / "step-1"))


def renormalised(saved, save, array):
    """Put another array into a checkpoint, with its digest; the file's content."""
    save(saved / "normalisation.npz", observations_mean=array)
    head, content = (
        json.loads((saved / "policy.json").read_text()),
        (saved / "normalisation.npz").read_bytes(),
    )
    head["sha256"]["normalisation.npz"] = hashlib.sha256(content).hexdigest()
    (saved / "policy.json").write_text(json.dumps(head))
    return content


def test_loading_runs_no_code(saved):
    """An array of objects, which NumPy would unpickle, is refused even if its digest is right."""
    renormalised(saved, np.savez, np.array([{"any": "object"}], dtype=object))
    with pytest.raises(CheckpointError, match="without objects"):
        load_checkpoint(saved)
    save_file({"a": torch.zeros(1)}, saved / "policy.safetensors")
    with pytest.raises(CheckpointError, match="unchanged"):
        load_checkpoint(saved)


def test_arrays_that_would_grow_while_they_are_read_are_refused(saved):
    """A hundred MiB of zeros in a hundred KiB, with the right digest."""
    assert len(renormalised(saved, np.savez_compressed, np.zeros(13_000_000))) < 200_000
    with pytest.raises(CheckpointError, match="its arrays are compressed"):
        load_checkpoint(saved)


def test_a_policy_is_a_strategy_like_any_other(saved, tmp_path):
    """The same seed gives the same mission, from a run's folder or a checkpoint's, with any action form."""
    ends = []
    for name, action in ((saved, {}), (saved.parent, {}), (saved.parent, FORM["action"])):
        settings = {"robots": 2, "decision_period_s": None, "time_limit_s": 60.0, "action": action}
        env = EntropyExploreEnv("box-7x11x5", **settings)
        run_mission(env, make_strategy(str(name)), 5)
        ends.append([env.view(f"robot_{robot}").entropy_bits for robot in range(2)])
    assert ends[0] == ends[1] and np.allclose(ends[0], ends[2], rtol=0.05)


@pytest.mark.parametrize(
    ("settings", "named"),
    [
        ({"robots": 3}, "robots = 3"),
        ({"robots": 2, "action": {"kind": "discrete"}}, "Scenario.action"),
        ({"robots": 2, "action": {"kind": "candidates"}}, "Scenario.action = Action.kind='candidates'"),
        ({"robots": 2, "extra_kinds": find_scenario("office-mixed").extra_kinds}, "kinds of robots = 2"),
        ({"robots": 2, "robot": {"motion": "planar"}}, "motion of the robots = 'in a plane"),
    ],
)
def test_a_policy_for_something_else_is_named(saved, settings, named):
    scenario = with_settings(find_scenario("box-7x11x5"), settings)
    with pytest.raises(CheckpointError, match=named):
        LearnedPolicy(saved).reset(scenario, np.random.default_rng(0))


def test_a_policy_of_one_grid_is_named_where_maps_differ(tmp_path):
    form = {**FORM, "observation": {"flat": True, "overview": True}}
    settings = PolicySettings(with_settings(find_scenario("box-7x11x5"), form), "maps", (4,))
    save_checkpoint(tmp_path / "step-1", fresh(settings))
    policy, wider = LearnedPolicy(tmp_path), with_settings(find_scenario("room"), {"robots": 2})
    with pytest.raises(CheckpointError, match=r"world's voxels = .41, 41, 17."):
        policy.reset(wider, np.random.default_rng(0))


def test_an_unknown_policy_is_named():
    with pytest.raises(SettingError, match="pretrained:cellar"):
        make_strategy("pretrained:cellar")
    with pytest.raises(SettingError, match=r"did you mean pretrained:plans\?$"):
        make_strategy("pretrained:plan")
    with pytest.raises(SettingError, match=r"pretrained:volumes.*planned-rate, its equal"):
        make_strategy("pretrained:volumes")
    with pytest.raises(SettingError, match="policy's folder"):
        make_strategy("runs/nowhere")


def test_seeds_of_learning_validation_and_tables_have_none_in_common():
    learning, others = learning_seeds(0, 64), learning_seeds(1, 64)
    assert len({*learning, *others}) == 2 * 64 and min(*learning, *others) >= 2**63
    assert learning_seeds(0, 64) == learning
    assert not {*learning, *others} & set(validation_seeds(1000)) and min(validation_seeds(1000)) >= 2**32


def test_evaluate_puts_a_policy_beside_strategies(saved, tmp_path, capsys):
    words = ["--strategy", str(saved.parent), "--against", "random,gradient", "--seeds", "3", "--jobs", "1"]
    words += ["--runs", str(tmp_path / "missions")]
    assert evaluate.run_command(evaluate.main, [*words, "--json"]) == 0
    found = json.loads(capsys.readouterr().out)
    rows = {row["strategy"]: row for row in found["rows"]}
    assert list(rows) == [str(saved.parent), "random", "gradient"] and found["robots"] == 2
    ours, theirs = rows[str(saved.parent)], rows["random"]
    assert theirs["ratio"] == pytest.approx(ours["median_s"] / theirs["median_s"])
    assert 0 <= theirs["faster"] <= 3 and found["better_rival"] in ("random", "gradient")
    assert evaluate.run_command(evaluate.main, words) == 0  # from what is kept
    assert "better one of gradient and random" in capsys.readouterr().out
    assert evaluate.run_command(evaluate.main, [*words, "--robots", "3"]) == BAD_INPUT
    assert "robots = 3" in capsys.readouterr().err
    shutil.rmtree(saved.parent)
    assert evaluate.run_command(evaluate.main, words) == BAD_INPUT


def test_a_policy_over_candidates_is_compared_with_the_planner_unasked():
    """It begins as the planner: whether it became better than that is the question."""
    over = with_settings(SCENARIO, {"action": {"kind": "candidates"}})
    others, room = ["gradient", "random"], "pretrained:room"
    assert evaluate.default_rivals(room, SCENARIO) == others
    assert evaluate.default_rivals(room, over) == ["planned-rate", *others]
    assert evaluate.default_rivals("pretrained:plans", SCENARIO) == ["planned-rate", *others]


def test_weights_of_the_planner_are_evaluated_where_they_were_found(tmp_path, capsys):
    assert evaluate.trained_in("pretrained:plans").name == "office"
    file = tmp_path / "weights.json"
    file.write_text(PlannerWeights({"seconds": -1.0}, tasks=("box-7x11x5:2",)).text())
    words = ["--strategy", str(file), "--against", "random", "--seeds", "1", "--jobs", "1", "--json"]
    assert evaluate.run_command(evaluate.main, [*words, "--runs", str(tmp_path / "missions")]) == 0
    found = json.loads(capsys.readouterr().out)
    assert (found["scenario"], found["robots"]) == ("box-7x11x5", 2)
    assert evaluate.run_command(evaluate.main, ["--strategy", "gradient", "--seeds", "1"]) == BAD_INPUT
    assert "strategy = 'gradient'" in capsys.readouterr().err
    for tasks in ((), ("box-7x11x5",)):
        file.write_text(PlannerWeights(tasks=tasks).text())
        assert evaluate.run_command(evaluate.main, words) == BAD_INPUT
        assert "tasks" in capsys.readouterr().err


def test_evaluation_takes_worlds_that_training_never_sees():
    trained = with_settings(find_scenario("room-furnished"), {"channel": {"burst": 7}})
    there = evaluate.evaluation_scenario(trained)
    assert there.split == "test" and there.channel.burst == 7 and there.name == "room-furnished"


def test_the_policy_that_comes_with_the_project_maps_the_room():
    """In far less time than the random walk, which takes some hundred seconds."""
    env = EntropyExploreEnv("room", robots=3, decision_period_s=None, observation=Observation(panorama=False))
    run_mission(env, make_strategy("pretrained:room"), 0)
    figures = mission_figures(env.missions, 0)
    assert figures["finished"] and figures["t_mission_s"] < 100.0
    weights = PRETRAINED / "room" / "policy.safetensors"
    assert weights.stat().st_size < 2_000_000
    assert "--total-steps" in load_checkpoint(PRETRAINED / "room").progress["command"]

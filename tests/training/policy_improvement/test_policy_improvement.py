"""The stages in small: labels that repeat, a command that goes on where it was, and what it refuses."""

from __future__ import annotations

import contextlib
import io
import json
import shutil

import numpy as np
import pytest
import torch

from baselines.cli.arguments import run_command
from baselines.strategies import make_strategy
from baselines.strategies.protocol import choose_all
from entropy_explore_env.command import BAD_INPUT
from entropy_explore_env.envs.parallel_env import EntropyExploreEnv
from entropy_explore_env.envs.vector_env import EntropyExploreVectorEnv
from entropy_explore_env.missions.privileged import PRIVILEGED, mission_times, running
from entropy_explore_env.missions.view import view_of
from entropy_explore_env.planner.candidate_features import COLUMNS
from entropy_explore_env.scenario import with_settings
from entropy_explore_env.scenarios import find_scenario
from training.candidate_network import CandidatePolicy
from training.checkpoints import latest_checkpoint, load_checkpoint
from training.errors import CheckpointError, LabelsError, RollOutError
from training.policy import make_policy, settings_of_policy
from training.policy_improvement import __main__ as command
from training.policy_improvement import labelling, rollouts
from training.policy_improvement.comparison import compare_with_planner
from training.policy_improvement.labelling import LabelSettings, label_missions, write_labels
from training.policy_improvement.rollouts import (
    BatchMissions,
    Branch,
    RollOutEffort,
    RollOuts,
    candidates_to_try,
)
from training.policy_improvement.search import SEARCHED
from training.policy_improvement.shards import shard_file
from training.policy_improvement.tasks import task_of

TINY = (
    "--tasks box-7x11x5:2 --threads 1 --candidates 6 --width 8 --compared 3 --shards 2 --missions 2 "
    "--every 6 --branches 3 --draws 2 --horizon 4 --epochs 3 --batch 8 "
    "--rounds 2 --pairs 2 --ppo-steps 192 --json"
).split()
TINY.append(
    "--ppo-options=--missions 2 --rollout-steps 16 --batch 16 --epochs 1 --validation-missions 2 "
    "--validate-every 96 --time-limit-s 60"
)


def scenario(robots: int = 2, name: str = "box-7x11x5"):
    return task_of(f"{name}:{robots}", 6)


def settings(**changes) -> LabelSettings:
    made = LabelSettings((scenario(),), 2, 3, 2, RollOutEffort(4, 1), 6, 2, 0)
    return made._replace(**changes)


def improve(*more: str) -> int:
    return run_command(command.main, [*TINY, *more])


def printed(*more: str) -> dict:
    text = io.StringIO()
    with contextlib.redirect_stdout(text):
        assert improve(*more) == 0
    return json.loads(text.getvalue())


@pytest.fixture(scope="module")
def improved(tmp_path_factory):
    """A run of all stages, and what it printed."""
    out = tmp_path_factory.mktemp("improved") / "run"
    return out, printed("--out", str(out))


def test_all_stages_run_and_are_compared_with_the_planner(improved):
    out, said = improved
    assert set(said) == {"labels", "regression", "search", "ppo"} and said["labels"]["states"] > 5
    for stage in ("regression", "search", "ppo"):
        (compared,) = said[stage]["compared"]
        assert compared["missions"] == 3 and compared["finished"] == compared["planner_finished"] == 3
        assert 0.0 < compared["ratio_low"] <= compared["ratio"] <= compared["ratio_high"]
    assert said["regression"]["loss_after"] <= said["regression"]["loss_before"]
    assert sorted(each.name for each in (out / "labels").iterdir()) == [
        "labels-00000.npz",
        "labels-00001.npz",
    ]


def test_the_same_command_does_not_do_anything_again(improved, monkeypatch):
    out, said = improved
    for module, name in (
        (labelling, "label_missions"),
        (command, "regress"),
        (command, "search"),
        (command, "compare_with_planner"),
    ):
        monkeypatch.setattr(module, name, None)
    monkeypatch.setattr(command.ppo, "main", None)
    assert printed("--out", str(out)) == said


def test_ppo_goes_on_with_more_steps_but_not_from_other_weights_or_with_other_options(
    improved, tmp_path, capsys
):
    folder = tmp_path / "run"
    shutil.copytree(improved[0], folder)
    on = ["--out", str(folder), "--stage", "ppo"]
    said = printed(*on, "--ppo-steps", "256")
    assert "256 steps" in said["ppo"]["line"]
    assert improve(*on, "--ppo-options=--clip 0.1") == BAD_INPUT
    assert "as in the run in" in capsys.readouterr().err
    assert printed("--out", str(folder), "--stage", "regression", "--epochs", "9")["regression"]["states"] > 0
    weights = latest_checkpoint(folder / "regression", "best") / "policy.json"
    assert weights.is_file()
    shutil.rmtree(folder / "search")
    (folder / "ppo" / "begins-with.txt").write_text("others")
    assert improve(*on) == BAD_INPUT
    assert "weights to begin with" in capsys.readouterr().err


def test_a_policy_that_has_learned_nothing_is_the_planner_on_every_start():
    there = scenario(2)
    fresh = make_policy(settings_of_policy(there, "candidates", (8,), len(PRIVILEGED)))
    assert isinstance(fresh, CandidatePolicy)
    found = compare_with_planner(fresh, there, 3, 1)
    assert found.ratio == found.ratio_low == found.ratio_high == found.mean_ratio == found.worst_tenth == 1.0
    assert found.faster == 0 and found.policy_s == found.planner_s and found.finished == 3
    torch.nn.init.normal_(fresh.actor.residual.weight, std=30.0)
    other = compare_with_planner(fresh, there, 3, 1)
    assert other.planner_s == found.planner_s and other.policy_s != found.policy_s
    assert other.mean_ratio_low <= other.mean_ratio <= other.mean_ratio_high


def test_stages_run_one_by_one_and_a_missing_one_is_named(improved, tmp_path, capsys):
    assert improve("--out", str(tmp_path), "--stage", "regression") == BAD_INPUT
    assert "labels-00000.npz" in capsys.readouterr().err
    out, said = improved
    assert printed("--out", str(out), "--stage", "regression") == {"regression": said["regression"]}


def test_a_search_begins_with_the_regression_and_ppo_with_the_search(improved, tmp_path, capsys):
    out, _ = improved
    checkpoints = {
        stage: load_checkpoint(latest_checkpoint(out / stage, "best")) for stage in ("regression", "search")
    }
    before, after = checkpoints["regression"], checkpoints["search"]
    changed = [name for name in before.weights if not torch.equal(before.weights[name], after.weights[name])]
    assert changed in ([], ["mlp_extractor.actor.weights"])
    for name in ("returns_mean", "returns_variance", "returns_count"):
        assert np.array_equal(before.normalisation[name], after.normalisation[name])
    assert f"{out / 'search'}" in (out / "ppo" / "run.json").read_text()
    folder = tmp_path / "run"
    shutil.copytree(out, folder)
    shutil.rmtree(folder / "search")
    shutil.rmtree(folder / "regression")
    said = printed("--out", str(folder), "--stage", "search")["search"]
    assert said["begins"] == ""
    shutil.copytree(out / "regression", folder / "regression")
    shutil.rmtree(folder / "ppo")
    assert improve("--out", str(folder), "--stage", "ppo") == BAD_INPUT
    assert "weights that it began with" in capsys.readouterr().err


def test_a_search_goes_on_from_the_policy_of_another_run(improved, tmp_path, capsys):
    out, _ = improved
    before = load_checkpoint(latest_checkpoint(out / "search", "best"))
    words = ["--out", str(tmp_path / "run"), "--stage", "search", "--begin"]
    said = printed(*words, str(out / "search"), "--sigma", "0.2")["search"]
    after = load_checkpoint(latest_checkpoint(tmp_path / "run" / "search", "best"))
    assert said["begins"] and said["before"] == before.progress["search"] and len(said["rounds"]) == 2
    name = "mlp_extractor.actor.weights"
    known = [float(after.weights[name][COLUMNS[each]]) for each in SEARCHED]
    assert list(said["weights"].values()) == known
    for other in set(before.weights) - {name}:
        assert torch.equal(before.weights[other], after.weights[other])
    assert improve(*words[:1], str(tmp_path / "new"), *words[2:], str(tmp_path / "nowhere")) == BAD_INPUT
    assert not (tmp_path / "new").exists() and "nowhere" in capsys.readouterr().err


def test_ppo_alone_begins_with_the_planner(tmp_path):
    said = printed("--out", str(tmp_path), "--stage", "ppo", "--ppo-steps", "64")
    assert (
        "64 steps" in said["ppo"]["line"] and '"start": null' in (tmp_path / "ppo" / "run.json").read_text()
    )


@pytest.mark.parametrize(
    "option",
    ["--rounds 0", "--pairs 0", "--at-once 0", "--sigma 0", "--sigma nan", "--sigma 101", "--step inf"],
)
def test_options_of_the_search_are_checked_before_anything_is_written(option, tmp_path, capsys):
    assert improve("--out", str(tmp_path / "run"), "--stage", "search", *option.split()) == BAD_INPUT
    name, _ = option.removeprefix("--").replace("-", "_").split()
    assert name in capsys.readouterr().err and not (tmp_path / "run").exists()


def test_it_acts_in_candidates_of_its_own_number_only(improved):
    """Elsewhere it proposes its own candidates; where actions are numbers they must be its own."""
    strategy, there = make_strategy(str(improved[0] / "regression")), scenario()
    strategy.reset(there, np.random.default_rng(0))
    fewer = with_settings(there, {"action": {"candidates": 4}})
    with pytest.raises(CheckpointError, match=r"Scenario.action = .*candidates=4.*candidates=6"):
        strategy.reset(fewer, np.random.default_rng(0))


@pytest.mark.parametrize(
    ("options", "named"),
    [
        ("--bad 3", "--bad"),
        ("--clip often", "clip"),
        ("--gamma 7", "gamma = 7.0"),
        ("--actions discrete", "no --actions"),
        ("--out=elsewhere", "no --out"),
        ("--batch '", "quotation"),
    ],
)
def test_options_of_ppo_are_checked_before_the_first_stage(options, named, tmp_path, capsys):
    assert improve("--out", str(tmp_path / "run"), f"--ppo-options={options}") == BAD_INPUT
    said = capsys.readouterr().err
    assert "ppo_options" in said and named in said and said.count("\n") == 1
    assert not (tmp_path / "run").exists()


def test_the_policy_is_a_strategy_in_missions_of_any_team_and_evaluates(improved):
    out, _ = improved
    for robots, name in ((1, "box-7x11x5"), (3, "box-7x11x5")):
        strategy = make_strategy(str(out / "regression"))
        env = EntropyExploreEnv(with_settings(find_scenario(name), {"robots": robots}))
        env.reset(seed=3)
        strategy.reset(env.scenario, env.missions.strategy_generator(0))
        chosen = choose_all(strategy, [view_of(env.missions, 0, robot) for robot in range(robots)])
        assert len(chosen) == robots and all(np.isfinite(each).all() for each in chosen)
        again = make_strategy(str(out / "regression"))
        again.reset(env.scenario, env.missions.strategy_generator(0))
        views = [view_of(env.missions, 0, robot) for robot in range(robots)]
        assert all(map(np.array_equal, chosen, choose_all(again, views)))


def test_other_features_are_refused_by_name(improved, tmp_path):
    out, _ = improved
    folder = latest_checkpoint(out / "regression", "best")
    head = json.loads((folder / "policy.json").read_text())
    assert head["features_version"] is not None
    broken = tmp_path / "best-1"
    broken.mkdir()
    for file in folder.iterdir():
        (broken / file.name).write_bytes(file.read_bytes())
    (broken / "policy.json").write_text(json.dumps(head | {"features_version": 10_000}))
    with pytest.raises(CheckpointError, match="features_version"):
        make_strategy(str(broken))
    (broken / "policy.json").write_text(json.dumps(head | {"privileged": -1}))
    with pytest.raises(CheckpointError, match="privileged"):
        make_strategy(str(broken))


def test_labels_are_the_same_for_any_threads_and_whatever_was_there_before(tmp_path):
    one, seeds = label_missions(settings(), 1, 1)
    two, again = label_missions(settings(), 1, 2)
    assert seeds == again and min(seeds) >= 2**63
    for name, array in one._asdict().items():
        assert np.array_equal(array, getattr(two, name), equal_nan=array.dtype.kind == "f"), name
    assert write_labels(settings(), tmp_path, 2, 1, stopped=lambda: shard_file(tmp_path, 0).is_file()) == 1
    assert write_labels(settings(), tmp_path, 2, 1) == 2
    kept = labelling.load_shard(shard_file(tmp_path, 1), settings().origin)
    assert np.array_equal(kept.seconds, one.seconds, equal_nan=True)
    with pytest.raises(LabelsError, match="these options"):
        write_labels(settings(seed=1), tmp_path, 2, 1)


def test_labels_of_other_code_are_refused(tmp_path, monkeypatch):
    write_labels(settings(), tmp_path, 1, 1)
    monkeypatch.setattr(labelling, "code_digest", lambda *modules: "another")
    with pytest.raises(LabelsError, match="version of the code"):
        write_labels(settings(), tmp_path, 1, 1)


def test_labels_hold_together():
    """Time to the end falls along a mission; branches differ; the planner's own branch comes first."""
    labels, _ = label_missions(settings(missions=3), 0, 1)
    there = labels.candidates >= 0
    assert there[:, 0].all() and there.sum() > len(there)
    assert np.isfinite(labels.seconds[there]).all() and np.isnan(labels.seconds[~there]).all()
    assert (labels.seconds[there] > 0.0).all() and labels.to_go_s.min() > 0.0
    assert (labels.candidates[:, 0] == 0).all()
    for mission in range(3):
        own = labels.moments_to_go_s[labels.moments_mission == mission]
        assert (np.diff(own) <= 0.0).all() and own.min() > 0.0
    ended = labels.ended & there[:, :, None]
    assert ended.any() and (there[:, :, None] & ~labels.ended).any()


def test_without_a_horizon_the_planners_branch_ends_as_the_mission_itself_does():
    """With the mission's own random numbers and its own planner, the branch is the mission."""
    batch, there = BatchMissions(scenario(), 1, 1), scenario()
    batch.missions.reset_some([0], [2**63 + 7])
    acts = labelling.planner_acts
    for _ in range(5):
        batch.step(acts(batch))
    runs = RollOuts(there, (1, 2, 1), RollOutEffort(0, 1), 1)
    runs.add(batch, Branch(0, 0, np.array([0]), None))
    began_s = mission_times(batch.missions)[0]
    outcomes = runs.run()
    while running(batch.missions)[0]:
        batch.step(acts(batch))
    assert outcomes.ended[0, 0, 0] and np.isnan(outcomes.seconds[0, 1, 0])
    assert outcomes.seconds[0, 0, 0] == pytest.approx(mission_times(batch.missions)[0] - began_s, rel=1e-6)


def test_branches_share_their_luck_and_draws_do_not():
    """The same candidate tried twice comes to the same second, in each draw to another."""
    batch = BatchMissions(scenario(), 2, 1)
    batch.missions.reset_some([0, 1], [2**63 + 7, 2**63 + 8])
    runs = RollOuts(scenario(), (2, 3, 3), RollOutEffort(5, 2), 1)
    for mission in range(2):
        runs.add(batch, Branch(mission, 1, np.array([0, 2, 0]), 5))
    assert runs.full
    seconds = runs.run().seconds
    assert np.array_equal(seconds[:, 0], seconds[:, 2]) and not np.array_equal(seconds[:, 0], seconds[:, 1])
    assert len(np.unique(seconds[0, 0])) > 1
    assert not runs.full and len(runs.run().seconds) == 0


def test_a_roll_out_that_makes_no_headway_is_named(monkeypatch):
    batch = BatchMissions(scenario(), 1, 1)
    batch.missions.reset_some([0], [2**63 + 7])
    runs = RollOuts(scenario(), (1, 2, 1), RollOutEffort(0, 1), 1)
    runs.add(batch, Branch(0, 0, np.array([0, 1]), 5))
    monkeypatch.setattr(rollouts, "_MOST_STEPS", 0)
    with pytest.raises(RollOutError, match=f"seed {2**63 + 7}, episode 0 of box-7x11x5"):
        runs.run()


def test_what_is_tried_by_hand():
    """The planner's choice, half of the others by score, the rest drawn; never one that does not exist."""
    batch = BatchMissions(scenario(), 1, 1)
    parts = batch.parts
    features = np.zeros((6, parts.candidates.shape[1]))
    features[:, parts.score] = [0.2, 0.9, 1.0, 0.8, 0.95, 0.1]
    features[2, parts.chosen] = 1.0
    exists = np.array([True, True, True, True, False, True])
    rng = np.random.default_rng(0)
    tried = [candidates_to_try(features, exists, parts, 4, rng) for _ in range(30)]
    assert all(each[:3].tolist() == [2, 1, 3] for each in tried)
    assert {int(each[3]) for each in tried} == {0, 5}
    assert sorted(candidates_to_try(features, exists, parts, 6, rng).tolist()) == [0, 1, 2, 3, 5]


@pytest.mark.parametrize(
    "words",
    [
        ["--tasks", "nowhere:2"],
        ["--tasks", "room"],
        ["--tasks", "room:0"],
        ["--branches", "1"],
        ["--branches", "7"],
        ["--draws", "0"],
        ["--width", "6"],
        ["--learning-rate", "0"],
        ["--horizon", "-1"],
    ],
)
def test_bad_options_are_refused_before_anything_is_written(words, tmp_path, capsys):
    out = tmp_path / "run"
    assert improve(*words, "--out", str(out)) == BAD_INPUT
    assert len(capsys.readouterr().err.splitlines()) == 1 and not out.exists()


def test_a_policy_can_lead_the_missions_that_are_labelled(improved, tmp_path):
    """The next round: labels where the policy goes wrong, and learning goes on from its weights."""
    out, _ = improved
    said = printed("--out", str(tmp_path), "--policy", str(out / "ppo"), "--stage", "labels")
    assert said["labels"]["states"] > 0
    assert "regression" in printed(
        "--out", str(tmp_path), "--policy", str(out / "ppo"), "--stage", "regression"
    )
    assert (
        improve("--out", str(tmp_path), "--stage", "regression") == BAD_INPUT
    )  # the planner's labels are others


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["--width", "12"], "hidden"),
        (["--candidates", "5"], "observation candidates"),
        (["--policy", "training/pretrained/room"], "features"),
        (["--policy", "nowhere"], "nowhere"),
    ],
)
def test_a_leading_policy_of_other_networks_is_refused_by_name(improved, tmp_path, capsys, words, said):
    out = tmp_path / "run"
    assert improve("--out", str(out), "--policy", str(improved[0] / "regression"), *words) == BAD_INPUT
    (line,) = capsys.readouterr().err.splitlines()
    assert said in line and not out.exists()


def test_a_leading_policy_with_another_critic_is_refused_by_name(tmp_path, capsys):
    learned = tmp_path / "observed"
    words = "--scenario box-7x11x5 --robots 2 --actions candidates --candidates 6 --width 8 --missions 2"
    steps = (
        "--threads 1 --rollout-steps 16 --batch 16 --epochs 1 --total-steps 64 --validation-missions 1 "
        "--time-limit-s 40"
    )
    with contextlib.redirect_stdout(io.StringIO()):
        assert command.ppo.main([*words.split(), *steps.split(), "--no-video", "--out", str(learned)]) == 0
    assert improve("--out", str(tmp_path / "run"), "--policy", str(learned)) == BAD_INPUT
    assert "privileged = 0" in capsys.readouterr().err


def test_labels_know_their_task():
    both = settings(scenarios=(scenario(), scenario(1)))
    for shard, task in ((0, 0), (1, 1), (2, 0)):
        labels, _ = label_missions(both, shard, 1)
        assert (labels.task == task).all() and labels.task.shape == labels.mission.shape
        assert (
            labels.moments_task == task
        ).all() and labels.moments_task.shape == labels.moments_mission.shape


def test_roll_outs_draw_fewer_viewpoints_and_observe_nothing():
    runs = RollOuts(scenario(), (1, 2, 1), RollOutEffort(5, 3), 1)
    whole = EntropyExploreVectorEnv(scenario(), 1, action_masks=False).missions
    thin, full = (each._compiled_step.proposers[0][0].recipe for each in (runs._missions, whole))
    assert (
        thin.gazes == -(-full.gazes // 3) and thin.refined < full.refined and thin.exponent == full.exponent
    )
    assert runs._missions.observations.size == 0

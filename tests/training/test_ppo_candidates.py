"""PPO over candidates: it begins as the planner, learns, and resumes bitwise."""

import contextlib
import csv
import io
import json
import shutil
from contextlib import closing
from pathlib import Path

import numpy as np
import pytest
import torch

from baselines.experiments.mission import Surroundings
from entropy_explore_env.command import BAD_INPUT
from entropy_explore_env.envs.privileged_vec_env import PrivilegedVecEnv
from entropy_explore_env.missions.privileged import PRIVILEGED
from entropy_explore_env.planner.candidate_features import COLUMNS, FEATURES_VERSION
from training import checkpoints, ppo
from training.candidate_network import CandidatePolicy
from training.checkpoints import CheckpointError, latest_checkpoint, load_checkpoint
from training.policy import make_policy_strategy
from training.ppo import parsed, training_task
from training.validation import Validator

TINY = (
    "--scenario box-7x11x5 --robots 2 --actions candidates --candidates 5 --width 8 --missions 2 --threads 1 "
    "--rollout-steps 16 --batch 16 --epochs 2 --validation-missions 1 --time-limit-s 40 --validate-every 128 "
    "--checkpoint-every 64 --reward seconds --gamma 1.0 --critic privileged --no-video --json"
).split()


def learn(out: Path, *more: str, steps: int = 192) -> int:
    with contextlib.redirect_stdout(io.StringIO()):
        return ppo.run_command(ppo.main, [*TINY, "--out", str(out), "--total-steps", str(steps), *more])


@pytest.fixture(scope="module")
def trained(tmp_path_factory):
    out = tmp_path_factory.mktemp("candidates") / "run"
    assert learn(out) == 0
    return out


def test_a_run_learns_and_its_policy_is_a_strategy(trained):
    first, last = (load_checkpoint(folder) for folder in sorted(trained.glob("step-*")))
    assert first.settings.features == "candidates" and first.settings.hidden == (8,)
    assert first.settings.privileged == len(PRIVILEGED)
    assert first.settings.features_version == FEATURES_VERSION
    changed = [name for name in first.weights if not torch.equal(first.weights[name], last.weights[name])]
    assert any(".actor." in name for name in changed) and any(".critic." in name for name in changed)
    with (trained / "curve.csv").open() as file:
        rows = list(csv.DictReader(file))
    assert [int(row["steps"]) for row in rows] == [128, 192]
    assert all(0.3 < float(row["planner_ratio"]) < 3.0 for row in rows)
    make_policy_strategy(str(trained))


def test_fresh_weights_do_exactly_what_the_planner_does():
    task = training_task(parsed(TINY))
    state = ppo.set_up(parsed(TINY), task)
    assert isinstance(state.envs, PrivilegedVecEnv) and isinstance(state.model.policy, CandidatePolicy)
    with closing(Validator(state.settings.scenario, Surroundings(), 3, threads=1)) as validator:
        planner = validator.run(lambda seen: np.zeros(len(seen), np.int64))
        policy = validator.validate(state.model.policy)
    assert planner is not None and policy is not None
    assert policy.mean_s == pytest.approx(np.mean([each["t_mission_s"] for each in planner]), abs=1e-9)
    assert policy.planner_ratio == pytest.approx(1.0, abs=1e-12)


def test_rewards_are_less_the_seconds():
    state = ppo.set_up(parsed(TINY), training_task(parsed(TINY)))
    state.envs.reset()
    for _ in range(5):
        _, rewards, _, _ = state.envs.step(np.zeros(4, np.int64))
        assert np.allclose(rewards, -state.envs.elapsed_s) and (rewards < 0.0).all()


def test_in_the_first_updates_only_the_critic_learns_and_a_run_can_begin_with_weights(trained, tmp_path):
    out = tmp_path / "run"
    assert learn(out, "--critic-first", "2", "--start", str(trained), steps=128) == 0
    begun = load_checkpoint(latest_checkpoint(trained, "best", "step")).weights
    kept = load_checkpoint(latest_checkpoint(out, "step")).weights
    assert all(torch.equal(begun[name], kept[name]) for name in begun if ".actor." in name)
    assert not all(torch.equal(begun[name], kept[name]) for name in begun if ".critic." in name)
    assert learn(tmp_path / "on", "--critic-first", "1", "--start", str(trained), steps=128) == 0
    moved = load_checkpoint(latest_checkpoint(tmp_path / "on", "step")).weights
    assert not all(torch.equal(begun[name], moved[name]) for name in begun if ".actor." in name)


def test_weights_of_other_networks_are_refused(trained, tmp_path, capsys):
    assert learn(tmp_path / "run", "--start", str(trained), "--width", "12") == BAD_INPUT
    assert "hidden" in capsys.readouterr().err
    assert learn(tmp_path / "two", "--start", str(trained), "--critic", "observed") == BAD_INPUT
    assert "privileged" in capsys.readouterr().err
    assert learn(tmp_path / "three", "--start", str(trained), "--candidates", "4") == BAD_INPUT
    assert "candidates" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("changes", "named"),
    [
        ({"features_version": FEATURES_VERSION + 1}, "features_version = 3: expected 2: its features"),
        ({"features_version": None}, "features_version = None"),
        ({"candidate_features": ["score", "beauty"]}, "candidate_features = 'beauty'"),
        ({"candidate_features": list(COLUMNS)}, "candidate_features = 'context: entropy'"),
        ({"candidate_features": checkpoints._CANDIDATE_FEATURES[::-1]}, "candidate_features = 'their order'"),
        ({"candidate_features": 3}, "candidate_features = 'score'"),
        (
            {"observation": {"candidates": [5, 99]}},
            rf"observation candidates = \[5, 99\]: expected \[5, {len(COLUMNS)}\]",
        ),
        ({"observation": "all"}, "observation candidates = None"),
        ({"scenario": {"robots": 0}}, "scenario"),
    ],
)
def test_a_policy_of_other_features_is_refused_by_name(changes, named, trained, tmp_path):
    folder = tmp_path / "policy"
    shutil.copytree(latest_checkpoint(trained, "best"), folder)
    head = json.loads((folder / "policy.json").read_text())
    (folder / "policy.json").write_text(json.dumps(head | changes))
    with pytest.raises(CheckpointError, match=named):
        load_checkpoint(folder)
    with pytest.raises(CheckpointError, match=named):
        make_policy_strategy(str(folder))

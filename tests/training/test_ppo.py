"""training.ppo from start to end, killed and resumed, and its errors."""

from __future__ import annotations

import contextlib
import csv
import io
import json
import os
import shutil
import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest
import torch

from baselines.cli.arguments import parse
from entropy_explore_env.command import BAD_INPUT
from entropy_explore_env.envs.robot_vec_env import RobotVecEnv
from training import ppo
from training.advantages import DecisionBuffer
from training.checkpoints import checkpoint_name, latest_checkpoint, load_checkpoint
from training.errors import NotFiniteError
from training.validation import Validator

ROOT = Path(__file__).parents[2]
TINY = (
    "--scenario box-7x11x5 --robots 2 --missions 3 --threads 1 --rollout-steps 16 --batch 16 --epochs 2 "
    "--hidden 8 8 --validation-missions 1 --time-limit-s 40 --validate-every 150 --checkpoint-every 90 --json"
).split()


def learn(out: Path, *more: str, steps: int = 384) -> int:
    """The command in this process."""
    return ppo.run_command(ppo.main, [*TINY, "--out", str(out), "--total-steps", str(steps), *more])


def checkpoint_bits(out: Path) -> dict[str, bytes]:
    """Every number of the latest checkpoint, bit for bit, except seconds on the clock."""
    kept = load_checkpoint(latest_checkpoint(out, "step"), training=True)
    trainer = kept.trainer
    assert trainer is not None
    tensors = {name: each.numpy() for name, each in (kept.weights | trainer.tensors).items()}
    bits = {name: array_bits(each) for name, each in (tensors | kept.normalisation | trainer.arrays).items()}
    return bits | {"chance": json.dumps(trainer.counters["chance"]).encode()}


def array_bits(array: np.ndarray) -> bytes:
    """The bits of an array, without the padding of a structured one."""
    if array.dtype.names is None:
        return array.tobytes()
    return b"".join(array_bits(array[name]) for name in array.dtype.names)


@pytest.fixture(scope="module")
def uninterrupted(tmp_path_factory):
    """A run that nothing interrupted, and what it printed."""
    out, printed = tmp_path_factory.mktemp("uninterrupted") / "run", io.StringIO()
    with contextlib.redirect_stdout(printed):
        assert learn(out) == 0
    return out, printed.getvalue()


def test_a_run_changes_all_weights_and_writes_its_files(uninterrupted):
    out, printed = uninterrupted
    said = json.loads(printed)
    assert said["steps"] == 384 and set(said["best"]) >= {"steps", "mean_s", "finished"}
    with (out / "curve.csv").open() as file:
        rows = list(csv.DictReader(file))
    assert [int(row["steps"]) for row in rows] == [192, 384]
    assert all(0.0 < float(row["median_s"]) <= 40.0 for row in rows)
    assert (out / "best-mission" / "mission.gif").stat().st_size > 1000
    assert list(out.glob("events.out.tfevents.*"))
    first, last = (load_checkpoint(folder).weights for folder in sorted(out.glob("step-*")))
    assert all(not torch.equal(first[name], last[name]) for name in first if name.endswith("weight"))


def test_missions_get_shorter_than_those_of_fresh_weights(tmp_path):
    """Six thousand steps in the box: by a quarter to a half, whatever the seed."""
    words = "--missions 16 --rollout-steps 32 --batch 256 --epochs 6 --learning-rate 0.01 --hidden 16 16"
    words += " --validation-missions 8 --time-limit-s 300 --validate-every 9999 --no-video"
    words = [*TINY, *words.split()]
    args = parse(ppo.Args, words)
    fresh = ppo.set_up(args, ppo.training_scenario(args))
    with contextlib.closing(Validator(fresh.settings.scenario, 8, threads=1)) as validator:
        before = validator.validate(fresh.model.policy)
    assert learn(tmp_path / "run", *words, steps=6144) == 0
    with (tmp_path / "run" / "curve.csv").open() as file:
        (after,) = csv.DictReader(file)
    assert int(after["steps"]) == 6144 and float(after["mean_s"]) < 0.8 * before.mean_s


def test_a_resumed_run_ends_bitwise_like_an_uninterrupted_one(uninterrupted, tmp_path, monkeypatch):
    out = tmp_path / "run"

    class Killed(BaseException):
        """Stands for a kill: no code of ours catches it."""

    compute, rollouts = DecisionBuffer.compute_returns_and_advantage, []

    def die(*args, **kwargs):
        if len(rollouts) == 3:
            raise Killed
        rollouts.append(1)
        return compute(*args, **kwargs)

    with monkeypatch.context() as patch:
        patch.setattr(DecisionBuffer, "compute_returns_and_advantage", die)
        with pytest.raises(Killed):
            learn(out)
    begun = latest_checkpoint(out, "step").name
    assert 0 < int(begun.rpartition("-")[2]) < 384
    assert learn(out, "--resume") == 0
    assert checkpoint_bits(out) == checkpoint_bits(uninterrupted[0])
    columns = ("steps", "mean_s", "median_s", "finished", "bits_per_bit")
    curves = []
    for run in (out, uninterrupted[0]):
        with (run / "curve.csv").open() as file:
            curves.append([[row[name] for name in columns] for row in csv.DictReader(file)])
    assert curves[0] == curves[1]
    assert load_checkpoint(latest_checkpoint(out, "best")).weights.keys()


def test_a_run_killed_by_a_signal_can_be_resumed(tmp_path, uninterrupted):
    """At an arbitrary moment after its first checkpoint."""
    out = tmp_path / "run"
    words = [sys.executable, "-m", "training.ppo", *TINY, "--out", str(out), "--total-steps", "384"]
    with subprocess.Popen(words, cwd=ROOT, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL) as process:
        deadline = time.monotonic() + 120
        while not list(out.glob("step-*")) and process.poll() is None and time.monotonic() < deadline:
            time.sleep(0.005)
        process.send_signal(signal.SIGKILL)
    assert learn(out, "--resume") == 0
    assert checkpoint_bits(out) == checkpoint_bits(uninterrupted[0])


def test_resuming_in_an_empty_folder_starts_a_run(tmp_path):
    assert learn(tmp_path / "run", "--resume", steps=96) == 0


def test_a_run_is_neither_overwritten_nor_continued_with_other_options(uninterrupted, capsys):
    assert learn(uninterrupted[0]) == BAD_INPUT
    assert "--resume to continue" in capsys.readouterr().err
    assert learn(uninterrupted[0], "--resume", "--gamma", "0.5") == BAD_INPUT
    assert capsys.readouterr().err.startswith("error: gamma = 0.5: allowed is 0.9, as in the run")
    assert learn(uninterrupted[0], "--resume", "--channel.burst", "3") == BAD_INPUT
    assert len(capsys.readouterr().err.splitlines()) == 1


@pytest.mark.parametrize(
    ("words", "named"),
    [
        (["--scenario", "cellar"], "cellar"),
        (["--total-steps", "0"], "total_steps"),
        (["--gamma", "0"], "gamma"),
        (["--learning-rate", "nan"], "learning_rate"),
        (["--entropy", "-1"], "entropy"),
        (["--hidden", "0"], "hidden"),
        (["--seed", "-1"], "seed"),
        (["--patch"], "patch"),
        (["--robots", "0"], "robots"),
        (["--actions", "mixed"], "actions"),
    ],
)
def test_bad_settings_are_one_line(tmp_path, capsys, words, named):
    assert learn(tmp_path / "run", *words) == BAD_INPUT
    said = capsys.readouterr().err.splitlines()
    assert len(said) == 1 and named in said[0]
    assert not (tmp_path / "run").exists()


def test_a_folder_that_cannot_be_made_is_one_line(tmp_path, capsys):
    (tmp_path / "file").write_text("")
    assert learn(tmp_path / "file" / "run") == BAD_INPUT
    assert len(capsys.readouterr().err.splitlines()) == 1


@pytest.mark.parametrize("what", ["reward", "weights"])
def test_what_is_not_finite_stops_the_run_and_leaves_the_last_good_checkpoint(
    tmp_path, capsys, monkeypatch, what
):
    out, compute = tmp_path / "run", DecisionBuffer.compute_returns_and_advantage
    wait, steps = RobotVecEnv.step_wait, []

    def poisoned_wait(self):
        steps.append(1)
        stepped = wait(self)
        if len(steps) > 40:
            self.rewards[0] = np.nan
        return stepped

    def poisoned_advantages(self, **given):
        compute(self, **given)
        steps.append(1)
        if len(steps) > 2:
            self.advantages[:] = np.inf

    if what == "reward":
        monkeypatch.setattr(RobotVecEnv, "step_wait", poisoned_wait)
    else:
        monkeypatch.setattr(DecisionBuffer, "compute_returns_and_advantage", poisoned_advantages)
    assert learn(out) == BAD_INPUT
    said = capsys.readouterr().err.splitlines()
    assert len(said) == 1 and "finite" in said[0] and "steps" in said[0]
    assert what != "reward" or "reward = nan after 246 steps" in said[0]
    kept = load_checkpoint(latest_checkpoint(out, "step"), training=True)
    assert all(torch.isfinite(each).all() for each in kept.weights.values())


def test_a_disk_that_is_full_leaves_the_last_good_checkpoint(tmp_path, capsys, monkeypatch):
    out, fsync, calls = tmp_path / "run", os.fsync, []

    def full(handle):
        calls.append(1)
        if list(out.glob("step-*")):
            raise OSError(28, "No space left on device")
        fsync(handle)

    monkeypatch.setattr(os, "fsync", full)
    assert learn(out) == BAD_INPUT
    said = capsys.readouterr().err.splitlines()
    assert len(said) == 1 and "No space left" in said[0]
    monkeypatch.undo()
    load_checkpoint(latest_checkpoint(out, "step"), training=True)
    assert not list(out.glob(".*.unfinished"))
    assert learn(out, "--resume") == 0


def test_the_error_names_tensor_and_step():
    assert str(NotFiniteError("train/loss", float("nan"), 12000)) == (
        "train/loss = nan after 12,000 steps: allowed are finite numbers"
    )


def test_a_best_policy_without_a_checkpoint_counts_as_a_run_and_a_resumed_run_removes_it(tmp_path, capsys):
    """A run killed between its first validation and its first checkpoint leaves only a best policy."""
    out = tmp_path / "run"
    assert learn(out, "--checkpoint-every", "99999", "--no-video", steps=192) == 0
    capsys.readouterr()
    for step in out.glob("step-*"):
        shutil.rmtree(step)
    later = out / checkpoint_name("best", 10**9)
    shutil.copytree(latest_checkpoint(out, "best"), later)
    assert learn(out, "--no-video", steps=192) == 2
    assert "--resume" in capsys.readouterr().err
    assert later.is_dir()
    assert learn(out, "--no-video", "--resume", steps=192) == 0
    assert not later.is_dir() and len(list(out.glob("best-*"))) >= 1

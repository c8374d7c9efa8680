"""training.ppo from start to end, killed and resumed, and its errors."""

import contextlib
import csv
import io
import json
import shlex
import shutil
import signal
from pathlib import Path

import numpy as np
import pytest
import torch
from gymnasium import spaces

from baselines.experiments.mission import Surroundings
from entropy_explore_env.command import BAD_INPUT, INTERRUPTED
from entropy_explore_env.envs.robot_vec_env import RobotVecEnv
from entropy_explore_env.settings.scenarios import SCENARIOS
from training import ppo
from training.advantages import DecisionBuffer
from training.checkpoints import checkpoint_name, latest_checkpoint, load_checkpoint
from training.validation import Validator

TINY = (
    "--scenario box-7x11x5 --robots 2 --missions 3 --threads 1 --rollout-steps 16 --batch 16 --epochs 2 "
    "--hidden 8 8 --validation-missions 1 --time-limit-s 40 --validate-every 150 --checkpoint-every 90 --json"
).split()


def learn(out: Path, *more: str, steps: int = 384) -> int:
    """The command in this process."""
    return ppo.run_command(ppo.main, [*TINY, "--out", str(out), "--total-steps", str(steps), *more])


def resume(out: Path, *more: str) -> int:
    """Continue a run in this process."""
    return ppo.run_command(ppo.main, ["--resume", str(out), *more])


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
    args = ppo.parsed(words)
    fresh = ppo.set_up(args, ppo.training_task(args))
    with contextlib.closing(Validator(fresh.settings.scenario, Surroundings(), 8, threads=1)) as validator:
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
    assert resume(out) == 0
    assert checkpoint_bits(out) == checkpoint_bits(uninterrupted[0])
    columns = ("steps", "mean_s", "median_s", "finished", "bits_per_bit")
    curves = []
    for run in (out, uninterrupted[0]):
        with (run / "curve.csv").open() as file:
            curves.append([[row[name] for name in columns] for row in csv.DictReader(file)])
    assert curves[0] == curves[1]
    assert load_checkpoint(latest_checkpoint(out, "best")).weights.keys()


@pytest.mark.parametrize("during", ["rollout", "validation", "last validation"])
def test_ctrl_c_writes_a_checkpoint_and_says_how_to_go_on(
    during, uninterrupted, tmp_path, capsys, monkeypatch
):
    out, interrupted = tmp_path / "run", []
    compute, validate = DecisionBuffer.compute_returns_and_advantage, Validator.validate

    def compute_interrupted(self, **given):
        if during == "rollout" and not interrupted and list(out.glob("step-*")):
            interrupted.append(1)
            signal.raise_signal(signal.SIGINT)
        return compute(self, **given)

    def validate_interrupted(self, policy, stop):
        if during != "rollout" and len(interrupted) < (2 if during == "last validation" else 1):
            interrupted.append(1)
            if len(interrupted) == (2 if during == "last validation" else 1):
                signal.raise_signal(signal.SIGINT)
        return validate(self, policy, stop)

    with monkeypatch.context() as patch:
        patch.setattr(DecisionBuffer, "compute_returns_and_advantage", compute_interrupted)
        patch.setattr(Validator, "validate", validate_interrupted)
        assert learn(out) == INTERRUPTED
    said = capsys.readouterr()
    assert "Ctrl-C again ends at once" in said.err
    stopped = json.loads(said.out)
    assert stopped["steps"] == {"rollout": 192, "validation": 192, "last validation": 384}[during]
    assert stopped["resume"] == f"python -m training.ppo --resume {out}"
    assert latest_checkpoint(out, "step").name == checkpoint_name("step", stopped["steps"])
    assert ppo.run_command(ppo.main, shlex.split(stopped["resume"])[3:]) == 0
    assert checkpoint_bits(out) == checkpoint_bits(uninterrupted[0])
    with (out / "curve.csv").open() as file:
        assert [row["steps"] for row in csv.DictReader(file)] == ["192", "384"]


def test_a_run_without_a_checkpoint_begins_again_and_says_so(tmp_path, capsys):
    """The folder alone names it; there is a checkpoint after the first update already."""
    out, loud = tmp_path / "run", [word for word in TINY if word != "--json"]
    words = [*loud, "--out", str(out), "--total-steps", "96", "--checkpoint-every", "9999", "--no-video"]
    assert ppo.run_command(ppo.main, words) == 0
    assert "          96 steps of 96, " in capsys.readouterr().err  # a line though this is no terminal
    assert [path.name for path in out.glob("step-*")] == [checkpoint_name("step", 96)]
    shutil.rmtree(out / checkpoint_name("step", 96))
    assert resume(out, "--total-steps", "3e2") == 0
    said = capsys.readouterr()
    assert f"no checkpoint in {out}: from the beginning; total_steps was 96" in said.err
    assert "          96 steps of 300, " in said.err
    assert [path.name for path in out.glob("step-*")] == [checkpoint_name("step", n) for n in (96, 384)]
    assert resume(out, "--total-steps", "400") == 0
    assert f"{out} goes on after 384 steps; total_steps was 96" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("words", "rollout"),
    [
        ("--robots 3 --total-steps 196_608", (64, 128)),  # 8 updates of 3 · 64 · 128 steps
        ("--robots 3 --total-steps 196_607", (64, 64)),
        ("--robots 1 --total-steps 10_000", (32, 32)),
        ("--robots 1 --total-steps 5_000", (16, 32)),
        ("--robots 4 --total-steps 1", (8, 16)),
        ("--robots 1 --total-steps 100 --missions 64", (64, 16)),
    ],
)
def test_a_short_run_has_short_rollouts_unless_it_is_told(words, rollout):
    args = ppo.parsed(words.split())
    assert (args.missions, args.rollout_steps) == rollout


def test_a_run_is_neither_overwritten_nor_continued_with_other_options(uninterrupted, tmp_path, capsys):
    out = uninterrupted[0]
    assert learn(out) == BAD_INPUT
    assert f"--resume {out} continues the run" in capsys.readouterr().err
    for words, said in (
        (["--gamma", "0.5"], "error: gamma = 0.5: expected 0.9, as in the run"),
        (["--channel.burst", "3"], "error: channel.burst = 3: expected 8, as in the run"),
        (["--scenario", "room"], "error: scenario = 'room': expected box-7x11x5, as in the run"),
        (["--out", str(tmp_path)], "error: out = "),
    ):
        assert resume(out, *words) == BAD_INPUT
        told = capsys.readouterr().err
        assert told.startswith(said) and told.count("\n") == 1
    assert resume(tmp_path) == BAD_INPUT
    assert "the folder of a run; it has no run.json" in capsys.readouterr().err


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


def test_a_best_policy_without_a_checkpoint_counts_as_a_run_and_a_resumed_run_removes_it(tmp_path, capsys):
    """A run killed between its first validation and its first checkpoint leaves only a best policy."""
    out = tmp_path / "run"
    assert learn(out, "--no-video", steps=192) == 0
    capsys.readouterr()
    for step in out.glob("step-*"):
        shutil.rmtree(step)
    later = out / checkpoint_name("best", 10**9)
    shutil.copytree(latest_checkpoint(out, "best"), later)
    assert learn(out, "--no-video", steps=192) == 2
    assert "--resume" in capsys.readouterr().err
    assert later.is_dir()
    assert resume(out) == 0
    assert not later.is_dir() and len(list(out.glob("best-*"))) >= 1


@pytest.mark.parametrize("name", SCENARIOS)
def test_the_defaults_make_a_policy_for_every_named_scenario(name):
    args = ppo.parsed(["--scenario", name, "--missions", "1"])
    ppo.check(args)
    task = ppo.training_task(args)
    scenario, state = task.scenario, ppo.set_up(args, task)
    moves = 5 if scenario.in_planes else 7
    gazes = args.yaws * (1 if scenario.planar else args.pitches)
    actions = state.envs.action_space
    assert isinstance(actions, spaces.Discrete) and actions.n == moves * gazes
    assert state.model.policy.observation_space == state.envs.observation_space

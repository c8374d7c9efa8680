"""What RLlib's trainer says to bad input, and what it keeps: none of this needs RLlib."""

import dataclasses
import errno
import math
import sys
from pathlib import Path
from typing import Any

import pytest

from baselines.cli.arguments import run_command
from baselines.cli.interruption import Interruption
from entropy_explore_env.command import INTERRUPTED
from training import rllib_ppo, runs
from training.checkpoints import NotFiniteError, SilentRunnersError
from training.rllib_ppo import Args, last_checkpoint, main
from training.validation import Validation


class Quiet:
    """Stands in for Ray where nothing is trained."""

    def shutdown(self) -> None:
        """Nothing was started."""


def test_a_folder_that_cannot_be_written(tmp_path, capsys, monkeypatch):
    def refuse(path: Path, content: str) -> None:
        raise PermissionError(errno.EACCES, "Permission denied", str(path))

    monkeypatch.setattr(runs, "write_atomically", refuse)
    monkeypatch.setattr(rllib_ppo, "start_ray", lambda address, runners: Quiet())
    assert run_command(main, ["--out", str(tmp_path)]) == 2
    said = capsys.readouterr().err
    assert "a folder that can be written (Permission denied)" in said and said.count("\n") == 1


def test_without_ray_the_extra_is_named(tmp_path, capsys, monkeypatch):
    monkeypatch.setitem(sys.modules, "ray", None)
    assert run_command(main, ["--out", str(tmp_path)]) == 2
    said = capsys.readouterr().err
    assert said.startswith("error: ray[rllib] is not installed: pip install torch --index-url ")
    assert said.endswith("then pip install 'entropy_explore_env[rllib]'\n") and said.count("\n") == 1
    assert not (tmp_path / runs.FILE).exists()  # nothing to continue


class Scripted:
    """Stands in for RLlib's Algorithm: 100 decisions an iteration, its losses as told; None = no report."""

    def __init__(self, losses: list[float | None], disk_full_at: int | None = None) -> None:
        self.losses, self.full, self.done = losses, disk_full_at, 0
        self.learner_group = self

    def get_weights(self) -> dict[str, str]:
        return {rllib_ppo.POLICY: "weights"}

    def train(self) -> dict[str, Any]:
        learner = dict.fromkeys(rllib_ppo.LOSSES, 0.5)
        loss = self.losses.pop(0)
        self.done += loss is not None
        learner["vf_loss"] = math.nan if loss is None else loss
        steps = {f"robot_{robot}": 50 * self.done for robot in range(2)}
        runners = {
            "num_agent_steps_sampled_lifetime": steps,
            "num_env_steps_sampled_lifetime": 80 * self.done,
            "episode_return_mean": 3.0,
            "t_mission_s": 7.0,
        }
        return {"env_runners": {**runners, "finished": 1.0}, "learners": {rllib_ppo.POLICY: learner}}

    def save_to_path(self, path: str) -> None:
        Path(path).mkdir()
        if self.done == self.full:
            raise OSError(errno.ENOSPC, "No space left on device", path)
        (Path(path) / "iteration").write_text(str(self.done))


def args_for(folder: Path, steps: int) -> Args:
    return Args(out=folder, robots=2, total_steps=steps, checkpoint_every=2)


def iterate(args: Args, algorithm: Scripted, iteration: int, asked: bool = False) -> bool:
    interruption = Interruption("it ends")
    interruption.asked = asked
    return rllib_ppo.iterate(args, algorithm, iteration, interruption, Unvalidated())


class Unvalidated:
    """Stands in for validations, none of which is due but the last."""

    next_at = math.inf

    def resume(self, decisions: int) -> None:
        """Nothing is kept."""

    def validate(self, reached: dict[str, float], weights: object) -> Validation:
        """The same for every policy."""
        assert set(reached) == {"decisions", "robot_steps", "seconds"} and weights == "weights"
        return Validation(7.0, 7.0, 1.0, None)


def test_checkpoints_come_and_go(tmp_path, capsys):
    assert iterate(args_for(tmp_path, 500), Scripted([0.1] * 5), iteration=0)
    assert [path.name for path in tmp_path.glob("*checkpoint*")] == ["checkpoint-000005"]
    rows = (tmp_path / "progress.csv").read_text().splitlines()
    assert (
        rows[0].startswith("iteration,decisions,robot_steps,return,t_mission_s,finished") and len(rows) == 6
    )
    assert rows[1].startswith("1,100,160,1.5,7.0,1.0,nan,0.5,0.5,0.1,0.5")
    said = capsys.readouterr().err
    assert "100 decisions  return   1.500  missions of 7 s, 100% finished" in said
    assert said.endswith("500 decisions  validated: missions take 7.0 s (median), 100% finished\n")


@pytest.mark.parametrize("bad", [math.nan, math.inf])
def test_a_loss_that_is_not_finite_stops_and_keeps_the_last_checkpoint(bad, tmp_path):
    with pytest.raises(NotFiniteError, match=r"vf_loss = (nan|inf) after 400 steps"):
        iterate(args_for(tmp_path, 900), Scripted([0.1, 0.1, 0.1, bad]), iteration=0)
    kept = last_checkpoint(tmp_path)
    assert kept is not None and (kept / "iteration").read_text() == "2"


def test_an_iteration_without_decisions_is_repeated_and_many_end_the_run(tmp_path, capsys):
    once = Scripted([None, 0.1, None, None, 0.1])
    assert iterate(args_for(tmp_path, 200), once, iteration=0)
    rows = (tmp_path / "progress.csv").read_text().splitlines()
    assert [row.split(",")[:2] for row in rows[1:]] == [["1", "100"], ["2", "200"]]
    assert capsys.readouterr().err.count("no runner has reported: once more") == 3
    with pytest.raises(SilentRunnersError, match="none of 2 runners reported within 900 s, after 100 dec"):
        iterate(args_for(tmp_path, 900), Scripted([0.1, None, None, None, 0.1]), iteration=0)
    assert not iterate(args_for(tmp_path, 900), Scripted([None, 0.1]), iteration=0, asked=True)


def test_a_silent_iteration_that_is_interrupted_leaves_a_checkpoint(tmp_path):
    interruption = Interruption("it ends")
    algorithm = Scripted([0.1, 0.1, 0.1, None])
    train = algorithm.train

    def train_until_silent():
        interruption.asked = len(algorithm.losses) == 1
        return train()

    algorithm.train = train_until_silent
    args = dataclasses.replace(args_for(tmp_path, 900), checkpoint_every=10)
    assert not rllib_ppo.iterate(args, algorithm, 0, interruption, Unvalidated())
    assert last_checkpoint(tmp_path) == tmp_path / "checkpoint-000003"


def test_a_resumed_run_has_each_iteration_once(tmp_path):
    """One of 300 decisions was killed before its last checkpoint."""
    iterate(args_for(tmp_path, 300), Scripted([0.1] * 3), iteration=0)
    (tmp_path / "checkpoint-000003").rename(tmp_path / "checkpoint-000002")
    resumed = []

    class Noted(Unvalidated):
        def resume(self, decisions: int) -> None:
            resumed.append(decisions)

    again = Scripted([0.1] * 2)
    again.done = 2
    rllib_ppo.iterate(args_for(tmp_path, 400), again, 2, Interruption("it ends"), Noted())
    rows = (tmp_path / "progress.csv").read_text().splitlines()
    assert [row.split(",")[:2] for row in rows[1:]] == [[str(n), str(100 * n)] for n in range(1, 5)]
    assert resumed == [200]
    rllib_ppo.iterate(args_for(tmp_path, 100), Scripted([0.1]), 0, Interruption("it ends"), Noted())
    assert len((tmp_path / "progress.csv").read_text().splitlines()) == 2 and resumed == [200]


def test_a_full_disk_keeps_the_last_checkpoint(tmp_path):
    with pytest.raises(OSError, match="No space left"):
        iterate(args_for(tmp_path, 900), Scripted([0.1] * 9, disk_full_at=4), iteration=0)
    kept = last_checkpoint(tmp_path)
    assert kept is not None and (kept / "iteration").read_text() == "2"
    iterate(args_for(tmp_path, 400), Scripted([0.1] * 4), iteration=2)  # despite what was left unfinished
    assert last_checkpoint(tmp_path) == tmp_path / "checkpoint-000006"


def test_an_interrupted_command_says_how_to_go_on(tmp_path, capsys, monkeypatch):
    def train(args: Args, env_settings: dict[str, Any], interruption: Interruption) -> bool:
        assert args.out is not None
        (args.out / "checkpoint-000003").mkdir(exist_ok=True)
        return False

    monkeypatch.setattr(rllib_ppo, "start_ray", lambda address, runners: Quiet())
    monkeypatch.setattr(rllib_ppo, "train", train)
    run = tmp_path / "run"
    assert run_command(main, ["--robots", "2", "--batch", "2000", "--out", str(run)]) == INTERRUPTED
    assert f"python -m training.rllib_ppo --resume {run}\n" in capsys.readouterr().out
    assert run_command(main, ["--out", str(run)]) == 2
    assert f"--resume {run} continues" in capsys.readouterr().err
    assert run_command(main, ["--resume", str(run), "--robots", "3"]) == 2
    assert "robots = 3: expected 2, as in the run" in capsys.readouterr().err
    assert run_command(main, ["--resume", str(run), "--runners", "1"]) == INTERRUPTED
    assert f"{run}: goes on after 3 iterations; runners was 2\n" == capsys.readouterr().err
    (run / "checkpoint-000003").rmdir()
    assert run_command(main, ["--resume", str(run)]) == INTERRUPTED
    assert f"{run}: no checkpoint: from the beginning\n" == capsys.readouterr().err

"""RLlib's trainer end to end: two runners on this machine, resumed; and nobody at the address."""
# pyright: reportMissingImports=false

from __future__ import annotations

import csv
import subprocess
import sys
from pathlib import Path

import pytest

pytest.importorskip("ray.rllib", reason="ray[rllib] is not installed: make test-rllib")

from ray.rllib.env.multi_agent_env_runner import MultiAgentEnvRunner

from baselines.cli.arguments import run_command
from training import ray_cluster
from training.rllib_ppo import Args, configure, environment_settings, main, parsed

pytestmark = [  # RLlib's own
    pytest.mark.filterwarnings("ignore::DeprecationWarning"),
    pytest.mark.filterwarnings("ignore::ResourceWarning"),
    pytest.mark.filterwarnings("ignore:.*already in registry"),
]
ROOT = Path(__file__).parents[3]
SMALL = "--scenario box-7x11x5 --missions 2 --batch 240 --minibatch 60 --epochs 2 --hidden 16"


def rows_of(folder: Path) -> list[dict[str, str]]:
    with (folder / "progress.csv").open(newline="", encoding="utf-8") as file:
        return list(csv.DictReader(file))


def test_it_trains_with_two_runners_and_resumes(tmp_path):
    """Runners of a process of its own, as a person starts it."""
    command = [sys.executable, "-m", "training.rllib_ppo", *SMALL.split(), "--out", str(tmp_path / "run")]
    first = subprocess.run(
        [*command, "--total-steps", "480"], cwd=ROOT, capture_output=True, text=True, timeout=900
    )
    assert first.returncode == 0, first.stderr
    assert first.stderr.count(" decisions ") == 2 and "Warning" not in first.stderr
    rows = rows_of(tmp_path / "run")
    assert [row["iteration"] for row in rows] == ["1", "2"]
    assert 480 <= float(rows[-1]["decisions"]) < 500
    assert [path.name for path in (tmp_path / "run").glob("checkpoint-*")] == ["checkpoint-000002"]
    words = ["--resume", str(tmp_path / "run"), "--total-steps", "720", "--runners", "0"]
    assert run_command(main, words) == 0
    rows = rows_of(tmp_path / "run")
    assert [row["iteration"] for row in rows] == ["1", "2", "3"]
    assert 720 <= float(rows[-1]["decisions"]) < 750
    assert [path.name for path in (tmp_path / "run").glob("checkpoint-*")] == ["checkpoint-000003"]


def missions_of(args: Args, iterations: int) -> list[tuple[int, bytes]]:
    """Seed and first robot's start of every mission of every runner."""
    config, missions = configure(args, environment_settings(args), iterations), []
    for worker in range(1, args.runners + 1):
        runner = MultiAgentEnvRunner(config=config, worker_index=worker, num_workers=args.runners)
        runner.sample(num_timesteps=0, random_actions=True)
        assert len(runner.env.envs) == args.missions
        for env in runner.env.envs or ():
            team = env.unwrapped.team
            missions.append((team.missions.seeds[0], team.view("robot_0").pose.tobytes()))
    return missions


def test_runners_explore_different_missions_and_repeat_them(tmp_path):
    """Runners as Ray starts them, one after the other in this process; those of a resumed run differ, too."""
    words = "--scenario box-7x11x5 --missions 2 --runners 2 --batch 40 --minibatch 20 --hidden 8"
    args = parsed([*words.split(), "--out", str(tmp_path)])
    first, resumed = missions_of(args, iterations=0), missions_of(args, iterations=5)
    assert len({seed for seed, _ in [*first, *resumed]}) == 8
    assert len({start for _, start in [*first, *resumed]}) == 8
    assert missions_of(args, iterations=0) == first


def test_nobody_at_the_address(tmp_path, capsys, monkeypatch):
    monkeypatch.setattr(ray_cluster, "ANSWER_TIMEOUT_S", 3.0)
    assert run_command(main, ["--address", "127.0.0.1:9", "--out", str(tmp_path)]) == 2
    said = capsys.readouterr().err
    assert said == "error: address = '127.0.0.1:9': allowed is that of a Ray cluster that answers\n"
    assert run_command(main, ["--address", "auto", "--out", str(tmp_path)]) == 2
    assert capsys.readouterr().err.count("\n") == 1

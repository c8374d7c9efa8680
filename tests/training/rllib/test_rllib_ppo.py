"""RLlib's trainer end to end: two runners on this machine, resumed; and nobody at the address."""
# pyright: reportMissingImports=false

import csv
import os
import re
import signal
import subprocess
import sys
from pathlib import Path

import pytest

pytest.importorskip("ray.rllib", reason="ray[rllib] is not installed: make test-rllib", exc_type=ImportError)

from ray.rllib.env.multi_agent_env_runner import MultiAgentEnvRunner

from baselines.cli.arguments import run_command
from baselines.experiments import ray_cluster
from baselines.experiments.mission import run_mission
from baselines.strategies import make_strategy
from entropy_explore_env.envs.parallel_env import EntropyExploreEnv
from tests.systems import processes_with
from training.checkpoints import latest_checkpoint, load_checkpoint
from training.rllib_ppo import Args, main, parsed
from training.rllib_run import configure, environment_settings, read_rows

pytestmark = [  # RLlib's own
    pytest.mark.filterwarnings("ignore::DeprecationWarning"),
    pytest.mark.filterwarnings("ignore::ResourceWarning"),
    pytest.mark.filterwarnings("ignore:.*already in registry"),
]
ROOT = Path(__file__).parents[3]
SMALL = (
    "--scenario box-7x11x5 --missions 2 --batch 240 --minibatch 60 --epochs 2 --hidden 16 "
    "--time-limit-s 60 --validation-missions 2 --validate-every 240"
)


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
    said = re.findall(r" decisions  (return|no mission has ended yet|validated: )", first.stderr)
    assert len(said) == 4 and said[-2] == "return" and "Warning" not in first.stderr
    assert said[1::2] == ["validated: "] * 2
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


def test_its_policy_is_a_strategy_and_learns_on_from_where_it_was(tmp_path):
    """The kept policy acts in missions; a resumed run has the weights and the normalisation of before."""
    run = tmp_path / "run"
    words = [*SMALL.split(), "--runners", "0", "--out", str(run)]
    assert run_command(main, [*words, "--total-steps", "480"]) == 0
    curve = read_rows(run / "curve.csv")
    assert [row["decisions"] for row in curve] == [float(row["decisions"]) for row in rows_of(run)]
    kept = load_checkpoint(latest_checkpoint(run, "best"))
    count = float(kept.normalisation["observations_count"])
    assert count in [row["decisions"] for row in curve]
    strategy = make_strategy(str(run))
    env = EntropyExploreEnv("box-7x11x5", robots=3, time_limit_s=30.0)
    run_mission(env, strategy, seed=0)
    assert env.missions.state.robots[0]["scans"].min() > 1
    assert run_command(main, ["--resume", str(run), "--total-steps", "720"]) == 0
    again = read_rows(run / "curve.csv")
    assert again[:2] == curve and len(again) == 3 and 720 <= again[2]["decisions"] < 750
    late = load_checkpoint(latest_checkpoint(run, "best"))
    assert float(late.normalisation["observations_count"]) in [row["decisions"] for row in again]


@pytest.mark.skipif(not Path("/proc/self/cmdline").exists(), reason="looks processes up in /proc")
def test_a_runner_that_is_killed_is_replaced(tmp_path):
    mark = f"RUNNERS_OF_{os.getpid()}"
    command = [sys.executable, "-m", "training.rllib_ppo", *SMALL.split(), "--out", str(tmp_path / "run")]
    words = [*command, "--total-steps", "1900", "--runners", "2"]
    with subprocess.Popen(
        words, cwd=ROOT, stderr=subprocess.PIPE, text=True, env={**os.environ, mark: "1"}
    ) as run:
        assert run.stderr is not None
        lines = iter(run.stderr.readline, "")
        assert any(" decisions " in line for line in lines), run.poll()
        runners = processes_with(mark, b"ray::MultiAgentEnvRunner")
        assert len(runners) == 2
        os.kill(runners[0], signal.SIGKILL)
        rest = run.stderr.read()
    assert run.returncode == 0, rest
    rows = rows_of(tmp_path / "run")
    assert 1900 <= float(rows[-1]["decisions"]) < 2200 and "RunnerDied" not in rest


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
    assert said == "error: address = '127.0.0.1:9': expected the address of a Ray cluster that answers\n"
    assert run_command(main, ["--address", "auto", "--out", str(tmp_path)]) == 2
    assert capsys.readouterr().err.count("\n") == 1

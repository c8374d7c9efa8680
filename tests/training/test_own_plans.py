"""Plans of one's own: a list to learn in, others to validate and to test in, from the command line."""

import json

import numpy as np
import pytest
from PIL import Image

from baselines.cli.arguments import run_command
from baselines.experiments.rows import read_table
from entropy_explore_env.command import BAD_INPUT
from entropy_explore_env.settings.changes import with_settings
from entropy_explore_env.settings.json import settings_of
from entropy_explore_env.settings.scenarios import BOX
from training import evaluate, ppo
from training.checkpoints import latest_checkpoint, load_checkpoint

TINY = (
    "--scenario office --robots 1 --missions 2 --threads 1 --rollout-steps 8 --batch 8 --epochs 1 --hidden 8 "
    "--total-steps 32 --validation-missions 2 --validate-every 32 --time-limit-s 20 --json --no-video"
).split()


@pytest.fixture
def plans(tmp_path):
    """Name → file of a plan; those to learn in have one name in two folders."""
    files = {}
    for place, (name, width) in enumerate((("a/plan", 44), ("b/plan", 40), ("held", 46), ("test", 38))):
        pixels = np.full((30, width), 254, np.uint8)
        pixels[8:20, 12 + 2 * place : 16 + 2 * place] = 0
        files[name] = tmp_path / f"{name}.png"
        files[name].parent.mkdir(exist_ok=True)
        Image.fromarray(pixels).save(files[name])
    return files


def test_a_policy_learns_in_plans_and_is_tested_in_others(plans, tmp_path, capsys, monkeypatch):
    monkeypatch.chdir(tmp_path)
    run = tmp_path / "run"
    files = "--world a/plan.png b/plan.png --validation-world held.png"
    words = [*TINY, *files.split(), "--robot.reach-m", "2"]
    assert run_command(ppo.main, [*words, "--out", "run"]) == 0
    capsys.readouterr()
    learned = load_checkpoint(latest_checkpoint(run, "step")).settings.scenario
    assert learned.grid.shape == (22, 15, 1) and learned.robot.reach_m == 2.0
    kept = json.loads((run / "run.json").read_text())
    assert kept["args"]["task"]["world"] == [str(plans["a/plan"]), str(plans["b/plan"])]
    assert list(kept["files"]) == [str(plans[name]) for name in ("a/plan", "b/plan", "held")]
    args = ppo.parsed([*words, "--missions", "8"])
    task = ppo.training_task(args)
    state = ppo.set_up(args, task)
    state.envs.reset()
    names = {world.name for world in state.envs.vector_env.missions.worlds}
    assert names == {"a/plan", "b/plan"}
    held = ppo.validation_task(args.task, args.validation_world, state.settings.scenario, task)
    assert held.surroundings.files() == [plans["held"]]
    # It goes on from anywhere, and not if a plan has changed.
    monkeypatch.chdir("/")
    assert run_command(ppo.main, ["--resume", str(run), "--total-steps", "48"]) == 0
    capsys.readouterr()
    test = ["--strategy", str(run), "--seeds", "2", "--jobs", "1", "--runs", str(tmp_path / "missions")]
    test += ["--against", "random", "--json"]
    assert run_command(evaluate.main, test) == BAD_INPUT  # not in other worlds, unasked
    assert capsys.readouterr().err.startswith("error: world = 'left out'")
    test += ["--world", str(plans["test"]), "--time-limit-s", "20"]
    assert run_command(evaluate.main, test) == 0
    assert [row["strategy"] for row in json.loads(capsys.readouterr().out)["rows"]] == [str(run), "random"]
    missions = read_table(tmp_path / "missions" / "missions.jsonl")
    assert len(missions) == 4 and {mission.record["world"] for mission in missions} == {"test"}
    plans["a/plan"].write_bytes(plans["b/plan"].read_bytes())
    assert run_command(ppo.main, ["--resume", str(run), "--total-steps", "64"]) == BAD_INPUT
    assert f"error: world = '{plans['a/plan']}': expected the file that" in capsys.readouterr().err


def test_a_policy_that_observes_the_whole_map_is_validated_in_plans_of_its_size(plans, tmp_path, capsys):
    words = [*TINY, "--overview", "--features", "maps", "--out", str(tmp_path / "run")]
    narrow = tmp_path / "narrow.png"  # 7 voxels wide, one less than the overview has cells
    Image.fromarray(np.full((30, 14), 254, np.uint8)).save(narrow)
    words += ["--world", str(plans["a/plan"]), "--validation-world", str(narrow)]
    assert run_command(ppo.main, words) == BAD_INPUT
    assert capsys.readouterr().err.startswith("error: validation_world = ")


def test_what_a_settings_file_says_is_learned_and_kept(tmp_path, capsys):
    """A scenario of its own: team, time limit and cost of a second are the file's, not training's."""
    changes = {"name": "mine", "robots": 1, "time_limit_s": 12.0, "reward": {"cost_per_s": 0.5}}
    (tmp_path / "mine.json").write_text(json.dumps(settings_of(with_settings(BOX, changes))))
    words = " ".join(TINY)
    for gone in ("--scenario office ", "--robots 1 ", "--time-limit-s 20 "):
        words = words.replace(gone, "")
    out = tmp_path / "run"
    assert (
        run_command(ppo.main, [*words.split(), "--settings", str(tmp_path / "mine.json"), "--out", str(out)])
        == 0
    )
    (tmp_path / "mine.json").unlink()  # the run holds what it said
    assert run_command(ppo.main, ["--resume", str(out), "--total-steps", "48"]) == 0
    learned = load_checkpoint(latest_checkpoint(out, "step")).settings.scenario
    assert (learned.name, learned.robots, learned.ending.time_limit_s) == ("mine", 1, 12.0)
    assert learned.reward.cost_per_s == 0.5 and learned.grid == BOX.grid
    assert ppo.training_task(ppo.parsed([])).scenario.ending.time_limit_s == 2000.0

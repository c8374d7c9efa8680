"""Words that a command cannot use are one line and code 2, before anything is run or written."""

from __future__ import annotations

import importlib
import json
import re
import shlex

import numpy as np
import pytest

from baselines.cli.arguments import run_command
from baselines.experiments import trials
from benchmarks.proofs.world_samples import pgm
from entropy_explore_env.settings.json import settings_of
from entropy_explore_env.settings.scenarios import BOX
from tests.systems import needs_posix

NEEDS = {"baselines.episodes": "pyarrow", "training.ppo": "torch"}
OF_POSIX = ("--out FLOOR/below", "--out /proc/nowhere")
"""Paths that other systems take for a file or folder that is not there yet."""
TEAM = "box-7x11x5 --robots 2"
TRAINED = "--scenario box-7x11x5 --robots 2 --total-steps 64 --no-video"
CHOOSING = f"{TRAINED} --actions candidates --reward seconds --critic privileged"

REFUSED = {
    "baselines.run": [
        ("nowhere", "scenario = 'nowhere'.*box-7x11x5"),
        ("''", "scenario = ''"),
        ("box-7x11x5 more", "more"),
        ("box-7x11x5 --frobnicate 3", "--frobnicate"),
        ("box-7x11x5 --strategy dance", "strategy = 'dance'.*gradient"),
        ("box-7x11x5 --robots 0", "robots = 0"),
        ("box-7x11x5 --robots 900 --json", "robots = 900.*at most"),
        ("box-7x11x5 --seed -1", "seed = -1"),
        ("box-7x11x5 --sensor.field-of-view-rad 9 1", r"field_of_view_rad = \(9"),
        ("box-7x11x5 --voxel-size-m 0.2", "voxel_size_m.*--world"),
        ("box-7x11x5 --world missing.bt", "world.*missing.bt.*exists"),
        ("box-7x11x5 --world plan.pdf", r"world.*plan.pdf.*\.bt"),
        ("room --height-m 2", "height_m.*--world"),
        ("room --negate", "negate.*--world"),
        ("room --hollow", "hollow.*--world"),
        ("room --world FLOOR --ceiling-m 2", "ceiling_m.*does not apply"),
        ("room --world FLOOR --height-m -2", "height_m.*a number > 0"),
        ("room --world office --height-m 2", "a file"),
        (f"{TEAM} --starts nowhere.json", "starts.*nowhere.json"),
        (f"{TEAM} --starts '[[1, 2'", "starts.*JSON"),
        (f"{TEAM} --starts '[1, 2]'", "starts.*JSON"),
        (f"{TEAM} --starts '[[1, 2, 0.5], [1, 2, 0.5]]'", r"starts\[0\].*flies"),
        (f"{TEAM} --starts '[[1, 2, 1, 0, 0]]'", r"starts.*\(2, 5\)"),
        (f"{TEAM} --starts '[[1, 2, 1, 0, 0], [1, 2, 1, 0, 0]]'", r"starts\[1\].*robot_0"),
        (f"{TEAM} --world-number -1", "world = -1.*0 to 2147483647"),
        (f"{TEAM} --world FLOOR --world-number 1", "world = 1.*only the worlds of recipes"),
    ],
    "baselines.benchmark": [
        ("--suite plan", "suite = 'plan'"),
        ("--suite plans --scenarios room", "scenarios"),
        ("--suite faults --time-limit-s 3", "time_limit_s"),
        ("--suite plans --robot.reach-m 2", "robot.reach_m = "),
        ("--settings mine.json --scenarios room", "scenarios = "),
        ("--scenarios room --negate", "negate = "),
        ("--scenarios rooom", "rooom"),
        ("--scenarios room,room", "room"),
        ("--world nowhere.bt", "nowhere.bt"),
        ("--strategies magic", "magic"),
        ("--robots 0", "robots"),
        ("--robots 2,2", "robots"),
        ("--seeds 0", "seeds = 0"),
        ("--jobs 0", "jobs = 0"),
        ("--time-limit-s inf", "time_limit_s = inf"),
        ("--wall-limit-s nan", "wall_limit_s = nan"),
        ("--stop-after-s -1", "stop_after_s = -1"),
        ("--world-scenario moon", "moon"),
        ("--rerun --since HEAD", "since = 'HEAD'"),
        ("--since nowhere", "since = 'nowhere'"),
        ("--archive nowhere.jsonl.xz", "nowhere.jsonl.xz"),
        ("--out FLOOR/below", "floor.pgm/below.*a folder that can be made"),
        ("--out /proc/nowhere", "out = '/proc/nowhere': expected a folder"),
    ],
    "baselines.films": [
        ("--scenarios box-7x11x5 --beside plannedrate", "plannedrate"),
        ("--scenarios room,moon", "scenarios = 'moon'"),
    ],
    "baselines.episodes": [
        ("--missions 0", "missions = 0"),
        ("--missions-per-file 0", "missions_per_file = 0"),
        ("--first-seed -1", "first_seed = -1"),
        ("--strategy unknown", "unknown"),
        ("--cluster nowhere", "HOST:PORT"),
        ("--observation.patch-shape 2 2 2", "odd numbers"),
    ],
    "baselines.papers.__main__": [
        ("rocha05", "paper = 'rocha05': expected one of rocha04"),
        ("rocha04 --seeds 0", "seeds = 0: expected a whole number"),
        ("sawhney --seeds 1", "seeds = 1: expected a whole number ≥ 2"),
        ("rocha04 --rerun --since HEAD", "since = 'HEAD': expected no value"),
        ("rocha04 --since nothing", "since = 'nothing': expected a commit"),
    ],
    "training.ppo": [
        ("--scenario cellar", "cellar"),
        ("--total-steps 0", "total_steps = 0"),
        ("--gamma 0", "gamma = 0"),
        ("--learning-rate nan", "learning_rate = nan"),
        ("--entropy -1", "entropy = -1"),
        ("--hidden 0", "hidden = "),
        ("--seed -1", "seed = -1"),
        ("--patch", "patch"),
        ("--actions mixed", "actions"),
        (f"{CHOOSING} --width 6", "width = 6"),
        (f"{CHOOSING} --features maps", "features = 'maps'"),
        (f"{CHOOSING} --overview", "overview"),
        (f"{CHOOSING} --candidates 65", "candidates = 65"),
        (f"{CHOOSING} --target-kl 0", "target_kl = 0"),
        (f"{CHOOSING} --critic-first -1", "critic_first = -1"),
        (f"{CHOOSING} --actions discrete", "critic = 'privileged'"),
        (f"{CHOOSING} --actions discrete --critic observed --critic-first 2", "critic_first = 2"),
        (f"{CHOOSING} --hidden 64 64", "hidden = .*expected no value "),
        (f"{CHOOSING} --yaws 8", "yaws = 8: expected no value "),
        (f"{CHOOSING} --pitches 3", "pitches = 3: expected no value "),
        (f"{CHOOSING} --cost-per-s 0.5", "cost_per_s = 0.5: expected no value "),
        (f"{TRAINED} --width 8", "width = 8: expected no value "),
        (f"{TRAINED} --actions continuous --candidates 5", "candidates = 5: expected no value "),
    ],
    "training.rllib_ppo": [
        ("--scenario nowhere", "nowhere"),
        ("--seed -1", "seed = -1"),
        ("--runners -1", "runners = -1"),
        ("--total-steps 0", "total_steps = 0"),
        ("--validation-missions 0", "validation_missions = 0"),
        ("--minibatch 64 --batch 32", "minibatch = 64: expected at most the batch, 32"),
        ("--learning-rate nan", "learning_rate = nan"),
        ("--gamma 1.1", "gamma = 1.1"),
        ("--entropy -1", "entropy = -1"),
        ("--hidden 0", r"hidden = \(0,\)"),
        ("--address somewhere", "HOST:PORT of a Ray cluster"),
        ("--resume nowhere", "the folder of a run"),
    ],
    "benchmarks.speed": [
        ("--out .", "a file in a folder that exists"),
        ("--out no/such/folder/speed.md", "no/such/folder"),
    ],
    "benchmarks.proofs.__main__": [
        ("luck", "names = 'luck': expected one of settings, states, determinism"),
        ("--cases 0", "cases = 0: expected a whole number ≥ 1"),
        ("--cases 5 --full", "cases = 5: expected no value beside --full"),
        ("--first -1", "first = -1: expected a whole number ≥ 0"),
        ("--limit-s 0", "limit_s = 0.0: expected a number > 0"),
        ("--limit-s nan", "limit_s = nan"),
        ("--out .", r"a Markdown file, \.md, and no folder"),
        ("--out page.txt", r"a Markdown file, \.md, and no folder"),
        ("--out FLOOR/page.md", "a folder that can be made"),
    ],
    "entropy_explore_env.envs.conformance": [
        ("", "SCENARIO"),
        ("nowhere", "nowhere"),
        ("room --robots few", "few"),
        ("room --steps 0", "max_cycles"),
        ("room --world nowhere.bt", "nowhere.bt"),
    ],
    "entropy_explore_env.warm": [
        ("rom", "did you mean room"),
        ("nothing-like-it", "one of room"),
        ("room --processes 0", "processes = 0"),
    ],
    "entropy_explore_env.worlds.commands": [
        ("", "--help"),
        ("draw", "draw"),
        ("show room-furnished --out world.jpg", "world.jpg"),
        ("show room-furnished --out world.png --voxel-size-m 0.1", "voxel_size_m"),
        ("show room-furnished --out world.png --seed -1", "seed = -1"),
        ("show nowhere.bt --out world.png", "nowhere.bt"),
        ("show castle --out world.png", "castle"),
        ("convert nowhere.bt world.bt", "world.bt"),
        ("show FLOOR --out world.png --voxel-size-m nan", "voxel_size_m = nan"),
        ("show FLOOR --out world.png --voxel-size-m wide", "wide"),
        ("show FLOOR --out FLOOR/world.png", "out"),
        ("show FLOOR --world-number 3", "world_number = 3: expected no value for a file"),
        ("show office --world-number -3", "world_number = -3: expected a whole number"),
        ("show office --world-number 3 --seed 1", "seed = 1: expected no value beside"),
        ("show office --world-number 3 --seed 0", "seed = 0: expected no value beside"),
        ("show office --world-number 3 --split test", "split = 'test': expected no value beside"),
        ("list nowhere", "nowhere"),
    ],
}


@pytest.mark.parametrize(
    ("module", "words", "said"),
    [
        pytest.param(module, *case, marks=needs_posix if case[0] in OF_POSIX else ())
        for module, cases in REFUSED.items()
        for case in cases
    ],
)
def test_words_that_a_command_cannot_use_are_refused(module, words, said, tmp_path, monkeypatch, capsys):
    if module in NEEDS:
        pytest.importorskip(NEEDS[module], reason=f"{NEEDS[module]} is not installed")
    floor = tmp_path / "floor.pgm"
    floor.write_bytes(pgm(np.full((50, 60), 254, np.uint8)))
    (tmp_path / "mine.json").write_text(json.dumps(settings_of(BOX)))
    monkeypatch.setattr(trials, "run_each", lambda *_, **__: pytest.fail("missions were run"))
    monkeypatch.chdir(tmp_path)
    before = set(tmp_path.rglob("*"))
    given = [word.replace("FLOOR", str(floor)) for word in shlex.split(words)]
    assert run_command(importlib.import_module(module).main, given) == 2
    told = capsys.readouterr()
    assert told.out == "" and told.err.startswith("error: ") and told.err.count("\n") == 1
    assert re.search(said, told.err), told.err
    written = set(tmp_path.rglob("*")) - before
    assert not [path for path in written if path.is_file() or "--since" not in words]  # git is asked late

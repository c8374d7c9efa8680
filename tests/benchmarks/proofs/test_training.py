"""Training runs that are killed and resumed, and what is looked for in what they wrote."""

from __future__ import annotations

import random

import pytest
import torch

from benchmarks.proofs import training
from benchmarks.proofs.cases import BrokenPromiseError
from benchmarks.proofs.training import check_curve, check_policy, train
from entropy_explore_env.settings.scenarios import BOX
from tests.systems import needs_posix
from training.checkpoints import Checkpoint, PolicySettings, checkpoint_name, save_checkpoint

pytestmark = needs_posix

SMALL = (
    "--scenario box-7x11x5 --robots 2 --missions 2 --rollout-steps 32 --validation-missions 2 "
    "--time-limit-s 60 --checkpoint-every 512 --total-steps 16384"
)


@pytest.mark.long
def test_a_run_is_killed_resumed_and_ends(tmp_path, monkeypatch):
    trainer = training.TRAINERS["training.ppo"]._replace(words=("--threads", "1", "--no-video"))
    monkeypatch.setitem(training.TRAINERS, "training.ppo", trainer)
    assert train("training.ppo", tmp_path / "run", tuple(SMALL.split()), 2, random.Random(0)) == 16384


@pytest.mark.long
def test_a_run_that_ends_before_it_is_killed_is_told(tmp_path):
    with pytest.raises(BrokenPromiseError, match=r"ended with 2 before it was to be killed"):
        train("training.ppo", tmp_path / "run", ("--robots", "no"), 1, random.Random(0))
    with pytest.raises(BrokenPromiseError, match=r"training.ppo ended with 2: .*robots"):
        train("training.ppo", tmp_path / "run", ("--robots", "no"), 0, random.Random(0))


@pytest.mark.parametrize("cell", ["nan", "inf"])
def test_a_figure_that_is_not_finite_is_found(tmp_path, cell):
    curve = tmp_path / "curve.csv"
    curve.write_text("steps,mean_s,bits_per_bit,planner_ratio\n100,7.5,,\n200,7.0,0.5,1.1\n")
    assert check_curve(curve, "steps") == 200
    curve.write_text(f"steps,mean_s,bits_per_bit\n100,7.5,\n200,{cell},0.5\n")
    with pytest.raises(BrokenPromiseError, match=f"mean_s is {cell} after 200 steps"):
        check_curve(curve, "steps")


def test_a_weight_that_is_not_finite_is_found(tmp_path):
    weights = {"layer": torch.ones(3), "last": torch.ones(2)}
    save_checkpoint(tmp_path / checkpoint_name("best", 1), Checkpoint(PolicySettings(BOX), {}, weights, {}))
    check_policy(tmp_path)
    weights["last"][1] = torch.nan
    save_checkpoint(tmp_path / checkpoint_name("best", 2), Checkpoint(PolicySettings(BOX), {}, weights, {}))
    with pytest.raises(BrokenPromiseError, match="last holds a number that is not finite"):
        check_policy(tmp_path)

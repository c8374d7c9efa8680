"""The examples for other trainers do what they say, and pages show all of them."""

import runpy
import sys
from pathlib import Path

import numpy as np
import pytest

from tests.code_blocks import shown_files

ROOT = Path(__file__).parents[2]
EXAMPLES = ROOT / "training" / "examples"


def test_pages_show_the_files():
    files = set(EXAMPLES.glob("[a-z]*.py"))
    assert files <= set(shown_files()) and len(files) > 2


@pytest.mark.filterwarnings("ignore")  # TorchRL's and PettingZoo's own
@pytest.mark.parametrize("words", [[], ["candidates"]])
def test_torchrl_trains(words, capsys, monkeypatch):
    pytest.importorskip("torchrl", reason="torchrl is not installed")
    monkeypatch.setattr(sys, "argv", ["torchrl_wrapper.py", *words])
    ran = runpy.run_path(str(EXAMPLES / "torchrl_wrapper.py"))
    lines = capsys.readouterr().out.splitlines()
    assert [line.split(":")[0] for line in lines] == [f"update {number}" for number in range(ran["UPDATES"])]
    most = 3 * 30 * 2 * ran["MISSIONS"]  # robots, seconds, decisions a second
    assert all(0 < int(line.split()[2]) < most // 2 for line in lines)  # robots are busy most of the time
    assert np.isfinite(ran["returns"]).all() and np.isfinite(ran["loss"].item())
    weights = list(ran["loss_module"].parameters())
    state = ran["optimiser"].state
    assert all(float(state[weight]["step"]) == ran["UPDATES"] * ran["EPOCHS"] for weight in weights)
    assert all(float(state[weight]["exp_avg"].abs().max()) > 0.0 for weight in weights)
    rows = ran["batch"]
    likeliest = ran["scores"](rows["observation"]).masked_fill(~rows["action_mask"], -np.inf).argmax(1)
    assert (rows["action"] == likeliest).float().mean() < 0.5  # actions are drawn
    assert rows["action_mask"].gather(1, rows["action"][:, None]).all()


def test_a_loop_in_cleanrl_s_form_learns_from_choices(capsys):
    torch = pytest.importorskip("torch", reason="torch is not installed")
    ran = runpy.run_path(str(EXAMPLES / "cleanrl_loop.py"))
    lines = capsys.readouterr().out.splitlines()
    updates, most = ran["UPDATES"], ran["MISSIONS"] * ran["ROBOTS"] * ran["LIMIT_S"]
    assert [line.split(":")[0] for line in lines] == [f"update {number}" for number in range(updates)]
    counts = [int(line.split()[2]) for line in lines]
    assert all(0 < count < most // 2 for count in counts)  # robots are busy most of the time
    assert len(ran["returns"]) == updates and np.isfinite(ran["returns"]).all()
    assert max(ran["returns"]) > 0.0  # bits were gained
    assert torch.isfinite(ran["loss"]) and all(one["mask"][one["action"]] for one in ran["learned"])
    moved = [ran["optimiser"].state[weight]["exp_avg"].abs().max() for weight in ran["weights"]]
    assert all(0.0 < float(each) < 1e3 for each in moved)
    assert float(ran["optimiser"].state[ran["weights"][0]]["step"]) == updates * ran["EPOCHS"]


@pytest.mark.filterwarnings("ignore")  # TorchRL's
def test_mappo_s_critic_reads_the_state_of_the_team(tmp_path, monkeypatch):
    pytest.importorskip("benchmarl", reason="benchmarl is not installed: make test-benchmarl")
    monkeypatch.chdir(tmp_path)  # it leaves a folder
    ran = runpy.run_path(str(EXAMPLES / "benchmarl_mappo.py"))
    assert ran["experiment"].total_frames == 256
    assert ran["critic"].in_keys == ["state"]
    actor = ran["experiment"].losses["robot"].actor_network
    assert ("robot", "observation") in actor.in_keys and "state" not in actor.in_keys


@pytest.mark.filterwarnings("ignore")
def test_rows_of_stable_baselines3_say_whether_they_decided():
    pytest.importorskip("stable_baselines3", reason="stable-baselines3 is not installed")
    ran = runpy.run_path(str(EXAMPLES / "stable_baselines3_ppo.py"))
    assert ran["policy"].num_timesteps >= 1024
    assert ran["observations"].shape[0] == 8 and [i["decided"] for i in ran["infos"]] == [True] * 8

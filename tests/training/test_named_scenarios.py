"""training.ppo starts in every named scenario with its defaults."""

from __future__ import annotations

import json

import pytest
from gymnasium import spaces

from entropy_explore_env.scenarios import SCENARIOS
from training import ppo

FEW = (
    "--missions 2 --rollout-steps 4 --batch 8 --epochs 1 --validation-missions 1 --time-limit-s 3 "
    "--no-video --json"
).split()


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


@pytest.mark.parametrize(
    "name", [pytest.param(name, marks=() if name == "office" else pytest.mark.long) for name in SCENARIOS]
)
def test_training_begins_in_every_named_scenario(name, tmp_path, capsys):
    """Three rollouts and updates, a validation and a checkpoint."""
    robots = ppo.training_task(ppo.parsed(["--scenario", name])).scenario.robots
    steps = 3 * 4 * 2 * robots
    words = [*FEW, "--scenario", name, "--total-steps", str(steps), "--out", str(tmp_path / "run")]
    assert ppo.run_command(ppo.main, words) == 0
    assert json.loads(capsys.readouterr().out)["steps"] == steps
    assert list((tmp_path / "run").glob("step-*"))

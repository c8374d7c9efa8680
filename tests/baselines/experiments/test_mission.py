"""One mission of a strategy through the environment."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import pytest

from baselines.experiments.mission import run_mission, scripted
from baselines.strategies import make_strategy
from baselines.strategies.protocol import random_viewpoint
from entropy_explore_env.envs.parallel_env import EntropyExploreEnv
from entropy_explore_env.errors import ActionError
from entropy_explore_env.missions.records import MissionEnd
from entropy_explore_env.missions.view import RobotView
from entropy_explore_env.settings.scenario import Scenario
from entropy_explore_env.settings.scenarios import BOX


class Noting:
    """Wanders, and keeps what it was given."""

    def __init__(self) -> None:
        self.resets: list[Scenario] = []
        self.asked: list[list[RobotView]] = []

    def reset(self, scenario: Scenario, rng: np.random.Generator) -> None:
        self.resets.append(scenario)
        self.rng = rng
        self.first = rng.bit_generator.state

    def choose_all(self, views: Sequence[RobotView]) -> list[np.ndarray]:
        self.asked.append(list(views))
        return [random_viewpoint(view, self.rng) for view in views]


def test_a_strategy_is_asked_for_the_robots_that_decide_until_the_mission_is_over():
    env, strategy, moments = EntropyExploreEnv(scripted(BOX), robots=3), Noting(), []
    run_mission(env, strategy, 4, lambda env: moments.append(float(env.missions.state.missions[0]["time_s"])))
    assert env.agents == [] and env.missions.over(0) is MissionEnd.MAPPED
    assert strategy.resets == [env.scenario]
    assert len(moments) == len(strategy.asked) + 1
    assert moments[0] == 0.0 and (np.diff(moments) > 0).all()
    assert [view.robot for view in strategy.asked[0]] == [0, 1, 2]
    for views, time_s in zip(strategy.asked, moments[:-1], strict=True):
        numbers = [view.robot for view in views]
        assert numbers == sorted(set(numbers)) and numbers
        assert all(view.deciding and view.time_s == time_s for view in views)
    fresh = EntropyExploreEnv(scripted(BOX))
    fresh.reset(seed=4)
    assert strategy.first == fresh.strategy_generator().bit_generator.state


@pytest.mark.parametrize("kind", ["continuous", "discrete"])
@pytest.mark.parametrize("period_s", [None, 0.7])
def test_the_same_seed_gives_the_same_mission(kind, period_s):
    env = EntropyExploreEnv(BOX, decision_period_s=period_s, action={"kind": kind}, time_limit_s=40.0)
    states = []
    for seed in (5, 6, 5):
        run_mission(env, make_strategy("gradient"), seed)
        states.append([array.tobytes() for array in env.missions.state])
    assert states[0] == states[2] != states[1]


def test_scripted_scenarios_step_from_decision_to_decision_and_observe_nothing():
    changed = scripted(BOX)
    assert changed.decision_period_s is None
    assert EntropyExploreEnv(changed).missions.layout.size == 0
    assert (changed.robot, changed.channel, changed.grid) == (BOX.robot, BOX.channel, BOX.grid)


def test_a_strategy_that_chooses_for_too_few_robots_is_refused():
    strategy = Noting()
    strategy.choose_all = lambda views: []
    with pytest.raises(ActionError, match="one for each of 3 views"):
        run_mission(EntropyExploreEnv(scripted(BOX), robots=3), strategy, 4)

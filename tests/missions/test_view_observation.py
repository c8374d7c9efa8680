"""What a policy observes from a RobotView is what the environment shows it, and its actions mean the same."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from entropy_explore_env.belief.pooling import Pool, fresh_sums, new_cells, pool_belief
from entropy_explore_env.envs.parallel_env import EntropyExploreEnv
from entropy_explore_env.missions.view_observation import ViewObserver
from entropy_explore_env.settings.action import Action
from entropy_explore_env.settings.observation import Observation

EVERYTHING = Observation(
    flat=True,
    drive=True,
    patch=True,
    overview=True,
    overview_shape=(3, 4, 2),
    action_mask=True,
    panorama_utility="log2",
)
PLAIN = Observation(panorama=False, self_state=False, team=False)


@pytest.mark.parametrize("scenario", ["box-7x11x5", "office-mixed", "hybrid"])
@pytest.mark.parametrize("action", [Action("discrete", moves="axes"), Action("discrete"), Action()])
@pytest.mark.parametrize("channel", [{}, {"loss_probability": 0.5}])
def test_it_is_the_environment_s(scenario: str, action: Action, channel: dict[str, float]) -> None:
    """All parts, of deciding and of busy robots, while they drive, scan and hear of each other."""
    settings: dict[str, Any] = {"robots": 3, "decision_period_s": None, "channel": channel}
    env = EntropyExploreEnv(scenario, observation=EVERYTHING, action=action, **settings)
    twin = EntropyExploreEnv(scenario, observation=PLAIN, **settings)
    observer = ViewObserver(twin.scenario, EVERYTHING, action)
    seen, _ = env.reset(seed=3)
    twin.reset(seed=3)
    for agent in env.agents:
        env.action_space(agent).seed(5)
    heard = 0
    for _ in range(15):
        for agent in env.agents:
            view = env.view(agent)
            assert np.allclose(observer.observe(view), seen[agent], rtol=0, atol=1e-6)
            heard += any(mate.heard_s >= 0 for mate in view.teammates.values())
        actions = {agent: env.action_space(agent).sample() for agent in env.agents}
        views = {agent: twin.view(agent) for agent in twin.agents}
        chosen = {agent: observer.viewpoint(view, actions[agent]) for agent, view in views.items()}
        seen, *_ = env.step(actions)
        twin.step({agent: view.action_for(chosen[agent]) for agent, view in views.items()})
        for agent in env.agents:  # sent there as continuous actions, robots do the same
            ours, theirs = env.view(agent).target, twin.view(agent).target
            assert np.allclose(ours[:3], theirs[:3], atol=1e-4)
            assert np.allclose(np.exp(1j * ours[3:]), np.exp(1j * theirs[3:]), atol=1e-4)
    assert heard


def test_pooling_a_whole_belief_adds_up() -> None:
    """Against plain Python, on a grid that cells do not divide evenly."""
    rng, size = np.random.default_rng(0), (5, 4, 3)
    cells = new_cells(size, (2, 3, 1))
    mean = rng.uniform(0, 1, size).astype(np.float32)
    precision = (10 ** rng.uniform(-4, 5, size)).astype(np.float32)
    sums, ends = np.full((2, 6), 7.0), (1e-3, 1e3)
    pool_belief(Pool(cells, sums, *ends), mean.ravel(), precision.ravel())
    expected = np.zeros((2, 6))
    for x, y, z in np.ndindex(size):
        cell = int(cells.x[x] + cells.y[y] + cells.z[z])
        share = np.log2(ends[1] / float(precision[x, y, z])) / np.log2(ends[1] / ends[0])
        expected[0, cell] += min(max(share, 0.0), 1.0)
        expected[1, cell] += mean[x, y, z]
    assert np.allclose(sums, expected)
    fresh = np.zeros((2, 6))
    pool_belief(Pool(cells, fresh, *ends), np.full(60, 0.5, np.float32), np.full(60, ends[0], np.float32))
    assert np.allclose(fresh, fresh_sums(cells))

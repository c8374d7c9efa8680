"""What a policy observes from a RobotView is what the environment shows it, and its actions mean the same."""

from typing import Any

import numpy as np
import pytest

from entropy_explore_env.envs.parallel_env import EntropyExploreEnv
from entropy_explore_env.missions.view_observation import ViewObserver
from entropy_explore_env.settings.action import Action
from entropy_explore_env.settings.observation import Observation
from tests.envs.pairwise import pairwise

EVERYTHING = Observation(
    flat=True,
    drive=True,
    patch=True,
    overview=True,
    overview_shape=(3, 4, 2),
    prediction=True,
    prediction_shape=(9, 15),
    action_mask=True,
    panorama_utility="log2",
)
PLAIN = Observation(panorama=False, self_state=False, team=False)


@pytest.mark.parametrize(
    ("scenario", "action", "loss"),
    pairwise(
        ("box-7x11x5", "office-mixed", "hybrid"),
        (Action("discrete", moves="axes"), Action("discrete"), Action()),
        (0.0, 0.5),
    ),
)
def test_it_is_the_environment_s(scenario: str, action: Action, loss: float) -> None:
    """All parts, of deciding and of busy robots, while they drive, scan and hear of each other."""
    settings: dict[str, Any] = {"robots": 3, "decision_period_s": None, "channel": {"loss_probability": loss}}
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

"""A team as RLlib's MultiAgentEnv, of which an agent is heard only when it has to decide.

Not imported with the package: it needs ray, from the extra `rllib`.
"""
# pyright: reportMissingImports=false

from __future__ import annotations

import copy
from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import numpy as np
from gymnasium import spaces

from entropy_explore_env.envs.parallel_env import EntropyExploreEnv
from entropy_explore_env.errors import ActionError, MissingExtraError, SettingError
from entropy_explore_env.randomness import check_seed
from entropy_explore_env.settings.validation import check_instance

if TYPE_CHECKING:
    from gymnasium import Env as MultiAgentEnv
else:
    try:
        from ray.rllib.env.multi_agent_env import MultiAgentEnv
    except ImportError as error:
        raise MissingExtraError("ray[rllib]", "rllib") from error

ALL = "__all__"
"""RLlib's key for the episode as a whole."""


class EntropyExploreMultiAgentEnv(MultiAgentEnv):
    """One mission of a team; agents are robot_0, robot_1 and so on.

    A step ends when the next robot has to decide. Only robots that decide observe, act and get a reward:
    what they earned since they last decided, the costs of the seconds between included. So nothing that
    a busy robot was asked for is ever learned from. At the mission's end every robot gets its last
    observation, what is left of its rewards, and in its infos the mission's `figures`.

    The episode is over when all robots are done, however each of them is.
    """

    def __init__(self, settings: Mapping[str, Any] | None = None) -> None:
        """Make the environment; `reset` starts a mission.

        Args:
            settings: What RLlib calls `env_config`: `scenario`, `reward_function` and fields of the scenario
                to change, as `parallel_env` takes them; `seed`, of the training run. RLlib's own
                EnvContext adds which runner of how many this is.

        Raises:
            SettingError: A setting is unknown or out of its range.
            WorldError: The world cannot be used.
        """
        if settings is not None:
            check_instance("settings", settings, Mapping)
        asked = dict(settings or {})
        if not all(isinstance(name, str) for name in asked):
            raise SettingError("settings", list(asked), "names of settings")
        run = asked.pop("seed", None)
        self._run = None if run is None else check_seed(run)
        self._runner = (getattr(settings, "num_workers", 0) or 0, getattr(settings, "worker_index", 0) or 0)
        self._first_number: int | None = getattr(settings, "vector_index", 0) or 0
        self.team = EntropyExploreEnv(**asked)
        self.possible_agents = list(self.team.possible_agents)
        self.agents = list(self.possible_agents)
        super().__init__()
        self.observation_spaces = {a: self.team.observation_space(a) for a in self.possible_agents}
        self.action_spaces = {agent: self.team.action_space(agent) for agent in self.possible_agents}
        self.observation_space = spaces.Dict(self.observation_spaces)
        self.action_space = spaces.Dict(self.action_spaces)
        self.render_mode = self.team.render_mode
        self._earned: dict[str, float] = {}
        one = self.action_spaces[self.possible_agents[0]]
        self._ignored = (
            np.int64(0) if isinstance(one, spaces.Discrete) else np.zeros(one.shape or (), one.dtype)
        )

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[dict[str, Any], dict[str, dict[str, Any]]]:
        """Start a mission.

        Args:
            seed: Of all random streams; None goes on to the next mission of the last seed. Where the
                settings hold the `seed` of a run, RLlib's number only tells the environments of one
                runner apart, as its own index does at a first reset without a number: see `runner_seed`.
            options: As for `EntropyExploreEnv.reset`.

        Returns:
            Observations and infos of all robots: they all have to decide.
        """
        if self._run is not None:
            number = self._first_number if seed is None else check_seed(seed)
            seed = None if number is None else runner_seed(self._run, *self._runner, number)
        begun = self.team.reset(seed, options)
        self._first_number = None
        self._earned = dict.fromkeys(self.possible_agents, 0.0)
        return begun

    def step(
        self, action_dict: Mapping[str, Any]
    ) -> tuple[dict[str, Any], dict[str, float], dict[str, bool], dict[str, bool], dict[str, dict[str, Any]]]:
        """Advance until a robot has to decide, or the mission is over.

        Args:
            action_dict: An action for every robot that decides, and for no other.

        Returns:
            Observations, rewards and infos of the robots that decide next, at the end of all; which
            of them terminated and which were truncated, in the form of `endings`.

        Raises:
            CallOrderError: There was no reset, or the mission is over.
            ActionError: Other robots than those that decide act, or an action cannot be taken.
        """
        deciding = self.team.deciding_agents()
        if not isinstance(action_dict, Mapping):
            raise ActionError("action_dict", action_dict, "a dict from agent to action")
        if self.team.agents and set(action_dict) != set(deciding):
            raise ActionError("action_dict", list(action_dict), "one for each of " + ", ".join(deciding))
        ignored = dict.fromkeys(self.team.agents, self._ignored)
        actions = {**ignored, **action_dict}
        while True:
            observations, rewards, terminations, truncations, infos = self.team.step(actions)
            for agent, reward in rewards.items():
                self._earned[agent] += reward
            done = [agent for agent in observations if terminations[agent] or truncations[agent]]
            heard = [agent for agent in observations if agent in done or infos[agent]["deciding"]]
            if heard:
                break
            actions = ignored
        if not self.team.agents:
            figures = self.team.figures()
            infos = {agent: {**infos[agent], "figures": copy.deepcopy(figures)} for agent in infos}
        earned = {agent: self._earned[agent] for agent in heard}
        self._earned.update(dict.fromkeys(heard, 0.0))
        return (
            {agent: observations[agent] for agent in heard},
            earned,
            *endings(terminations, truncations, over=not self.team.agents),
            {agent: infos[agent] for agent in heard},
        )

    def render(self) -> Any:  # noqa: ANN401 - Gymnasium's signature
        """Return the picture of this moment, (480, 640, 3) uint8 for `rgb_array`."""
        return self.team.render()

    def close(self) -> None:
        """Close the window, if there is one."""
        self.team.close()


def runner_seed(run: int, runners: int, runner: int, number: int) -> int:
    """Return the seed of one environment of one runner.

    RLlib seeds the environments of a runner with run + runner + 0, 1, …: with several environments each,
    neighbouring runners, and neighbouring runs, would explore the same worlds from the same starts. A
    SeedSequence of all the numbers keeps every one of them apart.

    Args:
        run: Seed of the training run.
        runners: How many runners there are.
        runner: Which one, from 1; 0 is the trainer's own process.
        number: RLlib's seed, different for the environments of a runner and for evaluation.
    """
    sequence = np.random.SeedSequence(entropy=run, spawn_key=(runners, runner, number))
    return int(sequence.generate_state(1, np.uint64)[0])


def endings(
    terminations: Mapping[str, bool], truncations: Mapping[str, bool], over: bool
) -> tuple[dict[str, bool], dict[str, bool]]:
    """Return which robots are done after a step, in the form that RLlib reads right.

    RLlib takes an episode all of whose agents are marked as done one by one for terminated, whatever their
    marks, and does then not bootstrap the values of those that were truncated. Agents that are truncated
    when the episode ends are therefore marked by `__all__` alone.

    Args:
        terminations: Of the robots that took part in the step.
        truncations: The same.
        over: Whether all robots of the team are done.

    Returns:
        Terminateds and truncateds, both with the key `__all__`; exactly one of these is True where the
        episode is over.
    """
    cut_off = over and not all(terminations.values())
    terminateds = {agent: True for agent, done in terminations.items() if done}
    truncateds = {} if over else {agent: True for agent, done in truncations.items() if done}
    return {**terminateds, ALL: over and not cut_off}, {**truncateds, ALL: cut_off}

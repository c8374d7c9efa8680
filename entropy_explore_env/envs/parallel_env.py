"""A team of robots as a PettingZoo environment: an adapter of one mission, without physics of its own."""

from __future__ import annotations

import functools
import inspect
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from gymnasium import spaces
from pettingzoo import ParallelEnv
from pettingzoo.utils import OrderEnforcingWrapper
from pettingzoo.utils.conversions import parallel_to_aec_wrapper

from entropy_explore_env.belief.belief_map import Map
from entropy_explore_env.envs.checks import ActionChecker
from entropy_explore_env.envs.infos import robot_infos
from entropy_explore_env.envs.rewards import RewardFunction, StepRewards
from entropy_explore_env.errors import ActionError, CallOrderError, SettingError, one_of
from entropy_explore_env.interop.team_maps import joint_map
from entropy_explore_env.missions.action import action_space
from entropy_explore_env.missions.observation import layout
from entropy_explore_env.missions.records import MissionEnd
from entropy_explore_env.missions.reset_options import mission_options, named_options
from entropy_explore_env.missions.simulation import Missions
from entropy_explore_env.missions.view import RobotView, view_of
from entropy_explore_env.reports.metrics import mission_figures
from entropy_explore_env.reports.painting import FRAMES_PER_S, Painter, check_render_mode, offered_modes
from entropy_explore_env.settings.scenario import Scenario
from entropy_explore_env.settings.scenarios import find_scenario
from entropy_explore_env.worlds.given import with_given_worlds

if TYPE_CHECKING:
    from typing_extensions import Unpack

    from entropy_explore_env.envs.keywords import EnvironmentSettings, ScenarioSettings

_OVER = "step after the mission's end: call reset() first"
_SENT_BY_CHECKERS = {"options": 1}
"""What `parallel_api_test` and `api_test` of PettingZoo reset with."""
_PARTS = (layout.__doc__ or "").partition("\n\n")[2]
"""The parts of an observation, their shapes and units, as `missions.observation.layout` describes them."""


class EntropyExploreEnv(ParallelEnv[str, Any, Any]):
    """One mission of a team; agents are robot_0, robot_1 and so on.

    Every robot has the same spaces (see `missions.observation.layout` and `missions.action`). A robot that
    is driving or scanning is busy: its action is ignored, and `infos[agent]["deciding"]` says for
    the next step whether it will count. All robots end together: terminated when the map's entropy
    reached the threshold, or the team has seen what the scenario asks for; truncated at the limit of time or
    steps. `envs.infos` lists the infos.
    """

    metadata = {  # noqa: RUF012 - the form that PettingZoo asks for
        "name": "entropy_explore_env_v1",
        "render_modes": offered_modes(),
        "render_fps": FRAMES_PER_S,
        "is_parallelizable": True,
    }

    def __init__(
        self,
        scenario: str | Scenario = "room",
        render_mode: str | None = None,
        *,
        reward_function: RewardFunction | None = None,
        every_reset: Mapping[str, Any] | None = None,
        **settings: Unpack[ScenarioSettings],
    ) -> None:
        """Make the environment; `reset` starts a mission.

        Args:
            scenario: A scenario's name, or a Scenario.
            render_mode: None, "human" or "rgb_array".
            reward_function: Rewards the robots in place of the scenario's reward; see `envs.rewards`.
            every_reset: `starts` and `world` of all missions, for resets that do not say them.
            **settings: Fields of the Scenario to change; `world` may also be a World, a sequence of
                them, or a mapping of a file's `path` and options: see `worlds.given`.

        Raises:
            SettingError: A setting is unknown or out of its range.
            WorldError: The world cannot be used.
        """
        check_render_mode(render_mode)
        asked, given = with_given_worlds(find_scenario(scenario, settings.get("robots")), settings)
        self._rewards = StepRewards(reward_function)
        self.missions = Missions(asked, given=given)
        self.missions.reward_function = self._rewards.name
        self.scenario = self.missions.scenario
        self.missions.every_reset = mission_options(named_options(every_reset), self.scenario)
        self.render_mode = render_mode
        self.possible_agents = list(self.scenario.agents)
        self.agents: list[str] = []
        self._action_spaces = {agent: action_space(self.scenario) for agent in self.possible_agents}
        self._observation_spaces = {agent: self.missions.layout.space() for agent in self.possible_agents}
        self._checker = ActionChecker(self._action_spaces[self.possible_agents[0]])
        self._painter = Painter(render_mode)

    def observation_space(self, agent: str) -> spaces.Space:
        """Return the agent's observation space, the same object on every call."""
        return self._observation_spaces[self._checked(agent)]

    def action_space(self, agent: str) -> spaces.Space:
        """Return the agent's action space, the same object on every call."""
        return self._action_spaces[self._checked(agent)]

    @functools.cached_property
    def state_space(self) -> spaces.Box:
        """Space of `state()`."""
        return self.missions.layout.flat_space(self.scenario.robots)

    def state(self) -> np.ndarray:
        """Return what all robots observe, one after the other: (A·F,) float32, for centralised critics.

        Raises:
            CallOrderError: There was no reset yet.
        """
        self.missions.check_begun("state")
        return self.missions.observations[0].flatten()

    def view(self, agent: str) -> RobotView:
        """Return what a robot knows; strategies see this and nothing else.

        Raises:
            CallOrderError: There was no reset yet.
            SettingError: No robot has this name.
        """
        self.missions.check_begun("view")
        return view_of(self.missions, 0, self.possible_agents.index(self._checked(agent)))

    def _checked(self, agent: str) -> str:
        if not isinstance(agent, str) or agent not in self._action_spaces:
            raise SettingError("agent", agent, one_of(agent, self.possible_agents))
        return agent

    def deciding_agents(self) -> list[str]:
        """Return the robots whose actions count in the next step, by number.

        Raises:
            CallOrderError: There was no reset yet.
        """
        self.missions.check_begun("deciding_agents")
        deciding = self.missions.state.robots[0]["deciding"].tolist()
        return [agent for agent, decides in zip(self.agents, deciding, strict=False) if decides]

    def strategy_generator(self) -> np.random.Generator:
        """Return the mission's random stream for whoever chooses the actions.

        Raises:
            CallOrderError: There was no reset yet.
        """
        return self.missions.strategy_generator(0)

    def reset(
        self, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[dict[str, Any], dict[str, dict[str, Any]]]:
        """Start a mission.

        Args:
            seed: Of all random streams; None goes on to the next mission of the last seed.
            options: `starts`, (A, 5), and `world`, a world number or a World, instead of drawn ones: see
                `missions.reset_options`. They hold for this mission; the next reset draws again. What
                PettingZoo's checkers send, `{"options": 1}`, means nothing.

        Returns:
            Observations and infos by agent.

        Raises:
            SettingError: The seed is not a whole number ≥ 0, an option is unknown, or robots cannot be
                where they were put. Nothing has changed then.
            WorldError: The world has too little room for the team, or another grid.
        """
        given = named_options(options, ignored=_SENT_BY_CHECKERS)
        self.missions.reset(0, seed, mission_options(given, self.scenario))
        self.agents = list(self.possible_agents)
        self._painter.watch(self.missions)
        return self._observations(), self._infos()

    def step(
        self, actions: Mapping[str, Any]
    ) -> tuple[dict[str, Any], dict[str, float], dict[str, bool], dict[str, bool], dict[str, dict[str, Any]]]:
        """Advance by one step: `decision_period_s`, or until the next robot has to decide.

        Args:
            actions: An action for every agent; those of busy robots are ignored.

        Returns:
            Observations, rewards, terminations, truncations and infos by agent.

        Raises:
            CallOrderError: There was no reset, or the mission is over.
            ActionError: An action is missing, of the wrong shape or type, not finite or outside
                its space. Nothing has changed then.
        """
        continuous, discrete = self._checker.batch(self._in_order(actions))
        before = self._rewards.before(self.missions)
        self.missions.step(continuous[None], discrete[None])
        earned = self._rewards.after(self.missions, before)[0]
        observations, infos = self._observations(), self._infos()
        rewards = dict(zip(self.agents, earned.tolist(), strict=True))
        end = self.missions.over(0)
        terminations = dict.fromkeys(self.agents, end.reached_goal)
        truncations = dict.fromkeys(self.agents, end is not MissionEnd.RUNNING and not end.reached_goal)
        if end is not MissionEnd.RUNNING:
            self.agents = []
        self._painter.watch(self.missions)
        return observations, rewards, terminations, truncations, infos

    def check_action(self, agent: str, action: Any) -> None:  # noqa: ANN401 - whatever was given
        """Raise an ActionError unless the agent can take this action."""
        self._checker.batch([(agent, action)])

    def _in_order(self, actions: Mapping[str, Any]) -> list[tuple[str, Any]]:
        """Return the actions in the order of the robots, if there is one for each."""
        if not self.agents:
            self.missions.check_begun("step")
            raise CallOrderError(_OVER)
        if not isinstance(actions, Mapping):
            raise ActionError("actions", actions, "a dict from agent to action")
        if len(actions) != len(self.agents) or any(agent not in actions for agent in self.agents):
            raise ActionError("actions", list(actions), "one for each of " + ", ".join(self.agents))
        return [(agent, actions[agent]) for agent in self.agents]

    def _observations(self) -> dict[str, Any]:
        rows = self.missions.layout.split_rows(self.missions.observations[0].copy())
        return dict(zip(self.agents, rows, strict=True))

    def _infos(self) -> dict[str, dict[str, Any]]:
        return dict(zip(self.agents, robot_infos(self.missions, 0), strict=True))

    def __repr__(self) -> str:
        """Return its scenario, its team and its voxels."""
        return f"EntropyExploreEnv({self.scenario.in_short})"

    def joint_map(self) -> Map:
        """Return what the team knows together (`interop.team_maps`); for files, see `interop.map_files`.

        Raises:
            CallOrderError: There was no reset yet.
        """
        self.missions.check_begun("joint_map")
        return joint_map(self.missions)

    def figures(self) -> dict[str, Any]:
        """Return the mission's figures up to now, those that `reports.metrics.mission_figures` describes.

        Raises:
            CallOrderError: There was no reset yet.
        """
        self.missions.check_begun("figures")
        return mission_figures(self.missions, 0)

    def set_world_block(
        self, low_m: Sequence[float], high_m: Sequence[float], solid: bool = True, at_s: float | None = None
    ) -> None:
        """Change the true world under way, as when a door closes: see `Missions.set_world_block`."""
        self.missions.set_world_block(0, low_m, high_m, solid, at_s)

    def render(self) -> np.ndarray | None:
        """Return the picture of this moment, (480, 640, 3) uint8; `human` shows it by itself."""
        return self._painter.picture(self.missions)

    def close(self) -> None:
        """Close the window, if there is one."""
        self._painter.close()
        self.missions.close()


def parallel_env(
    scenario: str | Scenario = "room",
    render_mode: str | None = None,
    **settings: Unpack[EnvironmentSettings],
) -> EntropyExploreEnv:
    """Return a team's mission as a ParallelEnv: see `EntropyExploreEnv`.

    Args:
        scenario: A scenario's name (`entropy_explore_env.SCENARIOS`), or a Scenario.
        render_mode: None, `rgb_array` or `human`.
        **settings: `reward_function` and `every_reset`, see `EntropyExploreEnv`; and fields of the
            Scenario to change: `robots`, `world` (a recipe, a file, a World, or
            several Worlds dealt to missions in turn: see `worlds.given`),
            `decision_period_s`, `max_cycles`, `time_limit_s`, and its parts `grid`, `robot`, `sensor`,
            `channel` (`{"burst": 32, "i_min_bits": 0.3}`), `ending`, `reward`, `action`, `observation`,
            each a mapping of some of its fields or a whole object: see `help` of Scenario, Channel, …
    """
    return EntropyExploreEnv(scenario, render_mode, **settings)


# Dedented first: beside text at the margin indented text stays indented, and its sections are no sections.
parallel_env.__doc__ = f"{inspect.cleandoc(parallel_env.__doc__ or '')}\n\nWhat a robot observes. {_PARTS}"


class TurnTakingEnv(OrderEnforcingWrapper[str, Any, Any]):
    """The AEC form; a bad action is refused when it is given, not when the last robot has acted."""

    def __init__(self, team: EntropyExploreEnv) -> None:
        """Let the robots of a team act in turn."""
        super().__init__(parallel_to_aec_wrapper(team))
        self._team = team

    def view(self, agent: str) -> RobotView:
        """Return what a robot knows; see `EntropyExploreEnv.view`."""
        return self._team.view(agent)

    def observe(self, agent: str) -> Any:  # noqa: ANN401 - PettingZoo's signature
        """Return what a robot observes.

        Raises:
            CallOrderError: There was no reset yet.
            SettingError: No robot has this name.
        """
        self._team.missions.check_begun("observe")
        self._team.observation_space(agent)
        return super().observe(agent)

    def last(self, observe: bool = True) -> Any:  # noqa: ANN401 - PettingZoo's signature
        """Return what the robot whose turn it is observes, and what it earned since it last acted.

        Raises:
            CallOrderError: There was no reset yet.
        """
        self._team.missions.check_begun("last")
        return super().last(observe)

    def state(self) -> np.ndarray:
        """Return what all robots observe; see `EntropyExploreEnv.state`."""
        return self._team.state()

    def step(self, action: Any) -> None:  # noqa: ANN401 - PettingZoo's signature
        """Take the action of the robot whose turn it is; see `EntropyExploreEnv.step`.

        Raises:
            CallOrderError: There was no reset, or the mission is over for all robots.
            ActionError: The action is not allowed; once the mission is over, None alone is.
        """
        self._team.missions.check_begun("step")
        if not self.agents:
            raise CallOrderError(_OVER)
        agent = self.agent_selection
        if not (self.terminations[agent] or self.truncations[agent]):
            self._team.check_action(agent, action)
        elif action is not None:
            raise ActionError(f"actions[{agent}]", action, "None after the mission's end")
        super().step(action)


def env(
    scenario: str | Scenario = "room",
    render_mode: str | None = None,
    **settings: Unpack[EnvironmentSettings],
) -> TurnTakingEnv:
    """Return the same as an AECEnv: robots act in turn, and the step is taken when all have."""
    return TurnTakingEnv(parallel_env(scenario, render_mode, **settings))

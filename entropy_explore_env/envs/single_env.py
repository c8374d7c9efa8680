"""One robot on its own as a Gymnasium environment."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import gymnasium
import numpy as np

from entropy_explore_env.envs.checks import ActionChecker, masks_of
from entropy_explore_env.envs.infos import robot_infos
from entropy_explore_env.envs.rewards import RewardFunction, StepRewards
from entropy_explore_env.errors import CallOrderError, SettingError
from entropy_explore_env.missions.action import action_space
from entropy_explore_env.missions.records import MissionEnd
from entropy_explore_env.missions.reset_options import mission_options, named_options
from entropy_explore_env.missions.simulation import Missions
from entropy_explore_env.missions.view import RobotView, view_of
from entropy_explore_env.randomness import check_seed
from entropy_explore_env.reports.painting import FRAMES_PER_S, Painter, check_render_mode, offered_modes
from entropy_explore_env.settings.scenario import Scenario
from entropy_explore_env.settings.scenarios import find_scenario
from entropy_explore_env.settings.validation import check_instance, is_whole
from entropy_explore_env.worlds.given import with_given_worlds

if TYPE_CHECKING:
    from typing_extensions import Unpack

    from entropy_explore_env.envs.keywords import ScenarioSettings


class SingleRobotEnv(gymnasium.Env[Any, Any]):
    """A mission of one robot. Spaces and infos are those of the team's environment."""

    metadata = {"render_modes": offered_modes(), "render_fps": FRAMES_PER_S}  # noqa: RUF012 - Gymnasium's form

    def __init__(
        self,
        scenario: str | Scenario = "room",
        render_mode: str | None = None,
        *,
        reward_function: RewardFunction | None = None,
        every_reset: Mapping[str, Any] | None = None,
        text_infos: bool = True,
        **settings: Unpack[ScenarioSettings],
    ) -> None:
        """Make the environment; `reset` starts a mission.

        Args:
            scenario: A scenario's name, or a Scenario; its team size is set to 1.
            render_mode: None, "human" or "rgb_array".
            reward_function: Rewards the robots in place of the scenario's reward; see `envs.rewards`.
            every_reset: `starts` and `world` of all missions, for resets that do not say them.
            text_infos: Whether infos hold texts (names of ends, and `figures` at a mission's end); False for
                tools that turn all infos into tensors: see `envs.infos.robot_infos`.
            **settings: Fields of the Scenario to change; `world` may also be a World, a sequence of
                them, or a mapping of a file's `path` and options: see `worlds.given`.

        Raises:
            SettingError: A setting is unknown or out of its range, or `robots` is not 1.
            WorldError: The world cannot be used.
        """
        check_render_mode(render_mode)
        check_instance("text_infos", text_infos, bool)
        self._text_infos = text_infos
        robots = settings.get("robots", 1)
        if not is_whole(robots, 1, 1):
            raise SettingError("robots", robots, "1; parallel_env() takes a team")
        asked, given = with_given_worlds(find_scenario(scenario, 1), {**settings, "robots": 1})
        self._rewards = StepRewards(reward_function)
        self.missions = Missions(asked, given=given)
        self.missions.reward_function = self._rewards.name
        self.scenario = self.missions.scenario
        self.missions.every_reset = mission_options(named_options(every_reset), self.scenario)
        self.render_mode = render_mode
        space = action_space(self.scenario)
        self.action_space = space
        self.observation_space = self.missions.layout.space()
        self._checker = ActionChecker(space)
        self._painter = Painter(render_mode)

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Any, dict[str, Any]]:
        """Start a mission; see `EntropyExploreEnv.reset`."""
        given = mission_options(named_options(options), self.scenario)
        drawn = self.missions.draw([0], [seed], [given])
        super().reset(seed=None if seed is None else check_seed(seed))
        self.missions.begin(drawn)
        self._painter.watch(self.missions)
        return self._observation(), robot_infos(self.missions, 0, self._text_infos)[0]

    def step(self, action: object) -> tuple[Any, float, bool, bool, dict[str, Any]]:
        """Advance by one step; see `EntropyExploreEnv.step`."""
        self.missions.check_begun("step")
        if self.missions.over(0) is not MissionEnd.RUNNING:
            raise CallOrderError("step after the mission's end: call reset() first")
        continuous, discrete = self._checker.one("robot_0", action)
        before = self._rewards.before(self.missions)
        self.missions.step(continuous[None], discrete[None])
        reward = float(self._rewards.after(self.missions, before)[0, 0])
        self._painter.watch(self.missions)
        end = self.missions.over(0)
        truncated = end is not MissionEnd.RUNNING and not end.reached_goal
        return (
            self._observation(),
            reward,
            end.reached_goal,
            truncated,
            robot_infos(self.missions, 0, self._text_infos)[0],
        )

    def _observation(self) -> np.ndarray | dict[str, np.ndarray]:
        return self.missions.layout.split(self.missions.observations[0, 0].copy())

    def action_masks(self) -> np.ndarray:
        """Return (N,) bool, which actions by number make sense now; MaskablePPO of sb3-contrib asks for it.

        Raises:
            SettingError: Actions are no numbers.
        """
        return masks_of(self.missions)[0, 0]

    def view(self) -> RobotView:
        """Return what the robot knows; strategies see this and nothing else."""
        self.missions.check_begun("view")
        return view_of(self.missions, 0, 0)

    def __repr__(self) -> str:
        """Its scenario and its voxels."""
        return f"SingleRobotEnv({self.scenario.in_short})"

    def render(self) -> Any:  # noqa: ANN401 - Gymnasium's signature
        """Return the picture of this moment, (480, 640, 3) uint8 for `rgb_array`."""
        return self._painter.picture(self.missions)

    def close(self) -> None:
        """Close the window, if there is one."""
        self._painter.close()
        self.missions.close()

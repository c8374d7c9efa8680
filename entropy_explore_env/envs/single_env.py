"""One robot on its own as a Gymnasium environment: a team of one, without the names of agents."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import gymnasium
import numpy as np

from entropy_explore_env.envs.checks import masks_of
from entropy_explore_env.envs.parallel_env import EntropyExploreEnv
from entropy_explore_env.errors import SettingError
from entropy_explore_env.missions.reset_options import named_options
from entropy_explore_env.missions.view import RobotView
from entropy_explore_env.reports.painting import FRAMES_PER_S, offered_modes
from entropy_explore_env.settings.scenario import Scenario
from entropy_explore_env.settings.scenarios import find_scenario
from entropy_explore_env.settings.validation import is_whole

if TYPE_CHECKING:
    from typing_extensions import Unpack

    from entropy_explore_env.envs.keywords import EnvironmentSettings

_ROBOT = "robot_0"


class SingleRobotEnv(gymnasium.Env[Any, Any]):
    """A mission of one robot. Spaces and infos are those of the team's environment.

    Attributes:
        team: The team of one as an `EntropyExploreEnv`, with all that this class does not repeat, such as
            `joint_map` and `set_world_block`.
    """

    metadata = {"render_modes": offered_modes(), "render_fps": FRAMES_PER_S}  # noqa: RUF012 - Gymnasium's form

    def __init__(
        self,
        scenario: str | Scenario = "room",
        render_mode: str | None = None,
        **settings: Unpack[EnvironmentSettings],
    ) -> None:
        """Make the environment; `reset` starts a mission.

        Args:
            scenario: A scenario's name, or a Scenario; its team size is set to 1.
            render_mode: None, "human" or "rgb_array".
            **settings: As for `EntropyExploreEnv`.

        Raises:
            SettingError: A setting is unknown or out of its range, or `robots` is not 1.
            WorldError: The world cannot be used.
        """
        robots = settings.get("robots", 1)
        if not is_whole(robots, 1, 1):
            raise SettingError("robots", robots, "1; parallel_env() takes a team")
        alone: EnvironmentSettings = {**settings, "robots": 1}
        self.team = EntropyExploreEnv(find_scenario(scenario, 1), render_mode, **alone)
        self.missions, self.scenario = self.team.missions, self.team.scenario
        self.render_mode = render_mode
        self.action_space = self.team.action_space(_ROBOT)
        self.observation_space = self.team.observation_space(_ROBOT)

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Any, dict[str, Any]]:
        """Start a mission; see `EntropyExploreEnv.reset`."""
        known = named_options(options)  # the team lets pass what PettingZoo's checkers send
        observations, infos = self.team.reset(seed, known)
        super().reset(seed=None if seed is None else int(seed))
        return observations[_ROBOT], infos[_ROBOT]

    def step(self, action: object) -> tuple[Any, float, bool, bool, dict[str, Any]]:
        """Advance by one step; see `EntropyExploreEnv.step`."""
        observations, rewards, terminations, truncations, infos = self.team.step({_ROBOT: action})
        return (
            observations[_ROBOT],
            rewards[_ROBOT],
            terminations[_ROBOT],
            truncations[_ROBOT],
            infos[_ROBOT],
        )

    def action_masks(self) -> np.ndarray:
        """Return (N,) bool, which actions by number make sense now; MaskablePPO of sb3-contrib asks for it.

        Raises:
            SettingError: Actions are no numbers.
        """
        return masks_of(self.missions)[0, 0]

    def view(self) -> RobotView:
        """Return what the robot knows; strategies see this and nothing else."""
        return self.team.view(_ROBOT)

    def __repr__(self) -> str:
        """Return its scenario and its voxels."""
        return f"SingleRobotEnv({self.scenario.in_short})"

    def render(self) -> Any:  # noqa: ANN401 - Gymnasium's signature
        """Return the picture of this moment, (480, 640, 3) uint8 for `rgb_array`."""
        return self.team.render()

    def close(self) -> None:
        """Close the window, if there is one."""
        self.team.close()

"""Many missions as one Gymnasium VectorEnv: one compiled call steps all of them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from gymnasium import spaces
from gymnasium.vector import AutoresetMode, VectorEnv
from gymnasium.vector.utils import batch_space

from entropy_explore_env.envs.checks import ActionChecker
from entropy_explore_env.envs.infos import END_FIGURES, end_figures
from entropy_explore_env.envs.rewards import RewardFunction, StepRewards
from entropy_explore_env.errors import CallOrderError, SettingError, one_of
from entropy_explore_env.missions.action import action_space
from entropy_explore_env.missions.faults import failing
from entropy_explore_env.missions.observation.layout import short_repr
from entropy_explore_env.missions.records import MissionEnd, goals_reached
from entropy_explore_env.missions.reset_options import (
    NAMES,
    ResetOptions,
    batch_options,
    mission_options,
    named_options,
)
from entropy_explore_env.missions.simulation import Missions
from entropy_explore_env.randomness import check_seed
from entropy_explore_env.reports.metrics import mission_figures
from entropy_explore_env.reports.painting import FRAMES_PER_S, Painter, check_render_mode, offered_modes
from entropy_explore_env.settings.scenario import Scenario
from entropy_explore_env.settings.scenarios import find_scenario
from entropy_explore_env.settings.validation import check_instance, check_whole
from entropy_explore_env.worlds.given import with_given_worlds

if TYPE_CHECKING:
    from typing_extensions import Unpack

    from entropy_explore_env.envs.keywords import ScenarioSettings

_RUNNING = MissionEnd.RUNNING.code


class EntropyExploreVectorEnv(VectorEnv[Any, Any, Any]):
    """E missions of A robots.

    With one robot, spaces are those of the single-robot environment with a leading axis E. With a
    team, observations, actions and the infos below have leading axes (E, A), and the reward of a
    mission, (E,), is the mean of its robots' rewards.

    Infos, each with a mask `_name` (E,) as Gymnasium has it: `deciding`, `entropy_bits`, `own_bits`,
    `received_bits` and `reward_robots`, (E, A); `time_s`, `end` (code of a MissionEnd) and `world_number`
    (-1 where no recipe made the world), (E,); `action_mask`, (E, A, N), where actions are discrete and
    masks are wanted; `stopped`, `blind` and `silent`, (E, A), where the scenario has faults.
    `final_obs` and `final_info` where autoreset is SAME_STEP.
    """

    def __init__(
        self,
        scenario: str | Scenario = "room",
        num_envs: int = 1,
        *,
        threads: int | None = 1,
        autoreset_mode: AutoresetMode | str = AutoresetMode.NEXT_STEP,
        render_mode: str | None = None,
        action_masks: bool = True,
        reward_function: RewardFunction | None = None,
        every_reset: Mapping[str, Any] | None = None,
        **settings: Unpack[ScenarioSettings],
    ) -> None:
        """Make the missions; `reset` starts them.

        Args:
            scenario: A scenario's name, or a Scenario.
            num_envs: Number of missions E.
            threads: Threads that share the missions; None = one a processor. Results are the same.
            autoreset_mode: When a mission that is over starts anew: with the next step (its action
                is ignored), within the same step, or never.
            render_mode: None, "human" or "rgb_array", of the first mission.
            action_masks: Whether infos hold the masks of discrete actions; without them steps are faster.
            reward_function: Rewards the robots in place of the scenario's reward; see `envs.rewards`.
            every_reset: `starts` and `world` of all missions, for resets that do not say them.
            **settings: Fields of the Scenario to change; `world` may also be a World, a sequence of
                them, or a mapping of a file's `path` and options: see `worlds.given`.

        Raises:
            SettingError: A setting is unknown or out of its range.
            WorldError: The world cannot be used.
        """
        check_render_mode(render_mode)
        check_whole("num_envs", num_envs, 1)
        check_instance("action_masks", action_masks, bool)
        try:
            self.autoreset_mode = AutoresetMode(autoreset_mode)
        except Exception:  # whatever was given, compared with the modes
            allowed = one_of(autoreset_mode, (mode.value for mode in AutoresetMode))
            raise SettingError("autoreset_mode", autoreset_mode, allowed) from None
        asked, given = with_given_worlds(find_scenario(scenario, settings.get("robots")), settings)
        self._rewards = StepRewards(reward_function)
        self.missions = Missions(asked, num_envs, threads, given)
        self.missions.reward_function = self._rewards.name
        self.scenario = self.missions.scenario
        self.missions.every_reset = mission_options(named_options(every_reset), self.scenario)
        self.num_envs = self.missions.count
        self.metadata = {
            "autoreset_mode": self.autoreset_mode,
            "render_modes": offered_modes(),
            "render_fps": FRAMES_PER_S,
        }
        self.render_mode = render_mode
        robots = self.scenario.robots
        space, observation = action_space(self.scenario), self.robot_space()
        self._checker = ActionChecker(space)
        self._masks = action_masks and self.scenario.action.by_number
        self.single_action_space = space if robots == 1 else batch_space(space, robots)
        self.single_observation_space = (
            observation if robots == 1 else short_repr(batch_space(observation, robots))
        )
        self.action_space = batch_space(self.single_action_space, self.num_envs)
        self.observation_space: spaces.Space = short_repr(
            batch_space(self.single_observation_space, self.num_envs)
        )
        painted = self.num_envs if render_mode == "rgb_array" else 1
        self._painters = [Painter(render_mode, mission) for mission in range(painted)]

    def robot_space(self) -> spaces.Space:
        """Return a new space object of one robot's observation."""
        return self.missions.layout.space()

    def _vectors(self) -> np.ndarray:
        """Return (E, A, F) float32, a new array: what the robots observe at this moment."""
        return self.missions.observations.copy()

    def reset(
        self, *, seed: int | Sequence[int | None] | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Any, dict[str, Any]]:
        """Start all missions, or those of `options["reset_mask"]` (E,) bool.

        Args:
            seed: A number, of which mission e takes `seed + e`; or one number (or None) a mission.
            options: May hold `reset_mask`; `starts`, (A, 5) or (E, A, 5), and `world`, a world number,
                a World or a list of E of them, instead of drawn ones: see `missions.reset_options`. They hold
                for the missions that start now; those that start anew by themselves draw again.

        Returns:
            Observations and infos.

        Raises:
            SettingError: The seeds or the mask do not fit, an option is unknown, or robots cannot be
                where they were put. Nothing has changed then.
            WorldError: A world has too little room for the team, or another grid.
        """
        asked = named_options(options, ("reset_mask", *NAMES))
        fixed = batch_options(asked, self.scenario, self.num_envs)
        given = asked.get("reset_mask", np.ones(self.num_envs, bool))
        mask = given if isinstance(given, np.ndarray) else np.zeros(0)
        if mask.shape != (self.num_envs,) or mask.dtype != np.bool_ or not mask.any():
            allowed = f"a bool array of shape ({self.num_envs},), not all False"
            raise SettingError("reset_mask", given, allowed)
        if min(self.missions.episodes) < 0 and not mask.all():
            raise CallOrderError("reset_mask before the first reset: reset all missions once")
        return self.reset_missions(np.flatnonzero(mask).tolist(), self._seeds(seed), fixed)

    def reset_missions(
        self, chosen: Sequence[int], seeds: Sequence[int | None], fixed: Sequence[ResetOptions]
    ) -> tuple[Any, dict[str, Any]]:
        """Start some missions; see `reset`.

        Args:
            chosen: Which of the E.
            seeds: (E,) of all missions.
            fixed: (E,) what is given instead of being drawn.
        """
        self.missions.reset_some(
            chosen, [seeds[mission] for mission in chosen], [fixed[mission] for mission in chosen]
        )
        for painter in self._painters:
            painter.watch(self.missions)
        return self._observations(), self._infos()

    def _seeds(self, seed: int | Sequence[int | None] | None) -> list[int | None]:
        if seed is None or isinstance(seed, int | np.integer):
            first = None if seed is None else check_seed(seed)
            return [None if first is None else first + mission for mission in range(self.num_envs)]
        several = isinstance(seed, list | tuple) or (isinstance(seed, np.ndarray) and seed.ndim == 1)
        if not several or len(seed) != self.num_envs:  # type: ignore[arg-type]
            raise SettingError("seed", seed, f"a whole number ≥ 0, or {self.num_envs} of them")
        return [None if one is None else check_seed(one) for one in seed]

    def step(self, actions: object) -> tuple[Any, np.ndarray, np.ndarray, np.ndarray, dict[str, Any]]:
        """Advance all missions by one step.

        Args:
            actions: (E, A, N) or (E, A); without the axis A for one robot.

        Returns:
            Observations, rewards (E,) float64, terminations and truncations (E,) bool, infos.

        Raises:
            CallOrderError: There was no reset, or missions are over and nothing starts them anew.
            ActionError: The actions have the wrong shape or type, are not finite or outside their
                space. Nothing has changed then.
            WorldError: Missions start anew in a world whose file has changed. Nothing has changed then.
        """
        if min(self.missions.episodes) < 0:
            raise CallOrderError("step before reset: call reset() first")
        clocks = self.missions.state.missions
        continuous, discrete = self._checker.table(actions, self.num_envs, self.scenario.robots)
        over = np.flatnonzero(clocks["end"] != _RUNNING)
        if len(over) and self.autoreset_mode is AutoresetMode.DISABLED:
            raise CallOrderError(
                f"step after the end of missions {over.tolist()}: reset them with a reset_mask"
            )
        if self.autoreset_mode is AutoresetMode.SAME_STEP:
            self.missions.check_world_file()  # a mission that ends in this step starts anew within it
        drawn = self.missions.draw(over.tolist(), [None] * len(over))
        before = self._rewards.before(self.missions)
        self.missions.step(continuous, discrete)
        earned = self._rewards.after(self.missions, before)
        earned[over] = 0.0
        self.missions.begin(drawn)
        terminations = goals_reached(clocks["end"])
        truncations = (clocks["end"] != _RUNNING) & ~terminations
        infos = self._infos(earned)
        ended = np.flatnonzero(terminations | truncations)
        if len(ended) and self.autoreset_mode is AutoresetMode.SAME_STEP:
            infos = self._reset_within(ended, infos)
        for painter in self._painters:
            painter.watch(self.missions)
        return self._observations(), earned.mean(axis=1), terminations, truncations, infos

    def _reset_within(self, ended: np.ndarray, last: dict[str, Any]) -> dict[str, Any]:
        """Start missions that have just ended anew; their last observation and info are kept."""
        mask = np.zeros(self.num_envs, bool)
        mask[ended] = True
        last_observations = np.empty(self.num_envs, object)
        observations = self._of_robots(self._vectors())
        for mission in ended:
            last_observations[mission] = self.missions.layout.split(observations[mission])
        self.missions.reset_some(ended.tolist(), [None] * len(ended))
        final = {name: mask.copy() if name.startswith("_") else value for name, value in last.items()}
        infos = self._infos()
        infos["reward_robots"] = last["reward_robots"]
        return {
            **infos,
            "final_obs": last_observations,
            "_final_obs": mask,
            "final_info": final,
            "_final_info": mask,
        }

    def _of_robots(self, values: np.ndarray) -> np.ndarray:
        """Return values (E, A, ...) of the robots; one robot has no axis of its own."""
        return values[:, 0] if self.scenario.robots == 1 else values

    def _observations(self) -> np.ndarray | dict[str, np.ndarray]:
        return self.missions.layout.split(self._of_robots(self._vectors()))

    def _infos(self, earned: np.ndarray | None = None) -> dict[str, Any]:
        """Return the infos of this moment; `earned` (E, A) are the rewards of a step, None after a reset."""
        clocks, robots = self.missions.state.missions, self.missions.state.robots
        infos: dict[str, Any] = {name: clocks[name].copy() for name in ("time_s", "end")}
        for name in ("deciding", "entropy_bits", "own_bits", "received_bits"):
            infos[name] = self._of_robots(robots[name]).copy()
        if self.missions.rules.faults is not None:
            now = failing(self.missions.state.faults, clocks["time_s"][:, None])
            infos.update({name: self._of_robots(failed) for name, failed in now.items()})
        infos["world_number"] = self.missions.world_numbers.copy()
        infos["reward_robots"] = self._of_robots(np.zeros(robots.shape) if earned is None else earned)
        if self._masks:
            infos["action_mask"] = self._of_robots(self.missions.action_masks())
        infos.update({f"_{name}": np.ones(self.num_envs, bool) for name in list(infos)})
        over = clocks["end"] != _RUNNING
        if over.any():
            infos["figures"], infos["_figures"] = np.empty(self.num_envs, object), over
            for mission in np.flatnonzero(over):
                infos["figures"][mission] = mission_figures(self.missions, int(mission))
            for name in END_FIGURES:
                infos[name], infos[f"_{name}"] = np.zeros(self.num_envs), over
            for mission in np.flatnonzero(over):
                for name, value in end_figures(infos["figures"][mission]).items():
                    infos[name][mission] = value
        return infos

    def render(self) -> Any:  # noqa: ANN401 - Gymnasium's signature
        """Return a picture of each mission, E of (480, 640, 3) uint8; with `human` show the first mission.

        Paths and curves begin at the missions' reset.
        """
        pictures = tuple(painter.picture(self.missions) for painter in self._painters)
        return pictures if self.render_mode == "rgb_array" else None

    def close_extras(self, **kwargs: object) -> None:
        """End the threads and close the window."""
        del kwargs
        for painter in self._painters:
            painter.close()
        self.missions.close()


def registered_vector_env(
    scenario: str | Scenario = "room",
    num_envs: int = 1,
    *,
    max_episode_steps: int | None = None,
    **more: Any,  # noqa: ANN401 - as EntropyExploreVectorEnv takes them
) -> EntropyExploreVectorEnv:
    """Return what `gymnasium.make_vec` makes: an EntropyExploreVectorEnv.

    Args:
        scenario: As of EntropyExploreVectorEnv.
        num_envs: Number of missions E.
        max_episode_steps: Steps after which a mission is cut off, as `max_cycles`. None, -1, or what the
            scenario is registered with, which Gymnasium always hands over: it ends as the scenario says.
        **more: As of EntropyExploreVectorEnv.

    Raises:
        SettingError: As of EntropyExploreVectorEnv.
        WorldError: The world cannot be used.
    """
    if max_episode_steps not in (None, -1, find_scenario(scenario).most_decisions):
        more["max_cycles"] = max_episode_steps
    return EntropyExploreVectorEnv(scenario, num_envs, **more)

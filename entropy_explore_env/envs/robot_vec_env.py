"""The robots of many missions as the rows of a Stable-Baselines3 VecEnv: one policy drives them all.

Row e·A + a is robot a of mission e. A row acts when its robot decides; what it hands over while the robot
is busy is ignored, and the transition says so.
"""

from __future__ import annotations

import copy
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from gymnasium.vector import AutoresetMode

from entropy_explore_env.envs.checks import as_array, masks_of
from entropy_explore_env.envs.infos import end_figures
from entropy_explore_env.envs.rewards import RewardFunction
from entropy_explore_env.envs.vector_env import EntropyExploreVectorEnv
from entropy_explore_env.errors import ActionError, MissingExtraError, SettingError
from entropy_explore_env.missions.action import action_space
from entropy_explore_env.missions.records import goals_reached
from entropy_explore_env.missions.reset_options import (
    ResetOptions,
    batch_options,
    mission_options,
    named_options,
)
from entropy_explore_env.missions.snapshot import check_array, restore, snapshot
from entropy_explore_env.randomness import check_seed
from entropy_explore_env.settings.scenario import Scenario
from entropy_explore_env.settings.validation import check_instance, is_whole

if TYPE_CHECKING:
    from typing_extensions import Unpack

    from entropy_explore_env.envs.keywords import ScenarioSettings

try:
    from stable_baselines3.common.vec_env import VecEnv
except ImportError:
    raise MissingExtraError("stable_baselines3", "training") from None

_CARRIED = ("deciding", "_returns", "_steps", "_time_s")


class RobotVecEnv(VecEnv):
    """E missions of A robots as N = E·A rows.

    A mission that is over starts anew within the same step, as Stable-Baselines3 has it: its rows' `done`
    is True, their observations are the first ones of the next mission, and their infos hold
    `terminal_observation` and `TimeLimit.truncated`: whether time, and not the map, ended the mission.

    Every info holds `decided`: whether the row's action counted in this step, and `elapsed_s`: simulated
    seconds that the step took. At a mission's end also `episode`: the row's sum of rewards `r`, its steps
    `l` and the mission's seconds `t`; and `figures`: those of `mission_figures`, and `infos.END_FIGURES`.

    Attributes:
        vector_env: The missions, of the class `_missions_of`.
        deciding: (N,) bool, whether the rows' next actions count.
        decided: (N,) bool, whether those of the latest step did.
        elapsed_s: (N,) float64, how long the latest step was.
        ended: (N,) bool, whether the row's mission ended in the latest step.
        rewards: (N,) float64, of the latest step.
    """

    _missions_of: type[EntropyExploreVectorEnv] = EntropyExploreVectorEnv

    def __init__(
        self,
        scenario: str | Scenario = "room",
        missions: int = 1,
        *,
        threads: int | None = 1,
        seeds: Sequence[int] | None = None,
        reward_function: RewardFunction | None = None,
        every_reset: Mapping[str, Any] | None = None,
        **settings: Unpack[ScenarioSettings],
    ) -> None:
        """Make the missions.

        Args:
            scenario: A scenario's name, or a Scenario.
            missions: E.
            threads: That share the missions; None = one a processor. Results are the same.
            seeds: (E,) of the missions' first reset, whatever `seed` says; None = that, else fresh ones.
            reward_function: Rewards the robots in place of the scenario's reward; see `envs.rewards`.
            every_reset: `starts` and `world` of all missions, for resets that do not say them.
            **settings: Fields of the Scenario to change.

        Raises:
            SettingError: A setting is unknown or out of its range.
            WorldError: The world cannot be used.
        """
        self.vector_env = self._missions_of(
            scenario,
            missions,
            threads=threads,
            autoreset_mode=AutoresetMode.SAME_STEP,
            action_masks=False,
            reward_function=reward_function,
            every_reset=every_reset,
            **settings,
        )
        if seeds is not None:
            listed = isinstance(seeds, list | tuple | range) or (
                np.ndim(seeds) == 1 and isinstance(seeds, np.ndarray)
            )
            if not listed or len(seeds) != missions or not all(is_whole(seed, 0) for seed in seeds):
                raise SettingError("seeds", seeds, f"{missions} whole numbers ≥ 0")
        self.scenario = self.vector_env.scenario
        self._first_seeds = None if seeds is None else [int(seed) for seed in seeds]
        self._robots = self.scenario.robots
        rows = missions * self._robots
        self._team = (missions, self._robots)
        self.decided, self.ended = np.zeros(rows, bool), np.zeros(rows, bool)
        self.deciding, self.elapsed_s = np.ones(rows, bool), np.zeros(rows)
        self.rewards, self._returns = np.zeros(rows), np.zeros(rows)
        self._steps, self._time_s = np.zeros(rows, np.int64), np.zeros(missions)
        super().__init__(rows, self.vector_env.robot_space(), action_space(self.scenario))

    def reset(self) -> Any:  # noqa: ANN401 - an array, or a dict of them
        """Start all missions.

        `set_options` gives `starts` and `world` for this reset, as `EntropyExploreVectorEnv.reset` takes
        them; options given row by row are those of one mission each, the same for all of its rows.

        Returns:
            Observations of the rows, (N, ...).

        Raises:
            SettingError: An option is unknown or not allowed. Nothing has changed then.
            WorldError: A world has too little room for the team, or another grid.
        """
        seeds: Any = self._first_seeds
        if seeds is None and self._seeds[0] is not None:
            seeds = [self._seeds[0] + mission for mission in range(self._team[0])]
        seeds = [None] * self._team[0] if seeds is None else seeds
        observations, infos = self.vector_env.reset_missions(
            range(self._team[0]), seeds, self._fixed(self._options)
        )
        self._reset_seeds()
        self._reset_options()
        self._first_seeds = None
        self.reset_infos: list[dict[str, Any]] = [{} for _ in range(self.num_envs)]
        self.deciding = infos["deciding"].reshape(-1)
        self._returns[:], self._steps[:], self._time_s[:] = 0.0, 0, 0.0
        return self._rows(observations)

    def set_options(self, options: list[dict[str, Any]] | dict[str, Any] | None = None) -> None:
        """Take the options of the next reset: see `reset`.

        Raises:
            SettingError: An option is unknown or not allowed. Nothing has changed then.
            WorldError: A World has another grid.
        """
        if isinstance(options, list):
            if len(options) != self.num_envs:
                raise SettingError("options", options, f"a dict, or {self.num_envs} of them, one a row")
            kept = [copy.deepcopy(named_options(row)) for row in options]
        else:
            kept = [copy.deepcopy(named_options(options))] * self.num_envs
        self._fixed(kept)
        self._options = kept

    def _fixed(self, rows: list[dict[str, Any]]) -> list[ResetOptions]:
        """Return what options of the rows are for the missions."""
        scenario, missions = self.scenario, self._team[0]
        if all(row is rows[0] for row in rows):
            return batch_options(rows[0], scenario, missions)
        return [mission_options(options, scenario) for options in rows[:: self._robots]]

    def seed(self, seed: int | None = None) -> Sequence[int | None]:
        """Take the seeds of the missions at the next reset, consecutive from this one; None = fresh ones.

        Raises:
            SettingError: It is no whole number ≥ 0.
        """
        return super().seed(None if seed is None else check_seed(seed))

    def step_async(self, actions: np.ndarray) -> None:
        """Take the rows' actions, (N,) or (N, K).

        Raises:
            ActionError: They are not an action a row.
        """
        given = as_array("actions", actions)
        if given.shape[:1] != (self.num_envs,):
            allowed = f"an action for each of the {self.num_envs} rows"
            raise ActionError("actions", f"{given.dtype} {given.shape}", allowed)
        self._actions = given

    def step_wait(self) -> tuple[Any, np.ndarray, np.ndarray, list[dict[str, Any]]]:
        """Advance all missions by one step.

        Returns:
            Observations (N, ...), rewards (N,) float32, dones (N,) bool, infos.
        """
        actions = self._actions
        shape = self._team if self._robots > 1 else self._team[:1]
        actions = actions.reshape(shape + actions.shape[1:])
        observations, _, _, _, infos = self.vector_env.step(actions)
        ended = infos.get("_final_info", np.zeros(self._team[0], bool))
        last = infos["final_info"] if ended.any() else infos
        time_s = np.where(ended, last["time_s"], infos["time_s"])
        self.elapsed_s = np.repeat(time_s - self._time_s, self._robots)
        self._time_s = infos["time_s"]
        self.decided, self.deciding = self.deciding, infos["deciding"].reshape(-1)
        self.ended = np.repeat(ended, self._robots)
        self.rewards = infos["reward_robots"].reshape(-1)
        self._returns += self.rewards
        self._steps += 1
        told = [
            {"decided": decided, "elapsed_s": elapsed_s}
            for decided, elapsed_s in zip(self.decided.tolist(), self.elapsed_s.tolist(), strict=True)
        ]
        for mission in np.flatnonzero(ended).tolist():
            self._tell_end(mission, infos["final_obs"][mission], last, told)
        self._returns[self.ended], self._steps[self.ended] = 0.0, 0
        return self._rows(observations), self.rewards.astype(np.float32), self.ended.copy(), told

    def _tell_end(
        self,
        mission: int,
        last_seen: Any,  # noqa: ANN401 - observations, as arrays or dicts of them
        last: dict[str, Any],
        told: list[dict[str, Any]],
    ) -> None:
        """Fill in what infos say of the rows of a mission that ended."""
        truncated = not goals_reached(last["end"])[mission]
        for robot in range(self._robots):
            row = mission * self._robots + robot
            told[row] |= {
                "terminal_observation": self._of_robot(last_seen, robot),
                "TimeLimit.truncated": truncated,
                "episode": {
                    "r": float(self._returns[row]),
                    "l": int(self._steps[row]),
                    "t": float(last["time_s"][mission]),
                },
                "figures": last["figures"][mission],
                **end_figures(last["figures"][mission]),
            }

    def _of_robot(self, team: Any, robot: int) -> Any:  # noqa: ANN401 - an array, or a dict of them
        """Return one robot's observation from those of its team; a single robot has no axis of its own."""
        if isinstance(team, dict):
            return {name: self._of_robot(part, robot) for name, part in team.items()}
        return team if self._robots == 1 else team[robot]

    def _rows(self, observations: Any) -> Any:  # noqa: ANN401 - an array, or a dict of them
        """Return (E, A, ...) as (N, ...)."""
        if isinstance(observations, dict):
            return {name: self._rows(part) for name, part in observations.items()}
        skipped = 1 if self._robots == 1 else 2
        return observations.reshape(self.num_envs, *observations.shape[skipped:])

    def arrays(self) -> dict[str, np.ndarray]:
        """Return all that changes, as arrays without Python objects; see `missions.snapshot`."""
        rows = {name: getattr(self, name).copy() for name in _CARRIED}
        return rows | snapshot(self.vector_env.missions)

    def set_arrays(self, arrays: Mapping[str, np.ndarray]) -> None:
        """Restore the state of rows of the same scenario and number, bitwise.

        Args:
            arrays: As `arrays` gave them.

        Raises:
            RecordError: An array is missing or does not fit. Nothing has changed then.
        """
        for name in _CARRIED:
            check_array(name, arrays.get(name), getattr(self, name))
        restore(self.vector_env.missions, arrays)
        for name in _CARRIED:
            setattr(self, name, arrays[name].copy())

    def close(self) -> None:
        """End the threads."""
        self.vector_env.close()

    def action_masks(self) -> np.ndarray:
        """Return (N, K) bool, which of K actions by number make sense now; MaskablePPO asks for it.

        Raises:
            SettingError: Actions are no numbers.
        """
        masks = masks_of(self.vector_env.missions)
        return masks.reshape(self.num_envs, masks.shape[-1])

    def get_attr(self, attr_name: str, indices: Any = None) -> list[Any]:  # noqa: ANN401 - SB3's signature
        """Return an attribute of the missions, once for each row asked for.

        Raises:
            AttributeError: They have none of this name, as Stable-Baselines3 has it.
        """
        check_instance("attr_name", attr_name, str)
        masked = attr_name == "action_masks" and self.scenario.action.by_number
        value = self.action_masks if masked else getattr(self.vector_env, attr_name)
        return [value for _ in self._get_indices(indices)]

    def get_images(self) -> list[Any]:
        """Return a picture of each mission, (480, 640, 3) uint8, for `render_mode="rgb_array"`."""
        return list(self.vector_env.render()) if self.vector_env.render_mode == "rgb_array" else []

    def set_attr(self, attr_name: str, value: Any, indices: Any = None) -> None:  # noqa: ANN401
        """Refuse: rows share their missions, and none has attributes of its own.

        Raises:
            SettingError: Always.
        """
        raise SettingError("set_attr", attr_name, "nothing: rows have no attributes of their own")

    def env_method(
        self,
        method_name: str,
        *args: Any,  # noqa: ANN401 - SB3's signature
        indices: Any = None,  # noqa: ANN401
        **kwargs: Any,  # noqa: ANN401
    ) -> list[Any]:
        """Return what `action_masks` gives, row by row; rows have no other method of their own.

        Raises:
            SettingError: It is another method, or actions are no numbers.
        """
        check_instance("method_name", method_name, str)
        if method_name != "action_masks":
            raise SettingError(
                "env_method", method_name, "action_masks: rows have no other methods of their own"
            )
        masks = self.action_masks()
        return [masks[row] for row in self._get_indices(indices)]

    def env_is_wrapped(self, wrapper_class: type, indices: Any = None) -> list[bool]:  # noqa: ANN401
        """Return False for each row: none is wrapped."""
        return [False for _ in self._get_indices(indices)]

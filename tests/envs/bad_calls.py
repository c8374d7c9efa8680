"""Generated bad calls of everything public: a number says which function is given which wrong value."""

import copy
import dataclasses
from collections.abc import Callable
from typing import Any, NamedTuple

import gymnasium
import numpy as np
import pettingzoo

import entropy_explore_env as package
from entropy_explore_env import (
    SCENARIOS,
    EntropyExploreVectorEnv,
    Grid,
    Missions,
    Scenario,
    SingleRobotEnv,
    World,
    env,
    find_scenario,
    load_octomap,
    load_world,
    parallel_env,
    save_world,
    with_settings,
)
from entropy_explore_env.envs.robot_vec_env import RobotVecEnv
from entropy_explore_env.missions.view import RobotView
from entropy_explore_env.reports.state_digest import state_digest
from entropy_explore_env.settings.robot import Robot
from entropy_explore_env.settings.robot_kind import RobotKind
from entropy_explore_env.settings.sensor import RangeSensor
from entropy_explore_env.worlds.formats import LOAD_OPTIONS
from tests.envs.bad_values import PARTS, VALUES, Is, fields, hashable, put

BOX = "box-7x11x5"
GRID = SCENARIOS[BOX].grid
SHAPE, ORIGIN, SPOILT = [7, 11, 5], [0.0, 0.0, 0.0], [0.0, 0.1, -0.2, 0.3, 0.0]
DISCRETE = {"action": {"kind": "discrete"}}


class Target(NamedTuple):
    """One argument of one call."""

    name: str
    call: Callable[[Any], Any]
    """Takes the wrong value."""
    allowed: Is = Is(0)
    """What the argument may be, too."""


class Stage:
    """Environments that have been reset, at which bad calls are aimed, and all targets."""

    def __init__(self, folder) -> None:
        """Make them; files go to the folder."""
        self.folder = folder
        self.team = parallel_env(BOX)
        self.discrete = parallel_env(BOX, **DISCRETE)
        self.turns = env(BOX)
        self.alone = SingleRobotEnv(BOX)
        self.batch = EntropyExploreVectorEnv(BOX, 3)
        self.numbered = EntropyExploreVectorEnv(BOX, 3, **DISCRETE)
        self.rows = RobotVecEnv(BOX, 3)
        self.missions = Missions(SCENARIOS[BOX], 2)
        for each in (self.team, self.discrete, self.turns, self.alone, self.batch, self.numbered):
            each.reset(seed=1)
        self.rows.reset()
        self.missions.reset_some([0, 1], [1, 2])
        self.world = World(GRID, np.zeros(GRID.shape, bool), "hall", np.full((7, 11), 4, np.int32))
        self.view: RobotView = self.team.view("robot_0")
        self.targets = [*self._constructions(), *self._resets(), *self._actions(), *self._others()]

    def digest(self) -> list[Any]:
        """Of all that a call may change in any environment."""
        held = [e.missions for e in (self.team, self.discrete, self.alone, self.batch, self.numbered)]
        held += [self.turns._team.missions, self.rows.vector_env.missions, self.missions]
        told: list[Any] = [self.team.agents, self.discrete.agents, self.turns.agents]
        told += [self.turns.agent_selection, self.rows._seeds]
        told += [str(self.rows._options), self.rows.deciding.tolist()]
        for missions in held:
            told += [state_digest(missions, mission) for mission in range(missions.count)]
            told += [missions.seeds, missions.episodes, missions.observations.tobytes()]
        return copy.deepcopy(told)

    def call(self, number: int) -> tuple[str, Callable[[], Any]]:
        """The name of bad call number `number`, and the call."""
        rng = np.random.default_rng(number)
        target = self.targets[rng.integers(len(self.targets))]
        wrong = [make for kind, make in VALUES if not kind & target.allowed]
        chosen = int(rng.integers(len(wrong)))
        return f"call {number}: {target.name}, value {chosen}", lambda: target.call(wrong[chosen]())

    def _constructions(self):
        makers: dict[str, Callable[..., Any]] = {
            "parallel_env": parallel_env,
            "env": env,
            "SingleRobotEnv": SingleRobotEnv,
            "EntropyExploreVectorEnv": lambda scenario=BOX, **more: EntropyExploreVectorEnv(
                scenario, 2, **more
            ),
            "RobotVecEnv": lambda scenario=BOX, **more: RobotVecEnv(scenario, 2, **more),
        }
        for name, make in makers.items():
            yield Target(f"{name}(scenario)", lambda v, make=make: make(scenario=v))
            reward = Is.NONE | Is.CALLABLE
            yield Target(
                f"{name}(reward_function)", lambda v, make=make: make(BOX, reward_function=v), reward
            )
            if name != "RobotVecEnv":
                yield Target(f"{name}(render_mode)", lambda v, make=make: make(BOX, render_mode=v), Is.NONE)
        box = package.environment_id(BOX)
        makers = {name: lambda make=make, **more: make(BOX, **more) for name, make in makers.items()}
        makers["gymnasium.make"] = lambda **more: gymnasium.make(box, **more)
        makers["gymnasium.make_vec"] = lambda **more: gymnasium.make_vec(box, 2, **more)
        makers["pettingzoo.make"] = lambda **more: pettingzoo.make("parallel", box, **more)
        makers["with_settings"] = lambda **more: with_settings(SCENARIOS[BOX], more)
        makers["Scenario"] = lambda **more: dataclasses.replace(SCENARIOS[BOX], **more)
        self.makers = makers
        for name, make in makers.items():
            for field, allowed in fields(Scenario).items():
                if name == "with_settings" and field == "world":
                    allowed |= Is.TEXT  # it is looked up where missions are made
                if name == "Scenario":
                    allowed &= ~Is.NO_NAMES
                    allowed |= Is.TEXT if field == "world" else Is(0)
                yield Target(f"{name}({field})", lambda v, make=make, f=field: make(**{f: v}), allowed)
            if name != "Scenario":
                yield Target(f"{name}(unknown)", lambda v, make=make: make(robts=v))
                for short in ("max_cycles", "time_limit_s"):
                    if (name, short) == ("pettingzoo.make", "max_cycles"):
                        continue  # PettingZoo compares it with -1 itself, before the environment is asked
                    allowed = Is.NONE if short == "max_cycles" else Is(0)
                    yield Target(f"{name}({short})", lambda v, make=make, f=short: make(**{f: v}), allowed)
        parts = {part: type(getattr(SCENARIOS[BOX], part)) for part in PARTS}
        for part, kind in parts.items():
            for field, allowed in fields(kind).items():
                yield Target(
                    f"{part}.{field}", lambda v, p=part, f=field: parallel_env(BOX, **{p: {f: v}}), allowed
                )
        for kind, build in (("Grid", Grid), ("Robot", Robot), ("RangeSensor", RangeSensor)):
            for field, allowed in fields(build).items():
                given = {"shape": (7, 11, 5), "voxel_size_m": 0.5} if build is Grid else {}
                yield Target(
                    f"{kind}({field})", lambda v, b=build, g=given, f=field: b(**{**g, f: v}), allowed
                )
        for place in range(3):
            yield Target("Grid.shape[]", lambda v, p=place: Grid(put(SHAPE, p, v), 0.5))
            yield Target(
                "Grid.origin_m[]", lambda v, p=place: Grid((7, 11, 5), 0.5, put(ORIGIN, p, v)), Is.NEGATIVE
            )
        yield Target("RobotKind(robot)", RobotKind)
        yield Target("num_envs", lambda v: EntropyExploreVectorEnv(BOX, v))
        yield Target("autoreset_mode", lambda v: EntropyExploreVectorEnv(BOX, 2, autoreset_mode=v))
        yield Target("action_masks", lambda v: EntropyExploreVectorEnv(BOX, 2, action_masks=v), Is.BOOL)
        for make in (EntropyExploreVectorEnv, RobotVecEnv):
            yield Target(f"{make.__name__}(threads)", lambda v, make=make: make(BOX, 2, threads=v), Is.NONE)
        yield Target("make_vec(num_envs)", lambda v: gymnasium.make_vec(box, v))
        yield Target("RobotVecEnv(missions)", lambda v: RobotVecEnv(BOX, v))
        yield Target("RobotVecEnv(seeds)", lambda v: RobotVecEnv(BOX, 3, seeds=v), Is.NONE)
        yield Target("Missions(scenario)", Missions)
        yield Target("Missions(count)", lambda v: Missions(SCENARIOS[BOX], v))
        yield Target("Missions(given)", lambda v: Missions(SCENARIOS[BOX], given=v), Is.NO_ENTRIES)

    def _resets(self):
        for name, reset in (
            ("team", self.team.reset),
            ("discrete", self.discrete.reset),
            ("turns", self.turns.reset),
            ("alone", self.alone.reset),
            ("batch", self.batch.reset),
        ):
            yield Target(f"{name}.reset(seed)", lambda v, reset=reset: reset(seed=v), Is.NONE | Is.LARGE)
            allowed = Is.NONE | Is.NO_NAMES
            yield Target(f"{name}.reset(options)", lambda v, reset=reset: reset(options=v), allowed)
            for option in ("starts", "world"):
                yield Target(
                    f"{name}.reset({option})", lambda v, reset=reset, o=option: reset(options={o: v}), Is.NONE
                )
            for option in ("wolrd", "options"):
                yield Target(
                    f"{name}.reset({option})", lambda v, reset=reset, o=option: reset(options={o: v})
                )
            starts = [self.team.missions.state.robots[0]["origin"].tolist(), [2.0, 2.0, 1.0, 0.0, 0.0]]
            yield Target(
                f"{name}.reset(starts[])",
                lambda v, reset=reset, s=starts: reset(options={"starts": [s[0], [v, *s[1][1:]]]}),
            )
        yield Target("batch.reset(reset_mask)", lambda v: self.batch.reset(options={"reset_mask": v}))
        yield Target("batch.reset(seeds)", lambda v: self.batch.reset(seed=[1, 2, v]), Is.NONE | Is.LARGE)
        yield Target(
            "batch.reset(worlds)", lambda v: self.batch.reset(options={"world": [1, None, v]}), Is.NONE
        )
        yield Target("rows.seed", self.rows.seed, Is.NONE | Is.LARGE)
        yield Target("rows.set_options", self.rows.set_options, Is.NONE | Is.NO_NAMES)
        for option in ("starts", "world"):
            yield Target(
                f"rows.set_options({option})", lambda v, o=option: self.rows.set_options({o: v}), Is.NONE
            )
        yield Target(
            "rows.set_options of a row",
            lambda v: self.rows.set_options([{}, {}, {"starts": v}, {}, {}, {}]),
            Is.NONE,
        )
        yield Target("Missions.reset(mission)", lambda v: self.missions.reset(v, 1))
        yield Target("Missions.reset(seed)", lambda v: self.missions.reset(0, v), Is.NONE | Is.LARGE)

    def _actions(self):
        good = np.zeros(5, np.float32)
        for name, team, action in (("team", self.team, good), ("discrete", self.discrete, 3)):
            yield Target(f"{name}.step", team.step)
            yield Target(
                f"{name}.step(action)", lambda v, t=team, a=action: t.step({"robot_0": a, "robot_1": v})
            )
            yield Target(
                f"{name}.step(agent)", lambda v, t=team, a=action: t.step({"robot_0": a, hashable(v): a})
            )
            yield Target(
                f"{name}.step(further)",
                lambda v, t=team, a=action: t.step({"robot_0": a, "robot_1": a, "robot_2": v}),
            )
        yield Target("turns.step", self.turns.step)
        yield Target("alone.step", self.alone.step)
        yield Target("batch.step", self.batch.step)
        yield Target("numbered.step", self.numbered.step)
        yield Target("rows.step", self.rows.step)
        yield Target("Missions.step(continuous)", lambda v: self.missions.step(v, np.zeros((2, 2), np.int64)))
        yield Target("Missions.step(discrete)", lambda v: self.missions.step(np.zeros((2, 2, 5)), v))
        for spot in range(5):
            yield Target(
                f"team.step(action[{spot}])",
                lambda v, s=spot: self.team.step({"robot_0": good, "robot_1": put(SPOILT, s, v)}),
                Is.NEGATIVE | Is.BOOL,
            )
            yield Target(
                f"batch.step(actions[{spot}])",
                lambda v, s=spot: self.batch.step(
                    [[list(SPOILT), list(put(SPOILT, s, v))], [SPOILT] * 2, [SPOILT] * 2]
                ),
                Is.NEGATIVE | Is.BOOL,
            )
            yield Target(
                f"view.action_for([{spot}])",
                lambda v, s=spot: self.view.action_for(put(SPOILT, s, v)),
                Is.NEGATIVE | Is.BOOL,
            )

    def _others(self):
        yield Target("view.action_for", self.view.action_for)
        for agent_of in (self.team, self.turns):
            for name in ("view", "observation_space", "action_space"):
                yield Target(name, getattr(agent_of, name))
        yield Target("turns.observe", self.turns.observe)
        yield Target("find_scenario", find_scenario)
        yield Target("environment_id", package.environment_id)
        yield Target("with_settings(scenario)", lambda v: with_settings(v, {}))
        yield Target("with_settings(settings)", lambda v: with_settings(SCENARIOS[BOX], v), Is.NO_NAMES)
        yield Target("load_world", load_world)
        yield Target("load_octomap", load_octomap)
        yield Target("load_octomap(voxel_size_m)", lambda v: load_octomap("x.bt", v))
        for option in LOAD_OPTIONS:
            # the file does not exist: what is wrong in its options is said first, and None is not wrong
            allowed = Is.NONE | (Is.BOOL if option in ("negate", "fill", "inside") else Is(0))
            yield Target(
                f"load_world({option})",
                lambda v, o=option: named_first(o, load_world, "x.npz", **{o: v}),
                allowed,
            )
            yield Target(
                f"world={{'{option}'}}",
                lambda v, o=option: named_first(o, parallel_env, BOX, world={"path": "x.npz", o: v}),
                allowed,
            )
        yield Target("world={'path'}", lambda v: parallel_env(BOX, world={"path": v}))
        yield Target("world=[]", lambda v: parallel_env(BOX, world=[self.world, v]))
        yield Target("save_world(world)", lambda v: save_world(v, self.folder / "x.npz"))
        yield Target("save_world(path)", lambda v: save_world(self.world, v), Is.TEXT)
        given = {"grid": GRID, "occupied": self.world.occupied, "name": "hall"}
        for name, allowed in {
            "grid": Is(0),
            "occupied": Is(0),
            "name": Is.TEXT,
            "ceiling": Is.NONE,
            "yaw_rad": Is.NEGATIVE,
        }.items():
            yield Target(f"World({name})", lambda v, n=name: World(**{**given, n: v}), allowed)
        yield Target("World.collision_mask", self.world.collision_mask)
        yield Target("World.no_fly_mask", self.world.no_fly_mask)
        yield Target("World.layout", self.world.layout)
        yield Target("World.layout(kind)", lambda v: self.world.layout(SCENARIOS[BOX], v), Is.NONE)
        yield Target("World.visible", self.world.visible)
        yield Target("World.visible_voxels", self.world.visible_voxels)
        yield Target("Missions.over", self.missions.over)
        yield Target("Missions.strategy_generator", self.missions.strategy_generator)
        yield Target("rows.get_attr", self.rows.get_attr, Is.TEXT)
        yield Target("rows.set_attr", lambda v: self.rows.set_attr("x", v))
        yield Target("rows.env_method", lambda v: self.rows.env_method("x", v))


def named_first(option: str, call: Callable[..., Any], *given: Any, **more: Any) -> None:
    """Call; that the file does not exist is no answer."""
    try:
        call(*given, **more)
    except package.WorldError as error:
        raise AssertionError(f"{option} was not named: {error}") from error

"""What happened in an episode, down to the bit, so that episodes can be compared exactly."""

from __future__ import annotations

import functools
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from entropy_explore_env.envs.parallel_env import EntropyExploreEnv
from entropy_explore_env.envs.vector_env import EntropyExploreVectorEnv
from entropy_explore_env.missions.rules import action_count, rules_of
from entropy_explore_env.missions.simulation import Missions
from entropy_explore_env.settings.scenario import Scenario
from entropy_explore_env.worlds.world import World

EPISODES = 2
"""Number of episodes in a row that are compared: the one of a seed, and those that follow it."""
OTHER_ACTIONS = 1
"""The kind of actions that are not the episode's own."""
PARTS = ("observations", "rewards", "terminations", "truncations", "infos")

Leaves = dict[str, tuple[Any, ...]]
"""Place ("episode 1, step 17 › rewards › robot_0") → type and value of what was there, down to the bit."""


class ConformanceError(AssertionError):
    """The contract is broken; the message says what differed, where, and at which step."""


@dataclass(frozen=True)
class Task:
    """What is checked, and the actions that are taken.

    Attributes:
        scenario: With the grid of its world's file, if it has one.
        seed: Of mission 0; mission e takes seed + e.
        given: Worlds given as objects, in place of the scenario's.
    """

    scenario: Scenario
    seed: int
    given: tuple[World, ...] = ()

    def env(self) -> EntropyExploreEnv:
        """Return a new environment for the task."""
        return EntropyExploreEnv(self.scenario, **self._world)

    def vector_env(self, missions: int, **how: Any) -> EntropyExploreVectorEnv:  # noqa: ANN401 - as the class's
        """Return a new environment for this many missions."""
        return EntropyExploreVectorEnv(self.scenario, missions, **how, **self._world)

    @property
    def _world(self) -> dict[str, Any]:
        return {"world": self.given} if self.given else {}

    @functools.cached_property
    def choices(self) -> int:
        """Number of actions where they are numbers."""
        return action_count(self.scenario, rules_of(self.scenario))

    def actions(self, mission: int, episode: int, step: int, kind: int = 0) -> np.ndarray:
        """Return a team's actions, (A, N) float32 or (A,) int64; another `kind` gives other ones."""
        rng = np.random.default_rng([self.seed + mission, episode, step, kind])
        if self.scenario.action.by_number:
            return rng.integers(0, self.choices, self.scenario.robots)
        shape = (self.scenario.robots, 3 if self.scenario.planar else 5)
        return rng.uniform(-1.0, 1.0, shape).astype(np.float32)

    def table(self, missions: int, episode: int, step: int) -> np.ndarray:
        """Return actions of many missions as a VectorEnv takes them: no axis A for one robot."""
        actions = np.stack([self.actions(mission, episode, step) for mission in range(missions)])
        return actions[:, 0] if self.scenario.robots == 1 else actions


def parts_of(value: object) -> dict[Any, Any] | None:
    """Return what a container holds, by key, number or field; None if it is none."""
    if isinstance(value, Mapping):
        return dict(value)
    if isinstance(value, np.ndarray) and value.dtype.names:  # bytes between fields mean nothing
        return {name: value[name] for name in value.dtype.names}
    if isinstance(value, list | tuple) or (isinstance(value, np.ndarray) and value.dtype == object):
        return dict(enumerate(value))
    return None


def walk(value: object, where: str = "") -> Iterator[tuple[str, Any]]:
    """Yield a value and, if it is a container, all that is in it, with their places."""
    yield where, value
    for key, part in (parts_of(value) or {}).items():
        yield from walk(part, f"{where} › {key}" if where else str(key))


def leaves(value: object, where: str = "") -> Leaves:
    """Return what a value is made of, as something that cannot be changed any more."""
    found: Leaves = {}
    for place, part in walk(value, where):
        kind = type(part).__name__
        if parts_of(part) is not None:
            found[place] = (kind,)
        elif isinstance(part, np.ndarray):
            found[place] = (kind, part.dtype.str, part.shape, part.tobytes())
        else:
            found[place] = (kind, repr(part))
    return found


def require_same(what: str, first: Leaves, second: Leaves) -> None:
    """Raise a ConformanceError at the first place where two results differ."""
    for where in {**first, **second}:
        one, two = first.get(where, ("nothing",)), second.get(where, ("nothing",))
        if one != two:
            raise ConformanceError(f"{what} › {where}: {_difference(one, two)}")
    if list(first) != list(second):
        raise ConformanceError(f"{what}: the same keys in another order")


def _difference(one: tuple[Any, ...], two: tuple[Any, ...]) -> str:
    """Return the first entry that differs in arrays of one kind, else both values."""
    if len(one) < 4 or one[:3] != two[:3]:
        return ", then ".join(" ".join(map(str, leaf[:3])) for leaf in (one, two))
    first, second = (np.frombuffer(leaf[3], leaf[1]).reshape(leaf[2]) for leaf in (one, two))
    unequal = np.asarray([a.tobytes() != b.tobytes() for a, b in zip(first.flat, second.flat, strict=True)])
    place = tuple(int(i) for i in np.unravel_index(int(unequal.argmax()), one[2]))
    return f"at {place} {first[place]!r}, then {second[place]!r}"


def snapshot(env: EntropyExploreEnv | EntropyExploreVectorEnv) -> Leaves:
    """Return all that a call may change."""
    missions: Missions = env.missions
    kept = {"seeds": missions.seeds, "episodes": missions.episodes, "observations": missions.observations}
    given = {"starts": [options.starts for options in missions.options], "worlds": missions.worlds}
    agents = env.agents if isinstance(env, EntropyExploreEnv) else []
    return leaves({**missions.state._asdict(), **kept, **given, "agents": agents})


def play(env: EntropyExploreEnv, task: Task, mission: int = 0) -> Iterator[tuple[str, dict[str, Any]]]:
    """Play whole episodes after a reset with the mission's seed; yields what was returned, by moment."""
    for episode in range(EPISODES):
        yield f"episode {episode}, step 0", named(env, env.reset(None if episode else task.seed + mission))
        yield from finish(env, task, mission, episode)


def finish(
    env: EntropyExploreEnv, task: Task, mission: int, episode: int, step: int = 0
) -> Iterator[tuple[str, dict[str, Any]]]:
    """Play an episode to its end; `step` steps of it have been taken."""
    while env.agents:
        step += 1
        result = env.step(by_agent(env, task.actions(mission, episode, step)))
        yield f"episode {episode}, step {step}", named(env, result)


def story(moments: Iterator[tuple[str, dict[str, Any]]]) -> Leaves:
    """Return the leaves of a play, taken moment by moment."""
    found: Leaves = {}
    for moment, parts in moments:
        found |= leaves(parts, moment)
    return found


def named(env: EntropyExploreEnv, result: tuple[Any, ...]) -> dict[str, Any]:
    """Return what reset or step returned, by name, and the state."""
    names = PARTS if len(result) == 5 else (PARTS[0], PARTS[-1])
    return {**dict(zip(names, result, strict=True)), "state": env.state()}


def by_agent(env: EntropyExploreEnv, actions: np.ndarray) -> dict[str, Any]:
    """Return a team's actions as a ParallelEnv takes them."""
    return dict(zip(env.possible_agents, actions, strict=True))

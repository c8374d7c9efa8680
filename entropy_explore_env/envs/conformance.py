"""Conformance: does a scenario keep the contract of the environments? Whole episodes, compared exactly.

    check_conformance("room", robots=3)        # raises a ConformanceError that says what differed

or `python -m entropy_explore_env conformance room --robots 3`, which exits with 0 if all
checks hold, 1 if one does not, and 2 on bad input. Exactly means: the same types, keys in the same
order, and the same bits in every array and number.
"""

from __future__ import annotations

import copy
import itertools
import json
import math
import os
import pickle
import subprocess
import sys
from collections.abc import Callable, Iterator, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from typing import Any

import numpy as np

from entropy_explore_env.command import LineParser
from entropy_explore_env.envs.episodes import (
    EPISODES,
    OTHER_ACTIONS,
    PARTS,
    ConformanceError,
    Leaves,
    Task,
    by_agent,
    finish,
    leaves,
    named,
    play,
    require_same,
    snapshot,
    story,
    walk,
)
from entropy_explore_env.envs.parallel_env import EntropyExploreEnv
from entropy_explore_env.envs.refusals import check_bad_actions, check_call_order
from entropy_explore_env.missions.records import MissionEnd
from entropy_explore_env.missions.simulation import Missions
from entropy_explore_env.randomness import check_seed
from entropy_explore_env.settings.scenario import Scenario
from entropy_explore_env.settings.scenarios import find_scenario
from entropy_explore_env.worlds.given import with_given_worlds

BATCH = 8
_CHILD = "from entropy_explore_env.envs.conformance import answer_parent; answer_parent()"
_ROBOT_INFOS = ("deciding", "entropy_bits", "own_bits", "received_bits")


def check_spaces(task: Task) -> None:
    """Check that observations lie in their spaces, spaces stay the same objects, and rewards are finite."""
    env = task.env()
    agents = env.possible_agents
    spaces = [env.state_space, *map(env.observation_space, agents), *map(env.action_space, agents)]
    for where, moment in play(env, task):
        if any(list(moment[name]) != agents for name in PARTS if name in moment):
            raise ConformanceError(f"{where}: not everything is given for all of {agents}")
        seen = [moment["state"], *moment["observations"].values()]
        for name, space, value in zip(["state", *agents], spaces, seen, strict=False):
            if not space.contains(value):
                raise ConformanceError(f"{where}: what {name} observes is outside its space")
        for agent, reward in moment.get("rewards", {}).items():
            if not isinstance(reward, float) or not math.isfinite(reward):
                raise ConformanceError(f"{where}: the reward of {agent} is {reward!r}")
    later = [env.state_space, *map(env.observation_space, agents), *map(env.action_space, agents)]
    if any(now is not then for now, then in zip(later, spaces, strict=True)):
        raise ConformanceError("spaces: other objects than before the episodes")


def check_repeatable(task: Task) -> None:
    """Check that a seed gives the same episodes again, and that other episodes start elsewhere."""
    env = task.env()
    first = story(play(env, task))
    require_same("second environment", first, story(play(task.env(), task)))
    require_same("second time", first, story(play(env, task)))
    starts = {}
    for name, seed in (("the seed", task.seed), ("its next episode", None), ("the next seed", task.seed + 1)):
        env.reset(seed)
        starts[env.missions.state.robots["origin"].tobytes()] = name
    if len(starts) < 3:
        raise ConformanceError(f"episodes begin alike: only {' and '.join(starts.values())} differ")


def check_processes(task: Task) -> None:
    """Check that two fresh processes play the same episodes as this one."""
    with ThreadPoolExecutor(2) as pool:
        answers = [pool.submit(_ask_child, task, hash_seed) for hash_seed in ("1", "2")]
        here = story(play(task.env(), task))
    for number, answer in enumerate(answers, 1):
        require_same(f"process {number}", here, answer.result())


def _ask_child(task: Task, hash_seed: str) -> Leaves:
    """Return the story of the task as a fresh process plays it; it imports from where this one does."""
    path = os.pathsep.join(part or os.curdir for part in sys.path)
    variables = {**os.environ, "PYTHONPATH": path, "PYTHONHASHSEED": hash_seed}
    question = pickle.dumps((task.scenario, task.seed, task.given))
    child = subprocess.run(
        [sys.executable, "-c", _CHILD], input=question, capture_output=True, env=variables, check=False
    )
    if child.returncode:
        last = child.stderr.decode(errors="replace").strip().splitlines()[-1:]
        raise ConformanceError(f"a fresh process ended with {child.returncode}: {' '.join(last)}")
    return pickle.loads(child.stdout)


def answer_parent() -> None:
    """Play the episode from standard input and write what happened: a child of `check_processes` does."""
    task = Task(*pickle.load(sys.stdin.buffer))
    sys.stdout.buffer.write(pickle.dumps(story(play(task.env(), task))))


def check_batches(task: Task) -> None:
    """Check that a VectorEnv of one or eight, on one or two threads, holds the missions of ParallelEnvs."""
    calls, missions = play_batch(task, BATCH, threads=1)
    require_same(f"batch of {BATCH}, two threads", calls, play_batch(task, BATCH, threads=2)[0])
    require_same("batch of one", missions[0], play_batch(task, 1, threads=1)[1][0])
    for mission, found in enumerate(missions):
        moments = play(task.env(), task, mission)
        alone = story((where, row_of_team(moment)) for where, moment in moments)
        require_same(f"ParallelEnv, then mission {mission} of {BATCH}", alone, found)


def play_batch(task: Task, missions: int, threads: int) -> tuple[Leaves, list[Leaves]]:
    """Play a VectorEnv until every mission has ended its episodes; all calls, and each mission's story."""
    env = task.vector_env(missions, threads=threads)
    episode, step, over = [0] * missions, [0] * missions, np.zeros(missions, bool)
    result: tuple[Any, ...] = env.reset(seed=task.seed)
    calls = leaves(result, "call 0")
    stories = [leaves(row_of(result, e), "episode 0, step 0") for e in range(missions)]
    for call in itertools.count(1):
        actions = np.stack([task.actions(e, episode[e], step[e] + 1) for e in range(missions)])
        result = env.step(actions[:, 0] if task.scenario.robots == 1 else actions)
        calls |= leaves(result, f"call {call}")
        for e in range(missions):
            episode[e], step[e] = (episode[e] + 1, 0) if over[e] else (episode[e], step[e] + 1)
            if episode[e] < EPISODES:
                stories[e] |= leaves(row_of(result, e), f"episode {episode[e]}, step {step[e]}")
        if min(episode) >= EPISODES:
            break
        over = result[2] | result[3]
    env.close()
    return calls, stories


def row_of(result: tuple[Any, ...], mission: int) -> dict[str, Any]:
    """Return one mission of what a VectorEnv returned; after a reset, rewards and ends are 0."""
    observations, infos = result[0], result[-1]
    ends = [float(array[mission]) for array in result[1:4]] if len(result) == 5 else [0.0, 0.0, 0.0]
    parts = observations if isinstance(observations, dict) else {"flat": observations}
    return {
        "observations": {name: part[mission].ravel() for name, part in parts.items()},
        "reward, terminated, truncated": ends,
        "infos": {
            "time_s": infos["time_s"][mission].tolist(),
            **{name: np.ravel(infos[name][mission]).tolist() for name in _ROBOT_INFOS},
        },
        "reward_robots": np.ravel(infos["reward_robots"][mission]).tolist(),
        "end": list(MissionEnd)[infos["end"][mission]],
    }


def row_of_team(moment: dict[str, Any]) -> dict[str, Any]:
    """Return a ParallelEnv's moment as `row_of` has it."""
    infos, observations = (list(moment[name].values()) for name in ("infos", "observations"))
    rewards = list(moment.get("rewards", dict.fromkeys(moment["infos"], 0.0)).values())
    ends = [float(all(moment[name].values())) if name in moment else 0.0 for name in PARTS[2:4]]
    robots = [parts if isinstance(parts, dict) else {"flat": parts} for parts in observations]
    return {
        "observations": {name: np.stack([parts[name] for parts in robots]).ravel() for name in robots[0]},
        "reward, terminated, truncated": [float(np.mean(rewards)), *ends],
        "infos": {"time_s": infos[0]["time_s"], **{name: [i[name] for i in infos] for name in _ROBOT_INFOS}},
        "reward_robots": rewards,
        "end": infos[0]["end"],
    }


def check_copies(task: Task) -> None:
    """Check that pickled and deep copies, taken in mid-episode, continue alike, apart from the original."""
    first = [moment for moment, _ in play(task.env(), task) if "episode 0" in moment]
    half = len(first) // 2
    env = task.env()
    env.reset(task.seed)
    for step in range(1, half + 1):
        env.step(by_agent(env, task.actions(0, 0, step)))
    pickled, copied, other = pickle.loads(pickle.dumps(env)), copy.deepcopy(env), copy.deepcopy(env)
    before = snapshot(env)
    while other.agents:
        other.step(by_agent(other, task.actions(0, 0, half + 1, OTHER_ACTIONS)))
    other.reset(task.seed + 1)
    require_same("the original, before and after its copy is used", before, snapshot(env))
    rest = [story(_rest(each, task, half)) for each in (env, pickled, copied)]
    require_same("original, then pickled copy", rest[0], rest[1])
    require_same("original, then deep copy", rest[0], rest[2])


def _rest(env: EntropyExploreEnv, task: Task, step: int) -> Iterator[tuple[str, dict[str, Any]]]:
    """Yield the rest of the first episode and the next one."""
    yield from finish(env, task, 0, 0, step)
    yield "episode 1, step 0", named(env, env.reset())
    yield from finish(env, task, 0, 1)


def check_fresh(task: Task) -> None:
    """Check that what a call returns shares no memory with other calls and is not changed by them."""
    returned = dict(play(task.env(), task))
    then = {where: leaves(parts) for where, parts in play(task.env(), task)}
    batch = task.vector_env(2)
    returned["vector call 0"] = {"all": batch.reset(seed=task.seed)}
    for call in range(1, len(then)):
        then[f"vector call {call - 1}"] = leaves(returned[f"vector call {call - 1}"])
        returned[f"vector call {call}"] = {"all": batch.step(task.table(2, 0, call))}
    for where, parts in then.items():
        require_same(f"at once, then later › {where}", parts, leaves(returned[where]))
    require_apart(returned)


def require_apart(returned: Mapping[str, object]) -> None:
    """Raise a ConformanceError if calls returned a container twice, or arrays of the same memory."""
    owners: dict[int, str] = {}
    for call, result in returned.items():
        mine: dict[int, str] = {}
        for where, part in walk(result, call):
            if isinstance(part, dict | list) and id(part) in mine:
                raise ConformanceError(f"{where}: the same object as {mine[id(part)]}")
            while isinstance(part, np.ndarray) and isinstance(part.base, np.ndarray):
                part = part.base
            if isinstance(part, dict | list) or (isinstance(part, np.ndarray) and part.size):
                mine[id(part)] = where
        for owner in mine.keys() & owners.keys():
            raise ConformanceError(f"{mine[owner]}: shares an object or memory with {owners[owner]}")
        owners |= mine


def check_busy(task: Task) -> None:
    """Check that what busy robots are told to do makes no difference."""
    env, other = task.env(), task.env()
    infos = env.reset(task.seed)[1]
    other.reset(task.seed)
    for step in itertools.count(1):
        actions, others = (by_agent(env, task.actions(0, 0, step, kind)) for kind in (0, OTHER_ACTIONS))
        mixed = {agent: (actions if infos[agent]["deciding"] else others)[agent] for agent in actions}
        result = env.step(actions)
        require_same(f"step {step}, other actions", *map(leaves, (result, other.step(mixed))))
        infos = result[-1]
        if not env.agents:
            break


CHECKS: tuple[Callable[[Task], None], ...] = (
    *(check_spaces, check_repeatable, check_processes, check_batches, check_copies),
    *(check_fresh, check_busy, check_call_order, check_bad_actions),
)


def check_conformance(
    scenario: str | Scenario,
    *,
    steps: int | None = 100,
    seed: int = 0,
    report: Callable[[str], None] = lambda line: None,
    **settings: object,
) -> None:
    """Run all checks.

    Args:
        scenario: A scenario's name, or a Scenario.
        steps: Episodes are cut off after this many; None = where the scenario ends them.
        seed: Of mission 0; mission e of a batch takes seed + e.
        report: Is told each check that holds.
        **settings: As for `EntropyExploreEnv`.

    Raises:
        ConformanceError: The contract is broken.
        SettingError: A setting is unknown or out of its range.
        WorldError: The world cannot be used.
    """
    limit = {} if steps is None else {"max_cycles": steps}
    asked, given = with_given_worlds(find_scenario(scenario, settings.get("robots")), {**settings, **limit})
    task = Task(asked if given else Missions(asked).scenario, check_seed(seed), given)
    for check in CHECKS:
        try:
            check(task)
        except ConformanceError as error:
            raise ConformanceError(f"{check.__name__}: {error}") from error
        report(f"{check.__name__}: {(check.__doc__ or '').strip()}")


def main(words: Sequence[str]) -> int:
    """Run the command and return its exit code: 0 if all holds, 1 if something does not."""
    parser = LineParser("python -m entropy_explore_env conformance")
    parser.add_argument("scenario", metavar="SCENARIO", help="name of a scenario")
    parser.add_argument("--world", help="a world file in place of the scenario's world")
    parser.add_argument("--robots", type=int, help="team size; default: the scenario's")
    parser.add_argument("--steps", type=int, default=100, help="an episode is cut off after this many")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--json", action="store_true", help="print one JSON object and nothing else")
    given = parser.parse_args(words)
    settings = {name: value for name in ("robots", "world") if (value := getattr(given, name)) is not None}
    held: list[str] = []

    def report(line: str) -> None:
        held.append(line)
        if not given.json:
            print(line)

    broken = None
    try:
        check_conformance(given.scenario, steps=given.steps, seed=given.seed, report=report, **settings)
    except ConformanceError as error:
        broken = str(error)
    if given.json:
        print(json.dumps({"scenario": given.scenario, "held": held, "broken": broken}))
    elif broken is not None:
        print(f"does not hold: {broken}")
    return 0 if broken is None else 1

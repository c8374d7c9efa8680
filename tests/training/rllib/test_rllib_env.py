"""The adapter for RLlib: who is heard when, what is learned from, how episodes end, and who shares a seed."""
# pyright: reportMissingImports=false

from collections import defaultdict
from typing import Any

import numpy as np
import pytest

from entropy_explore_env import ActionError, CallOrderError, SettingError, parallel_env
from entropy_explore_env.envs.conformance import leaves, require_same

pytest.importorskip("ray.rllib", reason="ray[rllib] is not installed: make test-rllib", exc_type=ImportError)

from ray.rllib.algorithms.ppo import PPOConfig
from ray.rllib.env.env_context import EnvContext
from ray.rllib.env.multi_agent_env_runner import MultiAgentEnvRunner

from entropy_explore_env.envs.rllib_env import EntropyExploreMultiAgentEnv, endings, runner_seed

pytestmark = [  # RLlib's own
    pytest.mark.filterwarnings("ignore::DeprecationWarning"),
    pytest.mark.filterwarnings("ignore:.*already in registry"),
]
BOX: dict[str, Any] = {
    "scenario": "box-7x11x5",
    "robots": 3,
    "time_limit_s": 60.0,
    "action": {"kind": "discrete"},
    "observation": {"flat": True},
    "reward": {"cost_per_s": 0.01},
}

FAULTS = {
    "stop": {"at_s": 9.0, "lasts_s": 8.0, "robots": (0,)},
    "blind": {"at_s": 4.0, "lasts_s": 10.0},
    "radio": {"garbled": 0.3, "repeated": 0.3, "late": 0.3, "late_s": 5.0},
}


def chosen(env: Any, agents: Any, rng: np.random.Generator) -> dict[str, Any]:
    return {agent: int(rng.integers(env.action_spaces[agent].n)) for agent in agents}


@pytest.mark.parametrize("faults", [{}, FAULTS])
@pytest.mark.parametrize("period", [0.25, 1.0, None])
def test_it_plays_the_mission_of_the_parallel_env_and_rewards_add_up(period, faults):
    """Observations are those of the deciding robots, rewards the sums since they decided last."""
    env = EntropyExploreMultiAgentEnv({**BOX, "decision_period_s": period, "faults": faults})
    team = parallel_env(**BOX, decision_period_s=period, faults=faults)
    observations, _ = env.reset(seed=4)
    expected, _ = team.reset(seed=4)
    assert list(observations) == team.agents
    rng, steps, skipped, over = np.random.default_rng(0), 0, 0, False
    while not over:
        require_same("observations", leaves(expected), leaves(observations))
        actions = chosen(env, observations, rng)
        observations, rewards, terminateds, truncateds, infos = env.step(actions)
        over = terminateds["__all__"] or truncateds["__all__"]
        if steps == 0:
            earned = dict.fromkeys(team.agents, 0.0)
        while True:  # the slow way: step after step, until someone decides
            given = {agent: actions.get(agent, 0) for agent in team.agents}
            everyone, now, _, truncated, told = team.step(given)
            actions = {}
            for agent, reward in now.items():
                earned[agent] += reward
            heard = [agent for agent in told if told[agent]["deciding"] or not team.agents]
            if heard:
                break
        expected = {agent: everyone[agent] for agent in heard}
        assert rewards == {agent: pytest.approx(earned[agent], abs=1e-12) for agent in heard}
        assert list(infos) == heard
        earned.update(dict.fromkeys(heard, 0.0))
        steps, skipped = steps + 1, skipped + 3 - len(heard)
        assert over == (not team.agents)
    require_same("last observations", leaves(expected), leaves(observations))
    assert truncateds == {"__all__": True} and terminateds == {"__all__": False}
    assert all(truncated.values()) and set(observations) == set(env.possible_agents)
    assert "figures" in infos["robot_0"]
    assert steps > 10 and skipped > 5


def test_a_mission_that_is_mapped_terminates():
    env = EntropyExploreMultiAgentEnv({**BOX, "time_limit_s": 5000.0, "ending": {"sigma_end": 10.0}})
    observations, _ = env.reset(seed=0)
    rng, over = np.random.default_rng(0), False
    while not over:
        observations, _, terminateds, truncateds, _ = env.step(chosen(env, observations, rng))
        over = terminateds["__all__"] or truncateds["__all__"]
    assert all(terminateds.values()) and set(terminateds) == {*env.possible_agents, "__all__"}
    assert truncateds == {"__all__": False}
    with pytest.raises(CallOrderError, match="after the mission's end"):
        env.step({})


@pytest.mark.parametrize(
    ("terminations", "truncations", "over", "terminateds", "truncateds"),
    [
        ([0, 0], [0, 0], False, {"__all__": False}, {"__all__": False}),
        ([1, 1], [0, 0], True, {"a": True, "b": True, "__all__": True}, {"__all__": False}),
        ([0, 0], [1, 1], True, {"__all__": False}, {"__all__": True}),
        ([1, 0], [0, 1], True, {"a": True, "__all__": False}, {"__all__": True}),
        ([1, 0], [0, 0], False, {"a": True, "__all__": False}, {"__all__": False}),
        ([0, 0], [1, 0], False, {"__all__": False}, {"a": True, "__all__": False}),
    ],
)
def test_endings(terminations, truncations, over, terminateds, truncateds):
    flags = [{a: bool(f) for a, f in zip("ab", given, strict=True)} for given in (terminations, truncations)]
    assert endings(*flags, over=over) == (terminateds, truncateds)


def runner_of(env: type, fragment: int, missions: int = 1, **settings: Any) -> MultiAgentEnvRunner:
    """A runner in this process."""
    config = (
        PPOConfig()
        .environment(env, env_config={**BOX, "seed": 0, **settings}, disable_env_checking=True)
        .env_runners(num_env_runners=0, num_envs_per_env_runner=missions, rollout_fragment_length=fragment)
        .multi_agent(policies={"shared"}, policy_mapping_fn=lambda agent, episode, **_: "shared")
        .debugging(seed=0)
    )
    return MultiAgentEnvRunner(config=config, worker_index=0)


class MixedEnd(EntropyExploreMultiAgentEnv):
    """One robot is mapped out, the others run out of time, in the same step."""

    def __init__(self, settings: Any) -> None:
        super().__init__(settings)
        inner = self.team.step

        def step(actions: Any) -> Any:
            observations, rewards, terminations, truncations, infos = inner(actions)
            if not self.team.agents:
                terminations["robot_1"], truncations["robot_1"] = True, False
            return observations, rewards, terminations, truncations, infos

        self.team.step = step  # type: ignore[method-assign]


def test_an_episode_ends_in_which_one_robot_terminates_while_others_are_truncated():
    """And RLlib bootstraps the values of those that were truncated, of no other."""
    done = [e for e in runner_of(MixedEnd, 100, time_limit_s=30.0).sample() if e.is_done]
    assert len(done) >= 1
    for episode in done:
        ends = {agent: one.is_terminated for agent, one in episode.agent_episodes.items()}
        assert ends == {"robot_0": False, "robot_1": True, "robot_2": False}
        assert all(one.is_done for one in episode.agent_episodes.values())


class Recording(EntropyExploreMultiAgentEnv):
    """Writes down what robots chose and what they got for it."""

    missions: list[dict[str, list[Any]]] = []  # noqa: RUF012 - shared on purpose

    def reset(self, **given: Any) -> Any:
        Recording.missions.append(defaultdict(list))
        return super().reset(**given)

    def step(self, action_dict: Any) -> Any:
        results = super().step(action_dict)
        for agent, action in action_dict.items():
            self.missions[-1][agent].append(int(action))
        for agent, reward in results[1].items():
            self.missions[-1][agent].append(reward)
        return results


@pytest.mark.parametrize("fragment", [7, 40])
def test_what_is_learned_from_is_what_was_chosen_also_across_fragments(fragment):
    """Every choice once, with its reward, although fragments are cut while robots are busy."""
    runner = runner_of(Recording, fragment)
    Recording.missions.clear()
    learned: dict[str, dict[str, list[Any]]] = {}
    while len(learned) < 3:
        for episode in runner.sample():
            of_mission = learned.setdefault(episode.id_, defaultdict(list))
            for agent, one in episode.agent_episodes.items():
                for action, reward in zip(one.get_actions(), one.get_rewards(), strict=True):
                    of_mission[agent] += [int(action), float(reward)]
    assert len(learned) >= 3
    for recorded, seen in list(zip(Recording.missions, learned.values(), strict=False))[:2]:
        assert set(recorded) == set(seen) == {"robot_0", "robot_1", "robot_2"}
        for agent, values in recorded.items():
            assert values[0::2] == seen[agent][0::2]
            assert values[1::2] == pytest.approx(seen[agent][1::2], abs=1e-6)
            assert len(values) > 20


def begun(context: EnvContext, number: int) -> tuple[int, bytes]:
    """Seed and first observations, as RLlib starts an environment."""
    env = EntropyExploreMultiAgentEnv(context)
    observations, _ = env.reset(seed=number)
    return env.team.missions.seeds[0], b"".join(one.tobytes() for one in observations.values())


def test_two_runners_never_share_a_seed_and_repeat_theirs():
    """RLlib's numbers are run + runner + place: 8 is runner 1's second and runner 2's first."""
    starts = {}
    for run in (6, 7):
        for workers in (2, 3):
            for worker in range(1, workers + 1):
                for place in range(2):
                    context = EnvContext({**BOX, "seed": run}, worker_index=worker, num_workers=workers)
                    first = begun(context, run + worker + place)
                    assert begun(context, run + worker + place) == first
                    starts[run, workers, worker, place] = first
    assert len(starts) == 20
    assert len({seed for seed, _ in starts.values()}) == len({start for _, start in starts.values()}) == 20


def test_a_first_reset_without_a_number_has_the_seed_of_the_run():
    env = EntropyExploreMultiAgentEnv({**BOX, "seed": 6})
    seeds = []
    for asked in (None, None, 3):
        env.reset(seed=asked)
        seeds.append(env.team.figures()["seed"])
    assert seeds == [runner_seed(6, 0, 0, 0)] * 2 + [runner_seed(6, 0, 0, 3)]
    with pytest.raises(SettingError, match="seed"):
        env.reset(seed=-1)


def test_runner_seed_keeps_every_number_apart():
    asked = [(r, n, w, p) for r in range(3) for n in range(3) for w in range(3) for p in range(3)]
    assert len({runner_seed(*numbers) for numbers in asked}) == len(asked)


def test_only_robots_that_decide_may_act():
    env = EntropyExploreMultiAgentEnv(BOX)
    with pytest.raises(CallOrderError, match="before reset"):
        env.step({})
    env.reset(seed=0)
    with pytest.raises(ActionError, match="robot_0, robot_1, robot_2"):
        env.step({"robot_0": 0})
    with pytest.raises(ActionError, match="robot_1"):
        env.step({"robot_0": 0, "robot_1": -5, "robot_2": 0})
    observations, rng = env.step({"robot_0": 1, "robot_1": 70, "robot_2": 0})[0], np.random.default_rng(0)
    while len(observations) == 3:
        observations = env.step(chosen(env, observations, rng))[0]
    with pytest.raises(ActionError, match="action_dict"):
        env.step({agent: 0 for agent in env.possible_agents})


def test_unknown_settings_are_refused():
    with pytest.raises(SettingError, match="unknown"):
        EntropyExploreMultiAgentEnv({"scenario": "unknown"})
    with pytest.raises(SettingError, match="seed"):
        EntropyExploreMultiAgentEnv({"seed": -1})

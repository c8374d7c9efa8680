"""Steps of a soak: what breaks the contract is found, and memory that grows."""

from __future__ import annotations

import numpy as np
import pytest

from benchmarks.proofs import soak
from benchmarks.proofs.cases import BrokenPromiseError
from entropy_explore_env.envs.vector_env import EntropyExploreVectorEnv


class Step:
    """A step of a batch in the box, and the moments before and after it."""

    def __init__(self):
        self.env = EntropyExploreVectorEnv("box-7x11x5", 3)
        self.env.action_space.seed(1)
        self.env.reset(seed=0)
        self.env.step(self.env.action_space.sample())
        self.before = soak._moment(self.env)
        self.stepped = self.env.step(self.env.action_space.sample())
        self.now = soak._moment(self.env)

    def check(self):
        soak.check(self.env, self.stepped, self.before, self.now)


@pytest.mark.parametrize(
    ("spoil", "said"),
    [
        (lambda s: s.now[0]["time_s"].__isub__(9.0), "time ran backwards"),
        (lambda s: s.before[0]["end"].fill(1), "did not begin at 0 s"),
        (lambda s: s.before[1]["entropy_bits"].__iadd__(1.0), "bits gained"),
        (lambda s: s.now[1]["own_bits"].__iadd__(1.0), "bits gained"),
        (lambda s: s.stepped[1].fill(np.nan), "reward is not finite"),
        (lambda s: s.stepped[4]["reward_robots"].fill(np.inf), "reward is not finite"),
        (lambda s: s.stepped[2].fill(True), "missions end"),
        (lambda s: s.now[0]["end"].fill(1), "missions end"),
        (
            lambda s: s.env.missions.observations[1, 0, 5:7].fill(np.nan),
            "outside its space",
        ),
    ],
)
def test_a_broken_promise_is_found(spoil, said):
    step = Step()
    spoil(step)
    with pytest.raises(BrokenPromiseError, match=said):
        step.check()


def test_numbers_outside_their_range_are_found(monkeypatch):
    def spoiled(env, *_):
        env.missions.state.robots["corners"][1, 0] = 10**8

    monkeypatch.setattr(soak, "check", spoiled)
    with pytest.raises(Exception, match=r"robots\.corners"):
        soak.walk("box-7x11x5", {}, 1_000, 0)


def test_a_case_plays_its_pair(monkeypatch):
    monkeypatch.setattr(soak, "ROBOT_STEPS", 3_000)
    box = next(place for place, (_, name) in enumerate(soak.PAIRS) if name == "box-7x11x5")
    found = soak.play(box + len(soak.PAIRS))
    assert found.of == "box-7x11x5" and 3_000 <= found.figures["robot-steps"] < 3_600


def test_memory_that_grows_is_told(monkeypatch):
    """MiB after each round; the first is what the others are compared with."""
    monkeypatch.setattr(soak, "walk", lambda name, channel, steps, seed: (steps, 1))
    for held, grown in ((iter([200.0, 199.0, 201.0]), 0.5), (iter([200.0, 203.0, 200.0]), None)):
        monkeypatch.setattr(soak, "resident_mib", lambda held=held: next(held))
        if grown is None:
            with pytest.raises(BrokenPromiseError, match=r"grew by 1\.5%"):
                soak.play_memory(0)
        else:
            assert soak.play_memory(0).figures["% grown at most"] == pytest.approx(grown)


def test_a_round_of_memory(monkeypatch):
    monkeypatch.setattr(soak, "MEMORY_STEPS", 1_000)
    monkeypatch.setattr(soak, "QUICK_PAIRS", soak.QUICK_PAIRS[:1])
    monkeypatch.setattr(soak, "MOST_GROWTH", 1.0)
    assert soak.play_memory(2).figures["robot-steps"] >= 3_000

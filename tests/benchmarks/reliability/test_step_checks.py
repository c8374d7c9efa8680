"""Steps of a soak: what leaves the contract is found, in whichever of the kept steps it was."""

from __future__ import annotations

import numpy as np
import pytest

from benchmarks.reliability import step_checks
from benchmarks.reliability.settings_fuzz import BrokenPromiseError
from benchmarks.reliability.step_checks import CheckedSteps, wrong_rays
from entropy_explore_env.envs.vector_env import EntropyExploreVectorEnv
from entropy_explore_env.errors import RecordError

DELAYED, PHASED = {"delay_s": 2.0}, {"phase_s": 3.0, "repeats": 2}


class Played:
    """A batch in the box, some steps of it kept; the last three are checked by the test."""

    def __init__(self, channel=None, steps=3):
        self.env = EntropyExploreVectorEnv("box-7x11x5", 3, channel=channel or {})
        self.env.action_space.seed(1)
        self.env.reset(seed=0)
        self.checked = CheckedSteps(self.env)
        for _ in range(steps):
            self.stepped = self.step()
            self.checked.note(self.stepped)

    def step(self):
        return self.env.step(self.env.action_space.sample())

    @property
    def robots(self):
        """Of the second of the kept steps, (E, A)."""
        return self.checked._kept["robots"][2]


def test_sound_steps_pass_and_are_forgotten():
    for channel in (DELAYED, PHASED, {"loss_probability": 0.5}):
        played = Played(channel, 60)
        played.checked.check(maps=True)
        assert played.checked._count == 0
        last = played.env.missions.state.robots
        assert np.array_equal(played.checked._kept["robots"][0]["entropy_bits"], last["entropy_bits"])


def test_summaries_under_way_are_looked_at_in_place():
    """They are as long as maps: copied after each step they would leave room for a step or two."""
    played = Played({"content": "summaries", "summary_every_s": 1.0, "delay_s": 2.0}, 60)
    assert "in_flight_summaries" not in played.checked._kept
    state = played.env.missions.state
    carrying = np.argwhere(state.in_flight_parcels["bytes"] > 0)
    assert len(carrying)
    played.checked.check(maps=True)
    mission, slot = carrying[0]
    state.in_flight_summaries[mission, state.in_flight_parcels["place"][mission, slot], 0] ^= 1
    with pytest.raises(RecordError, match="in_flight_summaries"):
        played.checked.check(maps=True)


@pytest.mark.parametrize(
    ("spoil", "said"),
    [
        (lambda c: c._kept["missions"][2]["time_s"].__isub__(9.0), "time ran backwards"),
        (lambda c: c._kept["robots"][0]["entropy_bits"].__iadd__(1.0), "bits gained"),
        (lambda c: c._kept["robots"][3]["own_bits"].__iadd__(1.0), "bits gained"),
        (lambda c: c._rewards[1].fill(np.nan), "rewards"),
        (lambda c: c._robot_rewards[3, :, 1].fill(np.inf), "rewards"),
        (lambda c: c._ends[2, 1].fill(True), "missions end"),
        (lambda c: c._kept["missions"][2]["end"].fill(1), "missions end"),
    ],
)
def test_a_broken_promise_is_found_in_any_step(spoil, said):
    played = Played()
    spoil(played.checked)
    with pytest.raises(BrokenPromiseError, match=said):
        played.checked.check()


def test_numbers_out_of_their_range_are_found_in_any_step():
    played = Played()
    played.robots["corners"][1, 0] = 10**8
    with pytest.raises(RecordError, match=r"robots\.corners"):
        played.checked.check()
    played = Played()
    played.env.missions.mean[1, 0, 2, 3, 4] = 1.5
    with pytest.raises(RecordError, match=r"mean\[1, 0"):
        played.checked.check(maps=True)


def test_observations_outside_their_space_are_found():
    played = Played()
    played.env.missions.observations[2, 1, 5] = np.nan
    played.env.missions.observations[0, 0, 0] = -1.0
    played.checked.note(played.stepped)
    with pytest.raises(BrokenPromiseError, match="2 numbers of observations"):
        played.checked.check()


def test_rays_of_messages_are_looked_at_while_they_are_on_their_way():
    played = Played(DELAYED)
    state = played.env.missions.state
    on_way = np.isfinite(state.in_flight["due_s"]) & (state.in_flight["count"] > 0)
    assert on_way.any()
    state.in_flight_rays[tuple(np.argwhere(on_way)[0])][0, :3] = 0.0
    played.checked.note(played.stepped)
    with pytest.raises(BrokenPromiseError, match="1 rays of messages are none"):
        played.checked.check()


def test_a_ray_is_wrong_by_its_length_its_distance_or_its_return():
    sound = np.array([0.6, 0.0, -0.8, 4.0, 1.0])
    rays = np.tile(sound, (1, 7, 1))
    rays[0, 1, 0], rays[0, 2, 3], rays[0, 3, 3], rays[0, 4, 4], rays[0, 5, 4] = 0.61, 5.1, -0.1, 0.5, 99.0
    rays[0, 6, 4] = np.nan
    assert [int(wrong_rays(rays, np.array([count]), 5.0)) for count in (-1, 0, 1, 2, 7)] == [0, 0, 0, 1, 6]


def test_steps_are_checked_when_as_many_are_kept_as_can_be(monkeypatch):
    monkeypatch.setattr(step_checks, "_MOST_STEPS", 4)
    played = Played(steps=3)
    played.robots["corners"][1, 0] = 10**8
    with pytest.raises(RecordError, match=r"robots\.corners"):
        played.checked.note(played.step())

"""Missions in which robots stop, sensors and radios fail: by hand, drawn, copied, batched, without end."""

import math

import numpy as np
import pytest

from entropy_explore_env.envs.parallel_env import EntropyExploreEnv
from entropy_explore_env.envs.vector_env import EntropyExploreVectorEnv
from entropy_explore_env.missions.faults import draw_faults
from entropy_explore_env.missions.poses import pose_at
from entropy_explore_env.missions.records import FAULT, MissionEnd
from entropy_explore_env.randomness import Stream, draw_uniform
from entropy_explore_env.reports.metrics import mission_figures
from entropy_explore_env.robots.motion import MoveEnd
from tests.reference.scenes import free_box, put, standing, started, toward, wander

HERE, FAR, STAY = (1.75, 1.75, 1.25, 0.0, 0.0), (1.75, 2.75, 1.25, 0.0, 0.0), (0.75, 4.75, 1.25, 0.0, 0.0)
AT_ONCE = {"turn_rate_rad_s": math.inf}


def team(faults, **changes):
    """Two robots of the box, about to go where they are sent; they turn at once."""
    return standing(HERE, STAY, faults=faults, robot={**AT_ONCE, **changes.pop("robot", {})}, **changes)


def test_a_robot_that_stops_stands_where_it_was_and_stays_there():
    """2 m at 0.5 m/s and 0.5 m/s²: half a metre after 1.5 s, where it is at its speed."""
    missions = team({"stop": {"at_s": 1.5, "robots": (0,)}}, robot={"reach_m": 2.0})
    for _ in range(9):
        robots = toward(missions, (1.75, 3.75, 1.25, 0.0, 0.0), STAY)
    place = (1.75, 2.25, 1.25, 0.0, 0.0)
    state, params = missions.state, missions.rules.params[0]
    assert state.missions[0]["time_s"] == pytest.approx(4.5)
    assert robots["goal"][0] == pytest.approx(place) and robots["distance_m"][0] == pytest.approx(0.5)
    for time_s in (1.5, 2.0, 4.5, 1e6):
        assert pose_at(params, robots[0], time_s) == pytest.approx(place)
    assert list(MoveEnd)[robots["move_end"][0]] is MoveEnd.FAILED
    assert (robots["scans"].tolist(), robots["deciding"].tolist()) == ([0, 9], [False, True])
    assert state.faults["stopped"].tolist() == [[True, False]]
    before = state.mean[0, 0].copy()
    toward(missions, FAR, STAY)
    assert (state.mean[0, 0] == before).all()  # it hears nothing, either


def test_a_robot_that_stops_for_a_while_decides_anew_and_goes_on():
    missions = team({"stop": {"at_s": 1.5, "lasts_s": 2.25, "robots": (0,)}})
    deciding = []
    for _ in range(8):
        robots = toward(missions, FAR, STAY)
        deciding.append((float(missions.state.missions[0]["time_s"]), bool(robots["deciding"][0])))
    times = [time_s for time_s, decides in deciding if decides]
    assert times[0] == pytest.approx(3.75)
    for _ in range(8):
        robots = toward(missions, FAR, STAY)
    assert robots["goal"][0] == pytest.approx(FAR, abs=1e-6) and robots["scans"][0] > 0
    assert robots["distance_m"][0] == pytest.approx(1.0)


def test_the_body_of_a_robot_that_stopped_stays_in_the_way():
    missions = team({"stop": {"at_s": 0.25, "robots": (1,)}}, robot={"body_radius_m": 0.2})
    put(missions, 1, (1.75, 3.0, 1.25, 0.0, 0.0))
    toward(missions, HERE, (1.75, 3.0, 1.25, 0.0, 0.0))
    for _ in range(3):
        robots = toward(missions, (1.75, 3.7, 1.25, 0.0, 0.0), STAY)
    assert list(MoveEnd)[robots["move_end"][0]] is MoveEnd.TEAMMATE
    assert robots["goal"][0][1] == pytest.approx(2.6, abs=1e-3)


@pytest.mark.parametrize("period_s", [None, 0.7])
def test_a_mission_in_which_all_have_stopped_for_good_is_cut_off(period_s):
    scenario = free_box(faults={"stop": {"at_s": 4.0}}, decision_period_s=period_s)
    missions = started(
        free_box(faults={"stop": {"at_s": 4.0}}, decision_period_s=period_s, time_limit_s=math.inf)
    )
    wander(missions, 40, 0)
    clock = missions.state.missions[0]
    assert missions.over(0) is MissionEnd.STOPPED and not MissionEnd.STOPPED.reached_goal
    assert clock["time_s"] == 4.0 and np.isfinite(missions.observations).all()
    env = EntropyExploreEnv(scenario)
    env.reset(seed=0)
    rng = np.random.default_rng(0)
    while env.agents:
        actions = {agent: rng.uniform(-1, 1, 5).astype(np.float32) for agent in env.agents}
        _, _, terminations, truncations, infos = env.step(actions)
    assert all(truncations.values()) and not any(terminations.values())
    assert [info["stopped"] for info in infos.values()] == [True, True]
    assert env.figures()["faults"]["robots_stopped"] == 2


def test_all_may_stand_still_for_a_while_without_an_end():
    missions = started(free_box(faults={"stop": {"at_s": 4.0, "lasts_s": 50.0}}, time_limit_s=1000.0))
    times = []
    wander(missions, 40, 0, lambda step: times.append(float(missions.state.missions[0]["time_s"])))
    assert missions.over(0) is MissionEnd.RUNNING or times[-1] > 54.0
    assert 54.0 in times and not any(4.0 < time_s < 54.0 for time_s in times)


def test_a_blind_sensor_brings_nothing_and_the_scan_takes_its_time():
    missions = team({"blind": {"at_s": 0.1, "lasts_s": 1.0}})
    scans, bits = [], []
    for _ in range(4):
        robots = toward(missions, HERE, STAY)
        scans.append(robots["scans"].tolist())
        bits.append(robots["own_bits"].tolist())
    assert scans == [[1, 1], [2, 2], [3, 3], [4, 4]]  # at 0.5, 1.0, 1.5 and 2.0 s
    assert (np.array(bits)[:2] == 0.0).all() and (np.array(bits)[2:] > 0.0).all()
    assert missions.state.faults["blind_scans"].tolist() == [[2, 2]]
    assert mission_figures(missions, 0)["faults"]["blind_scans"] == 4


@pytest.mark.parametrize("who", [0, 1])
def test_a_silent_radio_neither_sends_nor_hears(who):
    missions = team({"silent": {"at_s": 0.1, "robots": (who,)}}, channel={"i_min_bits": 0.0})
    for _ in range(6):
        robots = toward(missions, HERE, STAY)
    assert (robots["scans"] == 6).all() and (robots["messages_sent"] > 6).all()
    assert (robots["measurements_received"] == 0).all()
    silenced = missions.state.faults["messages_silenced"][0]
    assert silenced[who] == robots["messages_sent"].sum() - 2  # all but the announcements at time 0
    assert silenced[1 - who] == 0
    assert (missions.state.heard["heard_s"][0][[0, 1], [1, 0]] == 0.0).all()


def test_a_sound_radio_draws_nothing():
    """So that one fault more does not change when others happen."""
    missions = team({"blind": {"at_s": 1e6}}, channel={"i_min_bits": 0.0})
    before = missions.state.faults["radio_rng"].copy()
    for _ in range(3):
        robots = toward(missions, HERE, STAY)
    assert (robots["messages_received"] > 0).all()
    assert (missions.state.faults["radio_rng"] == before).all()


@pytest.mark.parametrize("kind", ["late", "garbled", "repeated"])
def test_a_radio_fails_where_less_than_its_share_is_drawn(kind):
    """The least number that a mission draws is no fault; it is one where the share is the next number."""

    def played(share):
        missions = team({"radio": {kind: share, "robots": (0,)}}, channel={"i_min_bits": 0.0})
        state = missions.state.faults[0, 0]
        before = state["radio_rng"].copy()
        for _ in range(3):
            toward(missions, HERE, STAY)
        return before, state["radio_rng"].copy(), int(state[f"messages_{kind}"])

    rng, after, _ = played(5e-324)
    drawn = []
    while rng != after:
        drawn.append(draw_uniform(rng))
    assert len(drawn) >= 3
    assert played(min(drawn))[2] == 0
    assert played(np.nextafter(min(drawn), 1.0))[2] == 1


@pytest.mark.parametrize("channel", [{}, {"delay_s": 0.2}, {"phase_s": 2.0, "repeats": 2}])
def test_garbled_messages_are_dropped_and_counted(channel):
    channel = {"i_min_bits": 0.0, **channel}
    missions = team({"radio": {"garbled": 1.0, "robots": (0,)}}, channel=channel)
    for _ in range(12):
        robots = toward(missions, HERE, STAY)
    faults = missions.state.faults[0]
    assert robots["messages_received"][0] == 0 < robots["messages_received"][1]
    assert faults["messages_garbled"][0] > 4 and faults["messages_garbled"][1] == 0
    assert missions.state.heard[0, 0, 1]["heard_s"] == -1.0


@pytest.mark.parametrize("channel", [{}, {"delay_s": 0.2}])
def test_a_message_that_arrives_twice_costs_twice_and_changes_nothing(channel):
    channel = {"i_min_bits": 0.0, **channel}
    told = []
    for faults in ({}, {"radio": {"repeated": 1.0, "robots": (1,)}}):
        missions = team(faults, channel=channel)
        for _ in range(6):
            robots = toward(missions, HERE, STAY)
        told.append((robots.copy(), missions.state.mean.copy(), missions.state.precision.copy()))
    once, twice = told[0][0], told[1][0]
    for field in ("messages_received", "bits_received"):
        assert (twice[field] == once[field] * [1, 2]).all() and once[field].all()
    assert (twice["measurements_received"] == once["measurements_received"]).all()
    assert (told[0][1] == told[1][1]).all() and (told[0][2] == told[1][2]).all()
    assert (missions.state.faults["messages_repeated"][0] == once["messages_received"] * [0, 1]).all()


def test_late_messages_are_overtaken_and_old_news_changes_nothing():
    """All messages of robot 0 are late by more than a scan takes; then none is: the later ones come first."""
    missions = team({"radio": {"late": 1.0, "late_s": 3.2, "robots": (0,)}}, channel={"i_min_bits": 0.0})
    toward(missions, HERE, STAY)
    assert missions.state.heard[0, 1, 0]["heard_s"] == -1.0  # nothing has arrived
    assert missions.rules.faults is not None
    missions.rules.faults["late"] = 0.0
    toward(missions, FAR, STAY)
    state, told = missions.state, []
    assert state.heard[0, 1, 0]["announced_s"] == 0.5
    assert state.heard[0, 1, 0]["announced"][:5] == pytest.approx(FAR, abs=1e-6)
    for _ in range(7):
        toward(missions, FAR, STAY)
        told.append(state.robots["messages_received"][0, 1])
        assert state.heard[0, 1, 0]["announced_s"] >= 0.5
        assert state.heard[0, 1, 0]["announced"][:5] == pytest.approx(FAR, abs=1e-6)
    assert told[-1] - told[0] >= 3  # the two late ones are among them
    assert state.faults["messages_late"].tolist() == [[2, 0]]
    assert state.heard[0, 1, 0]["heard_s"] == pytest.approx(4.5)


def test_faults_change_neither_worlds_starts_nor_noise_nor_losses():
    changes = {"robots": 3, "sensor": {"range_noise_m": 0.1}, "channel": {"loss_probability": 0.3}}
    told = []
    for faults in ({}, {"stop": {"mean_s": 1e9}, "blind": {"mean_s": 1e9}, "silent": {"mean_s": 1e9}}):
        missions = started(free_box(faults=faults, **changes))
        wander(missions, 30, 1)
        told.append([missions.state.robots.tobytes(), missions.state.mean.tobytes()])
    assert told[0] == told[1]


def drawn_states(seed, robots=3, **outages):
    scenario, states = free_box(robots=robots, faults=outages), np.zeros(robots, FAULT)
    draw_faults(scenario, seed, 0, states)
    return states


def test_drawn_times_have_the_mean_that_was_asked_for_and_streams_of_their_own():
    settings = {"stop": {"mean_s": 40.0, "lasts_s": 7.0}, "blind": {"mean_s": 5.0}}
    states = np.array([drawn_states(seed, **settings) for seed in range(1500)])
    assert states["stop_s"].mean() == pytest.approx(40.0, rel=0.06)
    assert states["stop_s"].std() == pytest.approx(40.0, rel=0.08)  # exponential
    assert states["blind_s"].mean() == pytest.approx(5.0, rel=0.06)
    assert states["stop_until_s"] - states["stop_s"] == pytest.approx(7.0)
    assert np.isinf(states["blind_until_s"]).all() and np.isinf(states["silent_s"]).all()
    for one, other in ((states["stop_s"][:, 0], states["blind_s"][:, 0]), states["stop_s"][:, :2].T):
        assert abs(np.corrcoef(one, other)[0, 1]) < 0.1
    alone = drawn_states(3, blind={"mean_s": 5.0})
    assert (alone["blind_s"] == states[3]["blind_s"]).all()
    earlier = drawn_states(3, stop={"mean_s": 40.0, "at_s": 30.0, "robots": (1, 2)})
    assert earlier["stop_s"].tolist() == [math.inf, *np.minimum(states[3]["stop_s"][1:], 30.0)]
    assert Stream.FAULTS not in (Stream.SENSOR, Stream.CHANNEL, Stream.STRATEGY)


def test_infos_say_who_fails_now():
    scenario = free_box(
        faults={
            "stop": {"at_s": 1.5, "lasts_s": 2.0, "robots": (0,)},
            "silent": {"at_s": 2.5, "robots": (1,)},
        },
        decision_period_s=1.0,
    )
    env, envs = EntropyExploreEnv(scenario), EntropyExploreVectorEnv(scenario, num_envs=2)
    env.reset(seed=0)
    envs.reset(seed=0)
    told, batched = [], []
    for _ in range(4):
        still = {agent: np.zeros(5, np.float32) for agent in env.agents}
        infos = env.step(still)[-1]
        told.append([[infos[agent][name] for name in ("stopped", "blind", "silent")] for agent in still])
        infos = envs.step(np.zeros((2, 2, 5), np.float32))[-1]
        batched.append([infos[name][0].tolist() for name in ("stopped", "blind", "silent")])
    right, left = [False, False, False], [True, False, False]
    assert [one for one, _ in told] == [right, left, left, right]
    assert [other for _, other in told] == [right, right, [False, False, True], [False, False, True]]
    assert [np.transpose(each).tolist() for each in batched] == told

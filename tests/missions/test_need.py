"""Sharing by need: what is sent first, that it fits the burst, and that nothing is fused twice."""

import numpy as np
import pytest
from hypothesis import given

from entropy_explore_env.belief.entropy import map_entropy_bits
from entropy_explore_env.missions.backlog import TeamBacklog
from entropy_explore_env.missions.messages import Team, Tracer, unpack_measurements
from entropy_explore_env.missions.need import choose_needed, share_lacking
from tests.reference.scenes import drawn, free_box, robots_of, seeds, started, wander

QUIET = {"announcements": False, "i_min_bits": 0.0}
NEED = {**QUIET, "order": "need"}
UNENDING = {"ending": {"sigma_end": 1e-4}}
SENT = -2.0


def played(steps=60, seed=3, robots=3, changes=UNENDING, **channel):
    missions = started(free_box(robots=robots, channel={**NEED, **channel}, **changes))
    wander(missions, steps, seed)
    return missions


def team_of(missions):
    """The team of the first mission, and its backlog."""
    state, selection = missions.state, missions._compiled_step.work[0].selection
    kept = (getattr(state, f"backlog_{name}")[0] for name in TeamBacklog._fields[:-1])
    backlog = TeamBacklog(*kept, selection)
    return Team(missions.rules.params, state.robots[0], state.heard[0], backlog=backlog), backlog


def chosen_of(backlog, robot, rays):
    """(age, ray) of each measurement that was marked."""
    marked = np.flatnonzero(backlog.selection.value[: min(robot["scans"], 64) * rays] == SENT)
    return [(int(number) // rays, int(number) % rays) for number in marked]


@pytest.fixture(scope="module")
def prepared():
    """Three robots, eleven measurements a message or fewer."""
    return started(free_box(robots=3, channel={**NEED, "burst": 12}, **UNENDING))


def reference_choice(missions, index, burst):
    """What robot `index` sends: (age, ray) in the order of value, by sorting everything."""
    state, robot = missions.state, missions.state.robots[0, index]
    mates = [mate for mate in range(3) if mate != index]
    kept, valued = state.backlog_poses.shape[2], []
    for age in range(min(int(robot["scans"]), kept)):
        slot = (int(robot["scans"]) - 1 - age) % kept
        for ray in range(int(missions.rules.params[index]["rays"])):
            sent_s = state.backlog_sent_s[0, index, slot, ray]
            shares = []
            for mate in mates:
                said_s = state.heard[0, index, mate]["heard_s"]
                heard_s = state.backlog_heard_s[0, index, slot, ray, mate]
                answered, known = said_s > sent_s, 0.0 < heard_s and heard_s < said_s
                shares.append(1.0 if sent_s == 0.0 or (answered and not known) else 0.0)
            bits = state.backlog_bits[0, index, slot, ray]
            if bits >= robot["i_min_bits"] and bits * sum(shares) > 0.0:
                valued.append((-bits * (sum(shares) / 2), age, ray))
    chosen, bits, opened = [], 160 + 2 * 48, {0}
    for _, age, ray in sorted(valued)[: 4 * burst]:
        cost = 96 if age in opened else 96 + 160
        if bits + cost <= 160 + 96 * burst and (age in opened or len(opened) < 1 + 5):
            bits += cost
            opened.add(age)
            chosen.append((age, ray))
    return sorted(chosen), bits


@drawn(100)
@given(seeds)
def test_what_is_chosen_is_what_sorting_everything_gives(prepared, seed):
    """Drawn utilities, few of them different; what was sent, heard and answered, in any order of time."""
    rng, state, index = np.random.default_rng(seed), prepared.state, seed % 3
    shape = state.backlog_bits.shape
    state.backlog_bits[...] = rng.choice([-1.0, 0.0, 0.1, 0.5, 2.0, 7.0], shape)
    state.backlog_sent_s[...] = rng.choice([0.0, 1.0, 2.0, 3.0], shape)
    later = state.backlog_sent_s[..., None] + rng.choice([0.0, 1.0], (*shape, 3))
    state.backlog_heard_s[...] = np.where(rng.random(later.shape) < 0.5, later, 0.0)
    state.heard[0]["heard_s"] = rng.choice([-1.0, 1.0, 2.0, 3.0], (3, 3))
    state.robots[0]["scans"], state.robots[0]["i_min_bits"] = rng.integers(1, 200), rng.choice([0.0, 0.3])
    team, backlog = team_of(prepared)
    expected, cost = reference_choice(prepared, index, 12)
    count, bits = choose_needed(backlog, team, index)
    found = chosen_of(backlog, state.robots[0, index], int(prepared.rules.params[index]["rays"]))
    assert sorted(found) == expected and count == len(expected)
    assert bits == cost <= 160 + 96 * 12


def test_which_teammates_lack_a_measurement_by_hand(prepared):
    """Robot 1 asks of a measurement that it sent at 5 s; robot 0 heard it then, robot 2 did not."""
    state = prepared.state
    state.backlog_sent_s[0, 1, 2, 3], state.backlog_heard_s[0, 1, 2, 3] = 5.0, (5.0, 0.0, 0.0)
    _, backlog = team_of(prepared)
    for said_s, share in (
        ((-1.0, -1.0), 0.0),  # neither has answered
        ((5.0, 5.0), 0.0),  # what they say at that time may be older
        ((6.0, 5.0), 0.0),  # robot 0 has it
        ((4.9, 6.0), 0.5),  # robot 2 lacks it
        ((6.0, 6.0), 0.5),
    ):
        state.heard[0, 1]["heard_s"][[0, 2]] = said_s
        assert share_lacking(backlog, state.heard[0, 1], 1, 2, 3) == share
    state.backlog_sent_s[0, 1, 2, 3] = 0.0
    assert share_lacking(backlog, state.heard[0, 1], 1, 2, 3) == 1.0


def test_a_message_by_hand(prepared):
    """1,312 bits, of which pose and two receipts take 256: eleven measurements, or eight and another pose."""
    state = prepared.state
    state.robots[0]["scans"], state.robots[0]["i_min_bits"] = 2, 0.4
    state.backlog_bits[0, 0, :2] = 0.3  # below I_min
    state.backlog_sent_s[0, 0], state.backlog_heard_s[0, 0] = 0.0, 0.0
    state.backlog_bits[0, 0, 1, 4:13] = 1.0  # of the latest scan: nine
    state.backlog_bits[0, 0, 0, 7] = 3.0  # of the one before, sent at 5 s
    state.backlog_sent_s[0, 0, 0, 7], state.heard[0, 0]["heard_s"] = 5.0, 4.0
    team, backlog = team_of(prepared)
    assert choose_needed(backlog, team, 0) == (9, 160 + 96 + 9 * 96)
    state.heard[0, 0]["heard_s"] = 6.0  # both have answered, and neither has it
    assert choose_needed(backlog, team, 0) == (9, 160 + 96 + 160 + 9 * 96)
    assert chosen_of(backlog, state.robots[0, 0], int(prepared.rules.params[0]["rays"])) == [
        *((0, ray) for ray in range(4, 12)),
        (1, 7),
    ]


def test_messages_fit_into_the_bits_of_a_burst():
    spent, fields = [], ("messages_sent", "measurements_sent", "bits_sent")
    missions = started(free_box(robots=3, channel={**NEED, "loss_probability": 0.5}, **UNENDING))

    def note(_):
        spent.append([robots_of(missions, name).copy() for name in fields])

    wander(missions, 80, 5, note)
    messages, measured, bits = np.diff(np.array(spent), axis=0).transpose(1, 0, 2)
    poses, rest = np.divmod(bits - messages * (160 + 2 * 48) - 96 * measured, 160)
    assert (bits <= messages * (160 + 96 * 8)).all() and messages.max() >= 1
    assert (rest == 0).all() and (poses >= 0).all() and poses.sum() > 20


def test_losses_are_those_of_the_other_rule():
    """Each scan sends one message, and each message draws once for each teammate, whatever it holds."""
    by_need, by_utility = (played(loss_probability=0.5, order=order) for order in ("need", "utility"))
    for field in ("scans", "messages_sent", "messages_lost", "channel_rng"):
        np.testing.assert_array_equal(robots_of(by_need, field), robots_of(by_utility, field))
    assert (robots_of(by_need, "entropy_bits") < robots_of(by_utility, "entropy_bits")).all()


@pytest.mark.parametrize("channel", [{"burst": 10_000}, {}, {"range_m": 1.5, "burst": 40}])
def test_each_measurement_is_fused_once(channel):
    """A map's precision is the prior, all own measurements, and those that were ever heard, each once."""
    missions = played(50, loss_probability=0.5, **channel)
    state, params = missions.state, missions.rules.params
    assert robots_of(missions, "scans").max() < 64
    scan = missions._compiled_step.work[0].scan
    expected = np.full((3, missions.grid.voxels), params["prior_precision"][0])
    repeated = 0
    for index in range(3):
        tracer = Tracer(missions.rules.sensors.params[index : index + 1], state.truth[0])
        rays = int(params[index]["rays"])
        for slot in range(int(state.robots[0, index]["scans"])):
            pose, packed = state.backlog_poses[0, index, slot], state.backlog_rays[0, index, slot]
            unpack_measurements(params[index], tracer, 0, scan, pose, packed, rays)
            for ray in np.flatnonzero(state.backlog_bits[0, index, slot, :rays] >= 0.0):
                crossed = scan.crossed[ray, : scan.rays[ray]["voxels"]]
                has = state.backlog_heard_s[0, index, slot, ray] > 0.0
                repeated += int(0 < has.sum() and has[has].sum() < 2)
                has[index] = True
                for robot in np.flatnonzero(has):
                    expected[robot, crossed] += scan.rays[ray]["precision"]
    np.testing.assert_allclose(missions.state.precision[0], expected, rtol=1e-4)
    np.testing.assert_allclose(
        robots_of(missions, "entropy_bits"), map_entropy_bits(missions.precision[0]), rtol=1e-6
    )

"""The broadcast in phases: when batches go out, what they cost, and that each is fused once."""

import numpy as np

from entropy_explore_env.belief.entropy import map_entropy_bits
from tests.reference.scenes import free_box, robots_of, started, wander

NO_ANNOUNCEMENTS = {"announcements": False, "i_min_bits": 0.0}


def played(steps=60, seed=3, **channel):
    scenario = free_box(robots=3, channel={**NO_ANNOUNCEMENTS, **channel}, ending={"sigma_end": 1e-4})
    missions = started(scenario)
    wander(missions, steps, seed)
    return missions


def test_nothing_is_heard_before_the_first_phase_ends():
    seen = []
    missions = started(free_box(robots=3, channel={**NO_ANNOUNCEMENTS, "phase_s": 7.0}))

    def note(_):
        clock = missions.state.missions[0]
        seen.append((float(clock["time_s"]), int(robots_of(missions, "messages_sent").sum())))

    wander(missions, 40, 1, note)
    early = [sent for time_s, sent in seen if time_s < 7.0]
    assert len(early) > 3 and not any(early)
    assert seen[-1][1] > 0


def test_what_waits_is_sent_once_and_heard_by_all():
    missions = played(phase_s=4.0)
    sent, heard = robots_of(missions, "messages_sent"), robots_of(missions, "messages_received")
    assert (heard == sent.sum() - sent).all() and sent.min() > 3
    measured = robots_of(missions, "measurements_sent")
    bits = 160 * sent + 96 * measured
    np.testing.assert_array_equal(robots_of(missions, "bits_sent"), bits)
    np.testing.assert_array_equal(robots_of(missions, "bits_received"), bits.sum() - bits)
    batches, rest = divmod(int(measured.sum()), 8)
    assert rest == 0 and batches == sent.sum()  # burst = 8 of every scan


def test_repeats_cost_bits_and_are_fused_once():
    once, thrice = played(phase_s=4.0, repeats=1), played(phase_s=4.0, repeats=3)
    np.testing.assert_allclose(
        robots_of(once, "measurements_received"), robots_of(thrice, "measurements_received"), atol=24
    )
    assert robots_of(thrice, "bits_sent").sum() > 2 * robots_of(once, "bits_sent").sum()
    for missions in (once, thrice):
        carried = robots_of(missions, "entropy_bits")
        np.testing.assert_allclose(carried, map_entropy_bits(missions.precision[0]), rtol=1e-6)


def test_a_teammate_is_heard_again_when_it_repeats_what_is_known():
    """Two broadcasts of each buffer, 2 s apart: the first of all at 4 s, when the first phase has ended."""
    settings = {"phase_s": 4.0, "repeats": 2}
    missions = started(
        free_box(robots=2, channel={**NO_ANNOUNCEMENTS, **settings}, ending={"sigma_end": 1e-4})
    )
    seen = []

    def note(_):
        heard = missions.state.heard[0]["heard_s"]
        seen.append((float(missions.state.missions[0]["time_s"]), heard[0, 1], heard[1, 0]))

    wander(missions, 20, 1, note)
    later = [(heard, 2.0 * (time_s // 2.0)) for time_s, *heard in seen if time_s > 4.0 and time_s % 2.0]
    assert {latest % 4.0 for _, latest in later} == {0.0, 2.0}
    for heard, latest in later:
        assert heard == [latest, latest]


def test_what_a_broadcast_does_not_reach_is_counted_and_waits_no_longer():
    for channel in ({"range_m": 0.1}, {"reach": "signal", "signal": {"budget_db": -110.0}}):
        missions = played(phase_s=4.0, **channel)
        sent = robots_of(missions, "messages_sent")
        assert sent.min() > 3 and robots_of(missions, "messages_received").sum() == 0
        assert (robots_of(missions, "messages_out_of_range") == 2 * sent).all()
        assert robots_of(missions, "messages_lost").sum() == 0


def test_what_a_silent_radio_broadcasts_is_counted_and_heard_by_nobody():
    scenario = free_box(
        robots=3,
        channel={**NO_ANNOUNCEMENTS, "phase_s": 4.0},
        faults={"silent": {"at_s": 0.001, "robots": (1,)}},
        ending={"sigma_end": 1e-4},
    )
    missions = started(scenario)
    wander(missions, 60, 3)
    silenced = missions.state.faults[0]["messages_silenced"]
    sent, heard = robots_of(missions, "messages_sent"), robots_of(missions, "messages_received")
    assert silenced[1] > 0 and heard[1] == 0
    assert heard[0] == sent[2] and heard[2] == sent[0]

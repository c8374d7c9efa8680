"""Settings of the channel that do nothing where they are given are refused, and errors say what to write."""

import pytest

from entropy_explore_env.errors import SettingError
from entropy_explore_env.settings.changes import with_settings
from entropy_explore_env.settings.channel import Channel
from entropy_explore_env.settings.fiducials import Fiducials
from entropy_explore_env.settings.scenarios import ROOM

SUMMARIES = {"content": "summaries"}


@pytest.mark.parametrize(
    ("settings", "field", "allowed"),
    [
        ({**SUMMARIES, "burst": 0}, "burst", "above 0 where robots send summaries"),
        ({**SUMMARIES, "phase_s": 1.0, "repeats": 2}, "phase_s", "0 where robots send summaries"),
        ({**SUMMARIES, "repeats": 2}, "repeats", "1 without phase_s: batches are sent at once, and once"),
        ({"repeats": 2}, "repeats", "1 without phase_s: batches are sent at once, and once"),
        ({**SUMMARIES, "order": "need"}, "order", "utility where robots send summaries"),
        ({"order": "need", "phase_s": 1.0}, "phase_s", '0 where order="need": robots send at once'),
        ({"order": "need", "delay_s": 1.0}, "delay_s", '0 where order="need": receipts tell'),
        ({"summary_every_s": 5.0}, "summary_every_s", '10, its default, without content="summaries"'),
        (
            {"phase_s": 1.0, "summary_threshold_bits": 0.4},
            "summary_threshold_bits",
            '0.5, its default, without content="summaries"',
        ),
    ],
)
def test_settings_without_effect_are_refused(settings, field, allowed):
    with pytest.raises(SettingError) as raised:
        Channel(**settings)
    assert raised.value.field == f"Channel.{field}" and raised.value.value == settings[field]
    assert raised.value.allowed.startswith(allowed)


@pytest.mark.parametrize(
    ("settings", "field", "written"),
    [
        ({"channel": "summaries"}, "Scenario.channel", "a mapping of its fields: {'content': 'summaries'}"),
        ({"channel": "line_of_sight"}, "Scenario.channel", "fields: {'reach': 'line_of_sight'}"),
        ({"channel": "loud"}, "Scenario.channel", "summary_every_s, summary_threshold_bits, …"),
        (
            {"robot": {"localization": 0.1}},
            "Robot.localization",
            "a mapping of its fields xy_m_per_sqrt_m, z_m_per_sqrt_m, yaw_rad_per_sqrt_m, …",
        ),
        ({"channel": {"announcements": 2}}, "Channel.announcements", "a bool"),
    ],
)
def test_a_value_in_place_of_a_part_says_what_to_write(settings, field, written):
    with pytest.raises(SettingError) as raised:
        with_settings(ROOM, settings)
    assert raised.value.field == field and raised.value.allowed.endswith(written)


def test_places_of_fiducials_may_be_lists():
    places = [[1.0, 2.0, 0.5], (3.0, 4.0, 0.5)]
    scenario = with_settings(ROOM, {"fiducials": {"positions_m": places}})
    assert scenario.fiducials == Fiducials(positions_m=((1.0, 2.0, 0.5), (3.0, 4.0, 0.5)))
    assert hash(scenario.fiducials) == hash(Fiducials(positions_m=((1.0, 2.0, 0.5), (3.0, 4.0, 0.5))))

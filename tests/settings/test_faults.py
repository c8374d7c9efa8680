"""Settings of faults and signals: what is allowed, that they go through JSON, and that teams fit them."""

import pytest

from entropy_explore_env.errors import SettingError
from entropy_explore_env.settings.changes import with_settings
from entropy_explore_env.settings.faults import Faults
from entropy_explore_env.settings.scenarios import BOX

TEAM = with_settings(BOX, {"robots": 3})


@pytest.mark.parametrize("part", ["stop", "blind", "silent", "sensor", "radio"])
def test_faults_are_those_of_robots_that_there_are(part):
    assert with_settings(TEAM, {"faults": {part: {"robots": (2, 0)}}}).faults.parts[part].robots == (2, 0)
    with pytest.raises(SettingError, match=r"robots = \(3,\): expected numbers of robots of the team, .* 3"):
        with_settings(TEAM, {"faults": {part: {"robots": (3,)}}})


def test_late_messages_go_neither_with_phases_nor_with_need():
    late = {"faults": {"radio": {"late": 0.1}}}
    assert with_settings(TEAM, late).message_slots > 0 == TEAM.message_slots
    with pytest.raises(SettingError, match=r"RadioFault.late = 0.1: expected 0 where batches"):
        with_settings(TEAM, {**late, "channel": {"phase_s": 2.0}})
    with pytest.raises(SettingError, match=r"RadioFault.late = 0.1: expected 0 where Channel.order"):
        with_settings(TEAM, {**late, "channel": {"order": "need"}})
    with pytest.raises(SettingError, match=r"RadioFault.late_s = 3600.0: expected a time so short"):
        with_settings(TEAM, {"faults": {"radio": {"late": 0.1, "late_s": 3600.0}}, "robots": 40})


def test_nothing_goes_wrong_by_default():
    assert not Faults().happen and not TEAM.faults.happen
    changed = {
        "stop": {"at_s": 5.0},
        "blind": {"mean_s": 5.0},
        "silent": {"at_s": 5.0},
        "sensor": {"range_bias_m": -0.1},
        "radio": {"repeated": 0.1},
    }
    for name, change in changed.items():
        faults = with_settings(TEAM, {"faults": {name: change}}).faults
        assert faults.happen and [part.happens for part in faults.parts.values()].count(True) == 1
    assert not with_settings(
        TEAM, {"faults": {"stop": {"lasts_s": 3.0}, "radio": {"late_s": 1.0}}}
    ).faults.happen

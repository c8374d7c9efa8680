"""Which messages arrive: through what stands between two robots, and how far."""

import numpy as np
import pytest

from tests.reference.scenes import build, free_box, put, started

HERE, THERE = (0.75, 0.75, 1.25, 0.0, 0.0), (2.75, 0.75, 1.25, 0.0, 0.0)


@pytest.mark.parametrize(
    ("channel", "wall", "heard"),
    [
        ({}, True, True),
        ({"reach": "line_of_sight"}, False, True),
        ({"reach": "line_of_sight"}, True, False),
        ({"range_m": 2.1}, True, True),
        ({"range_m": 1.9}, False, False),
        ({"range_m": 2.1, "reach": "line_of_sight"}, True, False),
        ({"range_m": 1.9, "reach": "line_of_sight"}, False, False),
        # 6.02 dB for two metres, and 15 dB for half a metre of wall
        ({"reach": "signal", "signal": {"exponent": 2.0, "budget_db": 22.0}}, True, True),
        ({"reach": "signal", "signal": {"exponent": 2.0, "budget_db": 21.0}}, True, False),
        ({"reach": "signal", "signal": {"exponent": 2.0, "budget_db": 21.0}}, False, True),
        ({"reach": "signal", "signal": {"exponent": 2.0, "budget_db": 6.0}}, False, False),
        ({"reach": "signal", "range_m": 1.9, "signal": {"budget_db": 280.0}}, False, False),
    ],
)
def test_a_message_passes_or_is_counted_as_out_of_range(channel, wall, heard):
    """2 m apart, with a wall between them or without; they stand and scan."""
    missions = started(free_box(robots=2, channel={"i_min_bits": 0.0, **channel}))
    solid = np.zeros(missions.grid.shape, bool)
    solid[3] = wall
    build(missions, solid)
    put(missions, 0, HERE)
    put(missions, 1, THERE)
    missions.step(np.zeros((1, 2, 5)), np.zeros((1, 2), np.int64))
    robots = missions.state.robots[0]
    sent = robots["messages_sent"]
    assert (sent > 0).all() and (robots["messages_lost"] == 0).all()
    assert robots["messages_received"].tolist() == (sent[::-1] if heard else 0 * sent).tolist()
    assert robots["messages_out_of_range"].tolist() == (0 * sent if heard else sent).tolist()
    assert (missions.state.heard[0]["heard_s"][[0, 1], [1, 0]] >= 0.0).tolist() == [heard, heard]

"""What the page of scale says of clusters, with the clock and the load of the machine by hand."""

from __future__ import annotations

import pytest

from benchmarks import scale


@pytest.mark.parametrize(("load", "gain"), [(0.1, "1.90 ×"), (7.25, "not measured: 7.2 other processes")])
def test_two_workers_are_compared_on_an_idle_machine_only(monkeypatch, load, gain):
    seconds = {(scale.sleep, 8): 8.8, (scale.play, 1): 19.0, (scale.play, 2): 10.0}
    asked = []

    def wall_s(work, tasks, workers):
        asked.append((work.__name__, len(tasks), workers))
        return seconds[work, workers]

    monkeypatch.setattr(scale, "wall_s", wall_s)
    monkeypatch.setattr(scale.os, "getloadavg", lambda: (load, 0.0, 0.0))
    rows = scale.cluster_rows(3)
    assert rows[0] == ("8 workers, 64 tasks that sleep 1 s", "busy", "90.9%")
    assert rows[1][:2] == ("12 missions of the room, 2 workers instead of 1", "faster")
    assert rows[1][2].startswith(gain)
    assert asked == [("sleep", 64, 8), *([("play", 12, 1), ("play", 12, 2)] if load < 0.5 else [])]
    page = scale.page([scale.Cost("a", 2_000, 4.0, 8.0, 700)], rows, "make it")
    assert "| a | 2,000 | 4,000 | 2.00 | 0 |" in page and gain in page

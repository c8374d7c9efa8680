"""Rocha04: its cells, and its page from end to end, in a tiny box."""

from __future__ import annotations

import pytest

from baselines.papers.rocha04 import EXPERIMENT, sweep
from entropy_explore_env.settings.changes import with_settings
from entropy_explore_env.settings.scenarios import BOX
from tests.baselines.papers.pages import cells_of, run_paper


def test_the_command_writes_its_page_and_goes_on_where_it_was(tmp_path, capsys, monkeypatch):
    tiny = with_settings(BOX, {"ending": {"sigma_end": 1.0}, "time_limit_s": 200.0})
    monkeypatch.setattr(sweep, "ROOM", tiny)
    ran = run_paper("rocha04", tmp_path, capsys, "--seeds", "2")
    assert len(ran.claims) == 49 and not ran.claims["H0"]["holds"]
    assert ran.claims["H0"]["ours"] == pytest.approx(2677.3, abs=0.1)
    assert len(ran.rows) == 2 * len(cells_of(EXPERIMENT, 2))

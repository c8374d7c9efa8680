"""Rocha04: its cells, and its page from end to end, in a tiny box."""

from __future__ import annotations

import pytest

from baselines.experiments.trials import CellTrial
from baselines.papers.rocha04 import EXPERIMENT, sweep
from baselines.papers.rocha04.sweep import ALTERNATIVES, BURSTS, CHANGES, I_MINS, TEAMS, team_id
from entropy_explore_env.settings.changes import with_settings
from entropy_explore_env.settings.scenarios import BOX, ROOM
from tests.baselines.papers.pages import cells_of, run_paper


def test_the_cells_are_the_paper_s():
    cells = cells_of(EXPERIMENT, 30)
    assert len(cells) == 1 + 3 * 9 + 4 * len(ALTERNATIVES) + len(CHANGES)
    assert len({str(CellTrial(cell, 0).settings) for cell in cells.values()}) == len(cells)
    for name in ("single", "single-random"):
        assert cells[name].scenario.robots == 1 and cells[name].seeds == 30
    for robots in TEAMS:
        for burst in BURSTS:
            for i_min_bits in I_MINS:
                cell = cells[team_id(robots, burst, i_min_bits)]
                channel = cell.scenario.channel
                assert (cell.scenario.robots, channel.burst, channel.i_min_bits) == (
                    robots,
                    burst,
                    i_min_bits,
                )
                assert (cell.strategy, cell.seeds) == ("gradient", 30)
        assert cells[f"team-{robots}-random"].strategy == "random"
    assert (TEAMS, BURSTS, sorted(I_MINS)) == ((2, 3, 4), (32, 64, 128), [0.0291, 0.3219, 0.6215])
    assert all(team_id(1, burst, 0.3219) == "single" for burst in BURSTS)
    room = with_settings(ROOM, {"robots": 1})
    assert cells["single"].scenario == room
    for name in CHANGES:
        assert (cells[f"change-{name}"].scenario, cells[f"change-{name}"].strategy) != (room, "gradient")
    quick = cells_of(EXPERIMENT, 10, quick=True)
    assert len(quick) == len(cells) - len(CHANGES) and quick["single"].seeds == 30


def test_the_command_writes_its_page_and_goes_on_where_it_was(tmp_path, capsys, monkeypatch):
    tiny = with_settings(BOX, {"ending": {"sigma_end": 1.0}, "time_limit_s": 200.0})
    monkeypatch.setattr(sweep, "ROOM", tiny)
    ran = run_paper("rocha04", tmp_path, capsys, "--seeds", "2")
    assert len(ran.claims) == 49 and not ran.claims["H0"]["holds"]
    assert ran.claims["H0"]["ours"] == pytest.approx(2677.3, abs=0.1)
    assert "One thing changed" in ran.page and len(ran.rows) == 2 * len(cells_of(EXPERIMENT, 2))
    quick = run_paper("rocha04", tmp_path / "quick", capsys, "--quick", "--seeds", "1")
    assert "One thing changed" not in quick.page

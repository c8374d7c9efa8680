"""`python -m baselines.papers.sujan`: cells, what is recorded scan by scan, claims, report and command."""

from __future__ import annotations

import csv
import json
import math

import numpy as np
import pytest
from PIL import Image

from baselines.cli.arguments import run_command
from baselines.experiments.cells import CellMission
from baselines.papers.sujan import __main__ as sujan
from baselines.papers.sujan import claims as sujan_claims
from baselines.papers.sujan import sweep
from baselines.papers.sujan.claims import all_claims, by_scan, mapped, mapped_per_metre
from baselines.papers.sujan.sweep import CHANGES, METHODS, OTHERS, cell_id, experiment, scenario_of


def test_the_cells_are_the_paper_s():
    cells = {cell.id: cell for cell in experiment(30, changes=True)}
    assert len(cells) == 2 * len(METHODS) + len(OTHERS) + len(CHANGES)
    assert len({cell.settings_digest for cell in cells.values()}) == len(cells)
    for robots, degrees, range_m in ((1, 90.0, 15.0), (2, 75.0, 10.0)):
        for method, strategy in METHODS.items():
            cell = cells[cell_id(robots, method)]
            sensor = cell.scenario.sensor
            assert (cell.strategy, cell.scenario.robots, cell.seeds) == (strategy, robots, 30)
            assert math.degrees(sensor.field_of_view_rad[0]) == pytest.approx(degrees)
            assert sensor.max_range_m == range_m
            starts = np.array(cell.surroundings.settings()["every_reset"]["starts"])  # type: ignore[union-attr]
            assert starts.mean(axis=0)[:2] == pytest.approx([50.0, 50.0])
    assert {cell.id for cell in experiment(30, changes=False)} < set(cells)


def test_a_mission_records_what_is_mapped_and_driven_scan_by_scan(monkeypatch):
    monkeypatch.setattr(sweep, "SCANS", 12)
    cell = next(cell for cell in experiment(1, changes=False) if cell.id == cell_id(2, "iii"))
    record = CellMission(cell, 0).run().record
    shares, ways = record["mapped"], record["driven_m_by_scan"]
    assert len(shares) == len(ways) == record["scans"] + 1 and shares[0] == ways[0] == 0.0
    assert shares == sorted(shares) and ways == sorted(ways)
    assert ways[-1] == pytest.approx(record["distance_m"], abs=0.02) and 0.02 < shares[-1] < 1.0
    assert scenario_of(2).ending.max_cycles == 12


def records_of(curves):
    """Records with these (shares, ways) by cell, the same in three worlds but for a little."""
    return {
        cell: [
            {"mapped": [s * (1 + 0.01 * world) for s in shares], "driven_m_by_scan": list(ways)}
            for world in range(3)
        ]
        for cell, (shares, ways) in curves.items()
    }


def test_claims_by_hand(monkeypatch):
    """(v) maps twice what the others do, on the same way; random poses drive ten times as far."""
    monkeypatch.setattr(sujan_claims.by_scan, "__defaults__", (3,))
    curves = {}
    for robots in (1, 2):
        for method in METHODS:
            high = 0.4 if method == "v" else 0.2
            way = 1000.0 if method == "i" else 110.0 if method == "v" else 100.0
            curves[cell_id(robots, method)] = ([0.0, 0.1, high], [0.0, 0.5 * way, way])
    records = records_of(curves)
    np.testing.assert_allclose(by_scan(records, cell_id(1, "v"), "mapped", 3)[0], [0.0, 0.1, 0.4, 0.4])
    assert mapped(records, cell_id(1, "v"))[0] == pytest.approx(0.3)
    assert mapped_per_metre(records, cell_id(1, "i"))[0] == pytest.approx(0.02)
    claims = {claim.id: claim for claim in all_claims(records)}
    assert len(claims) == 2 * (4 + 2 + 4 + 3 + 1)
    assert claims["most-1-iii"].ours == pytest.approx(0.3 / (0.5 / 3.0)) and claims["most-1-iii"].holds
    assert not claims["order-2-iii"].holds  # the same: not more
    assert claims["worst-1-ii"].ours == pytest.approx(0.1) and claims["worst-1-ii"].holds
    assert claims["way-2"].ours == pytest.approx(1.1) and claims["way-2"].holds


def test_the_command_writes_its_page_and_goes_on_where_it_was(tmp_path, capsys, monkeypatch):
    monkeypatch.setattr(sweep, "SCANS", 10)
    for module in (
        sujan_claims,
        *(__import__(f"baselines.papers.sujan.{m}", fromlist=["x"]) for m in ("figures", "report")),
    ):
        monkeypatch.setattr(module, "SCANS", 10)
    monkeypatch.setattr(sujan_claims.by_scan, "__defaults__", (10,))
    words = [
        "--quick",
        "--starts",
        "1",
        "--jobs",
        "1",
        "--json",
        "--out",
        str(tmp_path),
        "--runs",
        str(tmp_path / "r"),
    ]
    monkeypatch.setattr("sys.argv", ["sujan", *words])
    assert run_command(sujan.main) == 0
    printed = json.loads(capsys.readouterr().out)
    assert printed["paper"] == "Sujan" and len(printed["claims"]) == 28
    page = (tmp_path / "sujan.md").read_text()
    assert "python -m baselines.papers.sujan --quick --starts 1" in page and "(v) next-best-view" in page
    for name in ("figure-20", "figure-22"):
        with Image.open(tmp_path / "sujan" / f"{name}.png") as picture:
            assert picture.width > 800
        with (tmp_path / "sujan" / f"{name}.csv").open() as file:
            rows = list(csv.DictReader(file))
        assert len(rows) == 5 * 3 and {row["method"] for row in rows} == set(METHODS.values())
    times = {path: path.stat().st_mtime_ns for path in (tmp_path / "r").rglob("*.json")}
    assert run_command(sujan.main) == 0
    assert times and times == {path: path.stat().st_mtime_ns for path in (tmp_path / "r").rglob("*.json")}

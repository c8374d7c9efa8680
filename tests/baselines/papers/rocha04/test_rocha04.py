"""`python -m baselines.papers.rocha04`: cells, report and command."""

from __future__ import annotations

import contextlib
import csv
import io
import json
import re
from pathlib import Path
from typing import NamedTuple

import numpy as np
import pytest
from PIL import Image

from baselines.cli.arguments import run_command
from baselines.experiments import runner
from baselines.experiments.claims import Claim
from baselines.experiments.outcome import Record
from baselines.papers.rocha04 import __main__ as rocha04
from baselines.papers.rocha04 import report as rocha04_report
from baselines.papers.rocha04 import sweep as rocha04_cells
from baselines.papers.rocha04.sweep import ALTERNATIVES, BURSTS, CHANGES, I_MINS, TEAMS, team_id
from baselines.papers.rocha04.sweep import experiment as cells_of
from entropy_explore_env.scenario import with_settings
from entropy_explore_env.scenarios import BOX, ROOM

CLAIM = ("id", "claim", "paper", "ours", "low", "high", "holds")
FIGURES = [f"figure-{number}" for number in range(3, 9)]


# --- the cells


def test_the_cells_are_the_paper_s():
    cells = {cell.id: cell for cell in cells_of(30, 100, changes=True)}
    assert len(cells) == 1 + 3 * 9 + 4 * len(ALTERNATIVES) + len(CHANGES)
    assert len({cell.settings_digest for cell in cells.values()}) == len(cells)
    for name in ("single", "single-random"):
        assert cells[name].scenario.robots == 1 and cells[name].seeds == 100
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
    assert len(cells_of(30, 100, changes=False)) == len(cells) - len(CHANGES)


# --- the command, from end to end, in a tiny box


class Tiny(NamedTuple):
    """All cells in the tiny box, two starts each, and how the command ended that ran them."""

    folder: Path
    words: list[str]
    code: int
    out: str
    err: str


@pytest.fixture(scope="module")
def tiny(tmp_path_factory):
    folder = tmp_path_factory.mktemp("rocha04")
    scenario = with_settings(BOX, {"ending": {"sigma_end": 1.0}, "time_limit_s": 200.0})
    words = ["--starts", "2", "--jobs", "2", "--runs", str(folder / "runs"), "--out", str(folder / "out")]
    out, err = io.StringIO(), io.StringIO()
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(rocha04_cells, "ROOM", scenario)
        patch.setattr(rocha04, "_QUICK_STARTS", 2)
        patch.setattr(rocha04, "_QUICK_SINGLE_STARTS", 2)
        with contextlib.redirect_stdout(out), contextlib.redirect_stderr(err):
            code = run_command(rocha04.main, [*words, "--json", "--strict"])
        yield Tiny(folder, words, code, out.getvalue(), err.getvalue())


@pytest.fixture
def no_process(monkeypatch):
    """All missions are there: none must be run again."""

    def nothing_to_do(_: object, tasks: list, *__: object) -> list:
        assert not tasks, "missions were run"
        return []

    monkeypatch.setattr(runner, "run_each", nothing_to_do)


def ran(words: list[str], capsys) -> tuple[int, str, str]:
    code = run_command(rocha04.main, words)
    return (code, *capsys.readouterr())


def test_json_is_one_object_with_the_claims(tiny):
    assert (tiny.code, tiny.err) == (1, "")  # strict, and not the paper's room: its H(0) does not hold
    printed = json.loads(tiny.out, parse_constant=pytest.fail)
    assert list(printed) == ["paper", "claims", "wall_s"]
    assert printed["paper"] == "Rocha04" and printed["wall_s"] > 0.0
    assert all(tuple(claim) == CLAIM and isinstance(claim["holds"], bool) for claim in printed["claims"])
    by_id = {claim["id"]: claim for claim in printed["claims"]}
    assert len(by_id) == len(printed["claims"]) > 30
    assert not by_id["H0"]["holds"] and by_id["H0"]["ours"] == pytest.approx(2677.3, abs=0.1)


def test_every_mission_is_kept_and_the_report_is_whole(tiny):
    assert [path for path in tiny.folder.rglob(".*")] == []
    kept = list((tiny.folder / "runs").rglob("seed-*.json"))
    assert len(kept) == 2 * len(cells_of(2, 2, changes=True))
    check_report(tiny.folder / "out", quick=False)


def check_report(folder: Path, quick: bool) -> None:
    assert sorted(path.name for path in folder.iterdir()) == ["rocha04", "rocha04.md"]
    beside = folder / "rocha04"
    wanted = [
        *(f"{name}.{kind}" for name in FIGURES for kind in ("png", "csv")),
        "table-1.csv",
        "table-2.csv",
    ]
    assert sorted(path.name for path in beside.iterdir()) == sorted(wanted)
    for name in FIGURES:
        with Image.open(beside / f"{name}.png") as picture:
            picture.load()
            assert picture.format == "PNG" and min(picture.size) > 300
    for path in beside.glob("*.csv"):
        head, *rows = csv.reader(path.read_text().splitlines())
        assert rows and len(set(head)) == len(head)
        assert all(len(row) == len(head) for row in rows)
    report = (folder / "rocha04.md").read_text()
    linked = re.findall(r"\]\(([^)]+)\)", report)
    assert sorted(linked) == sorted(f"rocha04/{name}.png" for name in FIGURES)
    assert "## Claims" in report and "nan" not in report.split()
    assert ("One thing changed" in report) != quick
    assert ("--quick" in report) == quick


def rows_of(path: Path) -> list[dict[str, str]]:
    with path.open() as file:
        return list(csv.DictReader(file))


def contents(folder: Path) -> dict[str, bytes]:
    return {str(path.relative_to(folder)): path.read_bytes() for path in folder.rglob("*") if path.is_file()}


def test_a_finished_experiment_is_not_run_again_and_says_the_same(
    tiny, no_process, capsys, monkeypatch, tmp_path
):
    monkeypatch.setenv("COLUMNS", "200")
    code, out, err = ran([*tiny.words, "--out", str(tmp_path)], capsys)
    assert code == 0
    assert "H(0) in bits" in out and "95 % interval" in out
    assert "written" in err and "H(0)" not in err
    before, here = str(tiny.folder / "out").encode(), str(tmp_path).encode()  # the report names its command
    assert contents(tmp_path) == {
        name: content.replace(before, here) for name, content in contents(tiny.folder / "out").items()
    }


def test_the_tables_hold_the_records_numbers(tiny):
    beside = tiny.folder / "out" / "rocha04"

    def kept(cell: str) -> list[Record]:
        return [
            json.loads(path.read_text())["record"] for path in sorted((tiny.folder / "runs" / cell).iterdir())
        ]

    for name, line, cells in (
        ("figure-5", "burst 32", [team_id(robots, 32, 0.3219) for robots in (1, 2, 3, 4)]),
        ("figure-6", "I_min 0.0291", [team_id(robots, 64, 0.0291) for robots in (1, 2, 3, 4)]),
    ):
        rows = [row for row in rows_of(beside / f"{name}.csv") if row["line"] == line]
        assert [int(row["robots"]) for row in rows] == [1, 2, 3, 4]
        for row, cell in zip(rows, cells, strict=True):
            mean = np.mean([record["t_mission_s"] for record in kept(cell)])
            assert float(row["mean_s"]) == pytest.approx(mean, abs=0.01)
            assert float(row["low_s"]) <= float(row["mean_s"]) <= float(row["high_s"])
    series = rows_of(beside / "figure-3.csv")
    ends = [record["t_mission_s"] for record in kept("single")]
    assert float(series[-1]["time_s"]) == pytest.approx(
        max(ends), abs=1e-3
    )  # of two, the median is the second
    shared = [row for row in rows_of(beside / "figure-7.csv") if row["line"] == "burst 128"]
    assert int(shared[0]["shared_measurements"]) == 0 < int(shared[-1]["shared_measurements"])
    table = {row["parameter"]: row["ours"] for row in rows_of(beside / "table-1.csv")}
    assert (table["voxels"], table["search radius (m)"], table["prior sigma"]) == ("41x41x17", "0.5", "30.0")


def test_quick_leaves_out_the_changes(tiny, no_process, capsys, tmp_path):
    code, out, err = ran([*tiny.words, "--out", str(tmp_path), "--quick", "--json"], capsys)
    assert (code, err) == (0, "")
    ids = {claim["id"] for claim in json.loads(out)["claims"]}
    assert {"H0", "single-t_mission", "team-size-64-0.3219"} <= ids
    check_report(tmp_path, quick=True)


@pytest.mark.parametrize(("holds", "code"), [(True, 0), (False, 1)])
def test_strict_asks_whether_all_claims_hold(holds, code, tiny, no_process, capsys, monkeypatch, tmp_path):
    claims = [Claim("a", "is", 1.0, 1.0, None, None, True), Claim("b", "is", 1.0, 2.0, 1.0, 3.0, holds)]
    monkeypatch.setattr(rocha04, "all_claims", lambda records: claims)
    monkeypatch.setattr(rocha04_report, "write_report", lambda *_: tmp_path / "report.md")
    assert ran([*tiny.words, "--strict", "--json"], capsys)[0] == code
    assert ran([*tiny.words, "--json"], capsys)[0] == 0


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["--starts", "0"], ["starts", "0"]),
        (["--jobs", "-1"], ["jobs", "-1"]),
        (["--starts", "many"], ["--starts", "many"]),
        (["--frobnicate"], ["--frobnicate"]),
        (["room"], ["room"]),
    ],
)
def test_bad_input_is_one_line_and_code_2(words, said, capsys):
    code, out, err = ran(words, capsys)
    assert (code, out) == (2, "")
    assert err.startswith("error: ") and err.count("\n") == 1 and all(word in err for word in said)


def test_an_interrupted_experiment_ends_with_130(capsys, monkeypatch, tmp_path):
    def interrupted(*_: object, **__: object) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr(rocha04, "run_cells", interrupted)
    assert ran(["--runs", str(tmp_path), "--out", str(tmp_path)], capsys) == (130, "", "interrupted\n")
    assert list(tmp_path.iterdir()) == []


def test_a_folder_that_cannot_be_made_is_refused_before_the_missions(capsys, monkeypatch, tmp_path):
    def must_not_run(*_: object, **__: object) -> None:
        raise AssertionError("the missions ran")

    monkeypatch.setattr(rocha04, "run_cells", must_not_run)
    (tmp_path / "taken").write_text("mine")
    code, out, err = ran(["--out", str(tmp_path / "taken"), "--json"], capsys)
    assert (code, out) == (2, "") and err.count("\n") == 1 and "out" in err and "taken" in err

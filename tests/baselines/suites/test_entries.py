"""Entries: written, checked without the strategy, and refused where a row or a record was changed."""

from __future__ import annotations

import json
import shutil
from dataclasses import replace

import pytest

from baselines import benchmark, suites
from baselines.cli.arguments import run_command
from baselines.experiments.rows import read_table, write_table
from baselines.suites.entries import ROWS, check_entry, record_file
from baselines.suites.page import entries_table
from baselines.suites.suite import Suite, task_in
from entropy_explore_env.errors import SettingError
from entropy_explore_env.reports.mission_record import load_record, save_record
from entropy_explore_env.settings.scenarios import BOX

CELL = "box/gradient"
WORDS = ("--suite", "tiny", "--strategies", "gradient", "--author", "A. Name", "--jobs", "1")


def tiny_suite(quick):
    task = task_in("box", BOX, 1 if quick else 3, ending={"time_limit_s": 8.0})
    return Suite("tiny", "Tiny", (task,), ("random",))


@pytest.fixture(autouse=True)
def tiny(monkeypatch):
    monkeypatch.setitem(suites.SUITES, "tiny", tiny_suite)


@pytest.fixture(scope="module")
def written(tmp_path_factory):
    folder = tmp_path_factory.mktemp("entries") / "mine"
    with pytest.MonkeyPatch.context() as patch:
        patch.setitem(suites.SUITES, "tiny", tiny_suite)
        stopped = [*WORDS, "--entry", str(folder), "--stop-after-s", "0"]
        assert run_command(benchmark.main, stopped) == 0 and not (folder / ROWS).exists()
        assert run_command(benchmark.main, stopped[:-2]) == 0
    return folder


@pytest.fixture
def entry(written, tmp_path):
    return shutil.copytree(written, tmp_path / "entries" / "mine")


def faults(folder):
    return [(cell, seed, fault) for cell, seed, fault in check_entry(folder, 1)[1] if fault]


def change_row(folder, seed, change):
    rows = read_table(folder / ROWS)
    (number,) = (number for number, row in enumerate(rows) if row.seed == seed)
    rows[number : number + 1] = change(rows[number])
    write_table(folder / ROWS, rows)


def test_an_entry_holds_what_the_suite_asks_for_and_is_checked_without_the_strategy(
    entry, monkeypatch, capsys
):
    assert [(row.cell, row.seed) for row in read_table(entry / ROWS)] == [(CELL, seed) for seed in range(3)]
    assert sorted(path.name for path in entry.iterdir()) == ["entry.json", "missions", ROWS]
    monkeypatch.setattr("baselines.strategies.make_strategy", None)
    monkeypatch.setattr("baselines.experiments.mission.make_strategy", None)
    assert run_command(benchmark.main, ["--check", str(entry), "--jobs", "1"]) == 0
    assert capsys.readouterr().out == "gradient in suite tiny, by A. Name\n3 of 3 rows hold\n"
    assert json.loads((entry / "check.json").read_text())["held"] == 3
    shown = entries_table(entry.parent)
    assert "| [`gradient`](scoreboard/entries/mine) | A. Name | tiny |" in shown and "| yes |" in shown


def test_a_changed_digit_is_found(entry, capsys):
    def longer(row):
        return [replace(row, record={**row.record, "t_mission_s": row.record["t_mission_s"] + 1e-6})]

    change_row(entry, 1, longer)
    ((cell, seed, fault),) = faults(entry)
    assert (cell, seed) == (CELL, 1) and fault.startswith("t_mission_s is ")
    assert run_command(benchmark.main, ["--check", str(entry), "--jobs", "1", "--json"]) == 1
    assert json.loads(capsys.readouterr().out)["faults"] == [[CELL, 1, fault]]
    assert "| 2 of 3 rows |" in entries_table(entry.parent)


def test_missing_rows_rows_too_many_and_other_settings_are_found(entry):
    change_row(entry, 0, lambda row: [])
    change_row(entry, 1, lambda row: [row, replace(row, seed=7)])
    other = {"scenario": {"kind": "Scenario"}}
    change_row(entry, 2, lambda row: [replace(row, settings={**row.settings, **other})])
    assert faults(entry) == [
        (CELL, 0, "the row is missing"),
        (CELL, 2, "the row has other settings than the suite"),
        (CELL, 7, "no mission of the suite has this row"),
    ]


def test_a_second_row_of_a_mission_and_figures_of_failed_ones_are_found(entry):
    def failed(row):
        return replace(row, record={"failed": "ran past 600 s", "trace": "", "limit_s": 600.0})

    def forged(row):
        return replace(failed(row), record={**failed(row).record, "finished": True, "t_mission_s": 1.0})

    change_row(entry, 0, lambda row: [replace(row, settings={**row.settings, "strategy_files": []}), row])
    change_row(entry, 1, lambda row: [failed(row)])
    change_row(entry, 2, lambda row: [forged(row)])
    assert faults(entry) == [
        (CELL, 0, "the mission has another row, too"),
        (CELL, 2, "a failed mission has no finished"),
    ]
    change_row(entry, 1, lambda row: [replace(row, seed="1")])
    with pytest.raises(SettingError, match="a row with the fields"):
        check_entry(entry, 1)


@pytest.mark.parametrize("name", ["theirs.py:Mine", "their_package.module:Mine", "their_module:Mine"])
def test_an_entry_whose_strategy_is_not_here_is_shown(entry, name):
    about = json.loads((entry / "entry.json").read_text())
    (entry / "entry.json").write_text(json.dumps({**about, "strategies": [name]}))
    theirs = {"strategy": name, "strategy_files": [["theirs.py", "0123456789abcdef"]]}
    rows = [
        replace(row, cell=f"box/{name}", settings={**row.settings, **theirs})
        for row in read_table(entry / ROWS)
    ]
    write_table(entry / ROWS, rows)
    assert "| [`Mine`](scoreboard/entries/mine) | A. Name | tiny | 1 | 3 |" in entries_table(entry.parent)


def test_changed_actions_records_of_other_worlds_and_broken_ones_are_found(entry):
    first, second, third = (record_file(entry, CELL, seed) for seed in range(3))
    record = load_record(first)
    commands = record.commands.copy()
    commands[0, 0, 0] += 0.25
    save_record(replace(record, commands=commands), first)
    shutil.copy(third, second)
    third.write_bytes(third.read_bytes()[:-40])
    found = [fault for _, _, fault in faults(entry)]
    assert len(found) == 3 and "whole .npz" in found[2]
    ended = ("the record's commands lead to another end", "the record's commands do not end with the mission")
    assert found[0].startswith(ended) and found[1].startswith(ended)


def test_a_record_that_is_cut_short_does_not_end_its_mission(entry):
    file = record_file(entry, CELL, 0)
    record = load_record(file)
    save_record(replace(record, commands=record.commands[:-1]), file)
    assert faults(entry) == [(CELL, 0, "the record's commands do not end with the mission")]


@pytest.mark.parametrize(
    ("words", "said"),
    [
        ((*WORDS[:4], "--entry", "mine"), "entry = .*--author"),
        (("--strategies", "gradient", "--author", "A", "--entry", "mine"), "entry = .*--suite"),
        ((*WORDS, "--entry", "mine", "--cite", "there"), "cite = .*no value beside --entry"),
        (("--check", "nowhere"), "entry = .*nowhere.*folder of an entry"),
        (("--check", "nowhere", "--suite", "tiny"), "suite = 'tiny': expected no value beside --check"),
        (("--world-scenario", "office", "--scenarios", "room"), "world_scenario = 'office'.*without --world"),
    ],
)
def test_what_is_no_entry_is_refused_by_name(words, said, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    with pytest.raises(SettingError, match=said):
        benchmark.main(words)
    assert not list(tmp_path.iterdir())


def test_the_folder_of_another_entry_and_other_forms_are_refused(entry):
    other = [*WORDS[:3], "random", *WORDS[4:], "--entry", str(entry)]
    with pytest.raises(SettingError, match=r"strategies = .*'gradient'"):
        benchmark.main(other)
    about = json.loads((entry / "entry.json").read_text())
    for change, said in (({"form": 2}, "form 1"), ({"author": 3}, "--entry writes")):
        (entry / "entry.json").write_text(json.dumps({**about, **change}))
        with pytest.raises(SettingError, match=said):
            check_entry(entry, 1)

"""Experiments: resumable, the same whatever the number of processes."""

from __future__ import annotations

import dataclasses
import json
import pickle
from pathlib import Path

import numpy as np
import pytest

from baselines.experiments import runner
from baselines.experiments.cells import Cell, CellMission, run_cells
from baselines.experiments.mission import mission_record, scripted
from baselines.experiments.runner import failed_record
from baselines.experiments.worker_pool import Failure
from entropy_explore_env.envs.parallel_env import EntropyExploreEnv
from entropy_explore_env.errors import MissingExtraError, WorldError
from entropy_explore_env.reports.metrics import mission_figures
from entropy_explore_env.reports.recording import Recorder
from entropy_explore_env.scenario import with_settings
from entropy_explore_env.scenarios import BOX

SHORT = with_settings(BOX, {"time_limit_s": 30.0})
CELLS = (Cell("walk", SHORT, "random", 7), Cell("steep", SHORT, "gradient", 2))


# --- running


def record_file(folder: Path, cell: str, seed: int) -> Path:
    return folder / cell / f"seed-{seed}.json"


def kept_under(cell: Cell) -> str:
    return runner.result_digest(CellMission(cell, 0), cell.code_digest())


def kept_record(folder: Path, cell: Cell, seed: int) -> dict | None:
    return runner.read_record(folder, CellMission(cell, seed), cell.code_digest())


def stamps(folder: Path) -> dict[Path, tuple[int, int]]:
    """File → its number on the disk and when it was written: other numbers mean that it is another."""
    return {
        path: (path.stat().st_ino, path.stat().st_mtime_ns) for path in folder.rglob("*") if path.is_file()
    }


@pytest.fixture(scope="module")
def finished(tmp_path_factory):
    """An experiment that two processes ran, and its records."""
    folder = tmp_path_factory.mktemp("experiment")
    return folder, run_cells(CELLS, folder, 2, "test", quiet=True)


def test_records_are_those_of_the_missions_by_seed(finished):
    folder, records = finished
    assert {cell: len(found) for cell, found in records.items()} == {"walk": 7, "steep": 2}
    assert sorted(stamps(folder)) == sorted(
        record_file(folder, cell.id, seed) for cell in CELLS for seed in range(cell.seeds)
    )
    env = EntropyExploreEnv(scripted(SHORT))
    for cell in CELLS:
        assert [record["seed"] for record in records[cell.id]] == list(range(cell.seeds))
        for seed in (0, cell.seeds - 1):
            assert mission_record(env, cell.strategy, seed) == records[cell.id][seed]
    assert [path for path in folder.rglob(".*")] == []


def test_a_stopped_experiment_runs_exactly_what_is_missing(finished, tmp_path):
    """Files deleted, cut off, emptied, of other settings, and one more seed: by one process, all the same."""
    source, records = finished
    folder = tmp_path / "copy"
    for path in stamps(source):
        copy = folder / path.relative_to(source)
        copy.parent.mkdir(parents=True, exist_ok=True)
        copy.write_bytes(path.read_bytes())
    missing = {("walk", 1), ("walk", 3), ("walk", 4), ("walk", 6), ("steep", 1)}
    record_file(folder, "walk", 1).unlink()
    cut = record_file(folder, "walk", 3)
    cut.write_bytes(cut.read_bytes()[:-40])
    other = record_file(folder, "walk", 4)
    other.write_text(json.dumps({**json.loads(other.read_text()), "digest": "0123456789abcdef"}))
    record_file(folder, "walk", 6).write_bytes(b"")
    record_file(folder, "steep", 1).write_bytes(b"\xff\xfe\x00")
    before = stamps(folder)
    again = run_cells((CELLS[0], dataclasses.replace(CELLS[1], seeds=3)), folder, 1, "test", quiet=True)
    assert again["walk"] == records["walk"] and again["steep"][:2] == records["steep"]
    assert again["steep"][2] == mission_record(EntropyExploreEnv(scripted(SHORT)), "gradient", 2)
    after = stamps(folder)
    changed = {path for path in after if after[path] != before.get(path)}
    assert changed == {record_file(folder, *each) for each in missing | {("steep", 2)}}
    for cell, seed in missing:
        assert record_file(folder, cell, seed).read_bytes() == record_file(source, cell, seed).read_bytes()


def test_a_finished_experiment_runs_nothing(finished, monkeypatch, capsys):
    folder, records = finished

    def nothing_to_do(_: object, tasks: list, *__: object) -> list:
        assert not tasks, "missions were run"
        return []

    monkeypatch.setattr(runner, "run_each", nothing_to_do)
    before = stamps(folder)
    assert run_cells(CELLS, folder, 2, "test", quiet=True) == records
    assert capsys.readouterr() == ("", "")
    assert run_cells(CELLS, folder, 2, "the title", quiet=False) == records
    out, err = capsys.readouterr()
    assert out == "" and "the title" in err and "9/9" in err
    fewer = run_cells([dataclasses.replace(CELLS[0], seeds=3)], folder, 2, "test", quiet=True)
    assert fewer == {"walk": records["walk"][:3]}
    assert stamps(folder) == before
    changed = [dataclasses.replace(CELLS[0], strategy="gradient")]
    with pytest.raises(AssertionError, match="missions were run"):
        run_cells(changed, folder, 2, "test", quiet=True)


@pytest.mark.parametrize("content", ["[]", "null", "3", '{"digest": "DIGEST"}'])
def test_json_that_is_no_record_counts_as_missing(content, tmp_path):
    path = record_file(tmp_path, "walk", 0)
    path.parent.mkdir()
    path.write_text(content.replace("DIGEST", kept_under(CELLS[0])))
    assert kept_record(tmp_path, CELLS[0], 0) is None


def test_a_mission_leaves_its_file_before_the_next_begins(tmp_path):
    """So an interruption costs one mission."""
    seen = []

    def record(env, strategy, seed):
        seen.append(sorted(path.name for path in tmp_path.rglob("*.json")))
        if seed == 2:
            raise KeyboardInterrupt
        return mission_record(env, strategy, seed)

    with pytest.raises(KeyboardInterrupt):
        run_cells([dataclasses.replace(CELLS[0], record=record)], tmp_path, 1, "test", quiet=True)
    assert seen == [[], ["seed-0.json"], ["seed-0.json", "seed-1.json"]]
    assert len(list(tmp_path.rglob("*"))) == 3  # the cell's folder and two files


def test_missions_of_all_cells_take_turns(tmp_path):
    """So the time left is told from all of them."""
    order = []

    def record(env, strategy, seed):
        order.append((strategy, seed))
        return {}

    cells = [dataclasses.replace(cell, record=record) for cell in CELLS]
    run_cells(cells, tmp_path, 1, "test", quiet=True)
    assert order[:5] == [("random", 0), ("gradient", 0), ("random", 1), ("gradient", 1), ("random", 2)]
    assert len(order) == 9


def test_who_finishes_none_of_the_first_missions_is_not_run_further(tmp_path):
    """Neither in this cell nor in others of its group, also where a stopped experiment goes on."""

    def record(env, strategy, seed):
        if strategy == "raster":
            raise RuntimeError("cannot act here")
        return {"finished": strategy == "gradient" and seed == 1}

    names = ("random", "gradient", "raster")
    cells = [Cell(name, SHORT, name, 4, record) for name in names]
    cells.append(Cell("random-later", SHORT, "random", 2, record, round=4, group="random"))
    kept = {"quiet": True, "keep_failures": True}
    first = run_cells(cells, tmp_path, 1, "test", tries=2, **kept)
    not_run = {name: [record == runner.NOT_RUN for record in records] for name, records in first.items()}
    assert not_run["random"] == not_run["raster"] == [False, False, True, True]
    assert not_run["gradient"] == [False] * 4 and not_run["random-later"] == [True, True]
    assert run_cells(cells, tmp_path, 1, "test", tries=2, **kept) == first
    everything = run_cells(cells, tmp_path, 1, "test", **kept)
    assert all(record != runner.NOT_RUN for records in everything.values() for record in records)


def test_a_record_changed_by_hand_is_run_again(finished, tmp_path):
    folder, records = finished
    path = record_file(tmp_path, "walk", 0)
    path.parent.mkdir()
    content = json.loads(record_file(folder, "walk", 0).read_text())
    path.write_text(json.dumps(content))
    assert kept_record(tmp_path, CELLS[0], 0) == records["walk"][0]
    content["record"]["scans"] -= 1
    path.write_text(json.dumps(content))
    assert kept_record(tmp_path, CELLS[0], 0) is None


@pytest.mark.parametrize("jobs", [1, 2])
def test_failures_are_records_where_they_are_kept(jobs, tmp_path):
    crowd = Cell("crowd", with_settings(SHORT, {"robots": 900}), "random", 2)
    few = dataclasses.replace(CELLS[0], seeds=2)
    records = run_cells([crowd, few], tmp_path, jobs, "test", quiet=True, keep_failures=True)
    for record in records["crowd"]:
        assert record["failed"].startswith("WorldError: ") and "900" in record["failed"]
        assert record["limit_s"] is None and "cell.record(" in record["trace"]
    assert [record["seed"] for record in records["walk"]] == [0, 1]
    assert kept_record(tmp_path, crowd, 1) == records["crowd"][1]


def test_a_mission_ended_by_its_limit_is_run_again_under_a_longer_one_only(tmp_path):
    asked = []

    def record(env, strategy, seed):
        asked.append(seed)
        while len(asked) < 2:  # late the first time
            pass
        return {"seed": seed}

    cell = dataclasses.replace(CELLS[0], record=record, seeds=1)

    def run(limit_s):
        return run_cells([cell], tmp_path, 1, "test", True, limit_s, keep_failures=True)["walk"][0]

    late = {"failed": "ran past 0.3 s on the clock", "trace": "", "limit_s": 0.3}
    assert run(0.3) == late
    assert run(0.3) == run(0.2) == late and asked == [0]
    assert run(0.4) == {"seed": 0} and asked == [0, 0]
    assert run(0.1) == {"seed": 0} and asked == [0, 0]


def test_reasons_are_short_and_the_same_in_every_process():
    failure = Failure("TypeError: <Plan object at 0x7f12ab> " + "x" * 500)
    reason = failed_record(failure, 9.0)["failed"]
    assert reason.startswith("TypeError: <Plan object at 0x…> xxx") and len(reason) < 210
    assert failed_record(Failure("late", late=True), 9.0)["limit_s"] == 9.0


def test_an_error_in_a_process_comes_back_by_its_name(tmp_path):
    crowd = [Cell("crowd", with_settings(SHORT, {"robots": 900}), "random", 1)]
    for jobs in (1, 2):
        with pytest.raises(WorldError, match="900"):
            run_cells(crowd, tmp_path, jobs, "test", quiet=True)


def test_an_error_of_a_missing_package_comes_back_too():
    error = pickle.loads(pickle.dumps(MissingExtraError("octomap-python", "worlds")))
    assert isinstance(error, MissingExtraError) and "worlds" in str(error)


def test_the_digest_is_of_what_decides_the_results():
    cell, same = CELLS[0], kept_under(CELLS[0])
    assert kept_under(dataclasses.replace(cell, id="other", seeds=99)) == same
    unseen = with_settings(SHORT, {"decision_period_s": 3.0, "observation": {"patch": True}})
    assert kept_under(dataclasses.replace(cell, scenario=unseen)) == same
    assert kept_under(pickle.loads(pickle.dumps(cell))) == same
    others = [
        dataclasses.replace(cell, strategy="gradient"),
        *(
            dataclasses.replace(cell, scenario=with_settings(SHORT, changes))
            for changes in (
                {"robots": 3},
                {"time_limit_s": 31.0},
                {"channel": {"burst": 9}},
                {"sensor": {"voxels_behind": 0}},
                {"world": "furnished"},
            )
        ),
    ]
    assert len({same, *map(kept_under, others)}) == len(others) + 1


# --- what a record holds


@pytest.fixture(scope="module")
def whole():
    """A mission to its end: its record, and all of its moments."""
    env = EntropyExploreEnv(scripted(BOX))
    record = mission_record(env, "random", 1)
    recorders: list[Recorder] = []

    def note(env: EntropyExploreEnv) -> None:
        if not recorders:
            recorders.append(Recorder(env.missions))
        recorders[0].note()

    from baselines.experiments.mission import run_mission
    from baselines.strategies import make_strategy

    run_mission(env, make_strategy("random"), 1, note)
    return record, recorders[0], mission_figures(env.missions, 0)


def test_a_record_survives_json_and_holds_the_figures(whole):
    record, _, figures = whole
    assert json.loads(json.dumps(record, allow_nan=False)) == record
    assert {name: record[name] for name in figures} == figures
    assert record["finished"]


def test_half_s_is_when_the_best_map_had_lost_half(whole):
    record, moments, figures = whole
    middle = (figures["entropy_start_bits"] + figures["entropy_threshold_bits"]) / 2
    first = next(n for n, bits in enumerate(moments.entropy_bits) if min(bits) <= middle)
    assert record["half_s"] == moments.time_s[first]
    assert 0.0 < record["half_s"] < record["t_mission_s"]


def test_half_s_is_missing_where_half_was_never_lost():
    env = EntropyExploreEnv(scripted(BOX), time_limit_s=3.0)
    assert mission_record(env, "random", 1)["half_s"] is None


def test_series_run_from_start_to_end(whole):
    record, moments, figures = whole
    series = record["series"]
    assert len(series["time_s"]) == len(series["entropy_bits"]) == len(series["shared_measurements"]) <= 200
    assert series["time_s"][0] == 0.0
    assert series["time_s"][-1] == pytest.approx(figures["t_mission_s"], abs=1e-3)
    assert series["entropy_bits"][-1] == pytest.approx(figures["entropy_end_bits"], abs=0.1)
    assert series["shared_measurements"][-1] == figures["shared_measurements"]
    kept = np.searchsorted(moments.time_s, np.asarray(series["time_s"]) - 1e-3)
    np.testing.assert_allclose(moments.entropy_bits[kept].min(axis=1), series["entropy_bits"], atol=0.06)
    assert (moments.shared[kept] == series["shared_measurements"]).all()


def test_sent_by_scan_has_each_scan_of_a_single_robot_s_step(whole):
    record, moments, figures = whole
    batches = []
    for before, after in zip(range(len(moments.time_s) - 1), range(1, len(moments.time_s)), strict=True):
        if moments.scans[after] - moments.scans[before] == 1:
            batches.append(int(moments.shared[after] - moments.shared[before]))
    assert record["sent_by_scan"] == batches
    assert len(batches) == figures["scans"] and sum(batches) == figures["shared_measurements"]
    assert 0 <= min(batches) and max(batches) == BOX.channel.burst

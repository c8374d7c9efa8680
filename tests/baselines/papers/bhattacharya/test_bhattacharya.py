"""Bhattacharya: the belief and the simulation of its runs, and its page from end to end."""

from __future__ import annotations

import dataclasses
import math

import numpy as np
import pytest
from hypothesis import given

from baselines.experiments.trials import Trial
from baselines.papers import bhattacharya
from baselines.papers.bhattacharya import EXPERIMENT, sweep
from baselines.papers.bhattacharya.measured import split
from baselines.papers.bhattacharya.run import start_cells
from baselines.papers.bhattacharya.simulation.belief import GridBelief, Readings, Scanner
from baselines.papers.bhattacharya.simulation.team import Rules, Simulation
from baselines.papers.bhattacharya.sweep import FLOORS
from tests.baselines.papers.pages import run_paper
from tests.reference.scenes import drawn, seeds

SHAPE = (9, 13, 1)


def plan(seed, share=0.15, shape=(17, 23, 1)):
    return np.random.default_rng(seed).random(shape) < share


# --- the belief


def test_fusion_by_hand():
    """A cell read as 0.1 and as 0.3, by scans and by way of a buffer, is believed their mean."""
    one, other, buffer = GridBelief(SHAPE), GridBelief(SHAPE), Readings(math.prod(SHAPE))
    for read in (0.1, 0.3):
        scan = np.array([20], np.int32), np.array([read], np.float32)
        one.fuse_scan(scan)
        buffer.add(scan)
    other.fuse_readings(buffer)
    for belief in (one, other):
        assert belief.probability[20] == pytest.approx(0.2, rel=1e-5)
        assert (np.delete(belief.probability, 20) == 0.5).all()
    assert np.flatnonzero(buffer.times).tolist() == [20]
    buffer.clear()
    assert not buffer.total.any() and not buffer.times.any()


@given(seeds)
@drawn(20)
def test_entropies_are_filtered_only_where_they_may_change(seed):
    rng, belief = np.random.default_rng(seed), GridBelief(SHAPE)
    for _ in range(4):
        cells = rng.choice(math.prod(SHAPE), rng.integers(1, 9), replace=False).astype(np.int32)
        belief.fuse_scan((cells, rng.uniform(0.01, 0.99, len(cells)).astype(np.float32)))
    p = belief.probability.astype(float).reshape(SHAPE[:2])
    raw = -p * np.log(p) - (1 - p) * np.log(1 - p)
    for x, y in np.ndindex(*SHAPE[:2]):
        around = raw[max(x - 1, 0) : x + 2, max(y - 1, 0) : y + 2]
        assert belief.entropy[x, y, 0] == pytest.approx(around.min(), rel=1e-4)


def test_a_scan_sees_up_to_walls_and_reads_each_cell_once():
    occupied = np.zeros((21, 15, 1), bool)
    occupied[12] = True
    scanner = Scanner(occupied, 8.0)
    cells, read = scanner.scan(7 * 15 + 7)
    assert len(set(cells.tolist())) == len(cells)
    found = dict(zip(cells.tolist(), read.tolist(), strict=True))
    assert found[7 * 15 + 7] == pytest.approx(0.01)
    assert found[12 * 15 + 7] == pytest.approx(0.99 - 0.09 * 25 / 64)  # s(r) of sect. 5.3
    away = {c: math.hypot(c // 15 - 7, c % 15 - 7) for c in found}
    assert max(away.values()) <= 8.0 and not any(c // 15 > 12 for c in found)
    free = [c for c in range(21 * 15) if c // 15 < 12 and math.hypot(c // 15 - 7, c % 15 - 7) <= 7.0]
    assert set(free) <= set(found)


# --- the simulation


@pytest.mark.parametrize("control", ["projected-centroid", "gradient-search"])
def test_the_functional_of_guarded_robots_falls_until_they_converge(control):
    for seed in range(4):
        occupied = plan(seed)
        rules = Rules(control=control, keeps_targets=False)
        simulation = Simulation(occupied, start_cells(occupied, "random", 3, seed), rules, known=True)
        trace = simulation.run(400, 1)
        assert trace.ended == "converged"
        assert (np.diff(trace.functional) <= 1e-9 * np.array(trace.functional[:-1])).all()


def test_robots_step_to_free_neighbours_and_explore_all_that_can_be_reached():
    for seed, perfect in ((0, True), (1, True), (2, False)):
        occupied = plan(seed)
        starts = start_cells(occupied, "corner", 3, seed)
        rules = Rules(range_cells=6.0, perfect=perfect, phase=3)
        simulation = Simulation(occupied, starts, rules, seed=seed)
        trace = simulation.run(600)
        assert trace.ended == "converged" and trace.uncertain[-1] == 0
        places = np.array(trace.places)
        assert not occupied.reshape(-1)[places].any()
        steps = np.abs(np.diff(np.stack([places // 23, places % 23]), axis=1)).max(axis=0)
        assert steps.max() == 1
        for planner in simulation.planners:
            believed = planner.belief.occupied
            assert not believed[~occupied].any() and believed.any()


def test_a_phase_reaches_everybody_once_whatever_is_repeated():
    """Without loss all beliefs hold all readings but those that still wait."""
    occupied = plan(5)
    starts = start_cells(occupied, "random", 3, 5)
    simulation = Simulation(occupied, starts, Rules(range_cells=5.0, perfect=False, phase=4))
    for _ in range(9):  # swaps before iterations 0, 4 and 8: what was read in 0-7 is everywhere
        simulation.step(False)
    times = [planner.belief._readings.times.copy() for planner in simulation.planners]
    waiting = [buffer.times for buffer in simulation._sensing]
    common = [own - wait for own, wait in zip(times, waiting, strict=True)]
    np.testing.assert_array_equal(common[0], common[1])
    np.testing.assert_array_equal(common[0], common[2])
    assert common[0].sum() > 0 and waiting[0].sum() > 0


def test_lost_messages_come_again():
    occupied = plan(6)
    starts = start_cells(occupied, "random", 3, 6)
    rules = Rules(range_cells=5.0, perfect=False, phase=8, loss=0.6)
    simulation = Simulation(occupied, starts, rules, seed=1)
    for _ in range(16):
        simulation.step(False)
    assert simulation._received[~np.eye(3, dtype=bool)].all()  # whoever sent it has it anyway


# --- figure 4


def test_entropy_splits_a_band_evenly_and_length_does_not():
    assert split("band", 0.01).ratio == pytest.approx(1.0, abs=0.1)
    assert split("band", None).ratio < 0.3
    assert split("patch", 0.01).ratio < 0.5
    assert set(np.unique(split("band", 0.01).cells)) == {0, 1}


# --- the command


def without_missions(amount) -> list[Trial]:
    return [trial for trial in sweep.experiment(amount) if not trial.cell.startswith("channel")]


def test_the_command_writes_its_page_and_goes_on_where_it_was(tmp_path, monkeypatch, capsys):
    small = dataclasses.replace(FLOORS["small"], shape=(210, 170), limit=300, middle=60.0, ranges=(60.0,))
    monkeypatch.setitem(FLOORS, "small", small)
    tables = {**EXPERIMENT.tables, "channel": lambda records: "None were run."}
    fewer = dataclasses.replace(EXPERIMENT, trials=without_missions, tables=tables)
    monkeypatch.setattr(bhattacharya, "EXPERIMENT", fewer)
    ran = run_paper("bhattacharya", tmp_path, capsys, "--quick", "--seeds", "1")
    assert ran.claims["scipy"]["ours"] > 0.0 and "split-band" in ran.claims
    (measured,) = [row.record for row in ran.rows if row.cell == "measured"]
    assert set(measured["splits"]) == {"band", "patch"}

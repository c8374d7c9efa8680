"""Sawhney: cells, claims, the model of real ground, page."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
from matplotlib import cbook

from baselines.experiments.experiment import Amount
from baselines.experiments.trials import Cell, CellTrial, trials_of
from baselines.papers import sawhney
from baselines.papers.sawhney import EXPERIMENT, sweep
from baselines.papers.sawhney.claims import all_claims, best_beta, compared, relative
from baselines.papers.sawhney.mission import model_file
from baselines.papers.sawhney.sweep import PLANS
from entropy_explore_env.settings.changes import with_settings
from entropy_explore_env.settings.grid import Grid
from entropy_explore_env.worlds.load import load_world
from tests.baselines.papers.pages import cells_of, run_paper


def synthetic(values, seeds=6):
    """Records of the quick experiment with times that a function of world, team and method gives."""
    rng, records = np.random.default_rng(0), {}
    for cell in cells_of(EXPERIMENT, seeds, quick=True).values():
        world, team, method = cell.id.split("/")
        for _ in range(cell.seeds):
            time_s = 100.0 * values(world, int(team[1:]), method) * (1.0 + 0.01 * rng.standard_normal())
            records.setdefault(cell.id, []).append(
                {
                    **dict.fromkeys(("t95_s", "t99_s", "t_none_s"), time_s),
                    "finished": True,
                    "scans": 10,
                    "distance_m": time_s,
                    "robots": 1,
                }
            )
    return records


def as_claimed(world, team, method):
    """Times as the paper has them: the best β is 10 in two worlds and 20 elsewhere."""
    unit = 1.0 + 0.3 * PLANS.index(world) if world in PLANS else 2.0
    slower = {"ptv": 1.0, "finish": 0.9, "sync": 1.0 if team == 1 else 1.1}
    if method.startswith("beta"):
        best, beta = (10 if world in ("office", "terrain-rough") else 20), int(method.split("-")[1])
        slower[method] = 1.1 + 0.2 * abs(np.log(beta / best))
    return unit * slower.get(method, 1.2)


def test_claims_hold_where_times_are_as_the_paper_says():
    records = synthetic(as_claimed)
    claims = {claim.id: claim for claim in all_claims(records)}
    assert all(claim.holds for claim in claims.values()), [c for c in claims.values() if not c.holds]
    assert claims["plans-async-t95_s"].ours == pytest.approx(1 / 1.1, abs=0.01)
    assert best_beta(records, "plans", "t95_s") == 20
    assert best_beta(records, "plans", "t95_s", ("office",)) == 10
    for part in ("plans", "terrains"):
        assert relative(records, part, "ptv", "t95_s").mean() == pytest.approx(1.0)
    ratio, low, high = compared(records, "terrains", "naive", "ptv", "t99_s")
    assert low < ratio < high and ratio == pytest.approx(1.2, abs=0.02)


def test_own_betas_are_judged_by_other_missions():
    """All β are alike: whichever a world's missions favour, others do not."""
    claims = {claim.id: claim for claim in all_claims(synthetic(lambda world, team, method: 1.0, seeds=9))}
    assert not any(claims[f"plans-no-single-{end}"].holds for end in ("t95_s", "t99_s", "t_none_s"))


def test_claims_do_not_hold_where_all_are_alike():
    claims = all_claims(synthetic(lambda world, team, method: 1.0))
    alike = [claim for claim in claims if claim.id.endswith("-points")]
    faster = [claim for claim in claims if claim.id.split("-")[1] not in ("points", "interior")]
    assert len(alike) == 2 and all(claim.holds for claim in alike)
    assert sum(claim.holds for claim in faster) < 0.15 * len(faster)


def tiny_trials(amount: Amount) -> list[CellTrial]:
    """The quick experiment in plans of 5 × 4 m and over terrains of 18 × 15 m, with few cells."""
    found: dict[str, Cell] = {trial.cell: trial.point for trial in sweep.experiment(amount)}
    tiny = []
    for cell in found.values():
        world = cell.id.split("/")[0]
        if world not in ("office", "terrain"):
            continue
        settings = {
            "grid": Grid((50, 60, 1), 0.1) if world in PLANS else Grid((18, 15, 13), 1.0),
            "world": "cluttered" if world in PLANS else world,
            "sensor": {"angular_step_rad": np.pi / 20},
            "ending": {"time_limit_s": 60.0},
        }
        scenario = with_settings(cell.scenario, settings)
        tiny.append(Cell(cell.id, scenario, cell.strategy, amount.seeds, cell.record))
    return trials_of(tiny)


def test_the_command_writes_its_page_and_goes_on_where_it_was(tmp_path, monkeypatch, capsys):
    monkeypatch.setattr(sawhney, "EXPERIMENT", dataclasses.replace(EXPERIMENT, trials=tiny_trials))
    ran = run_paper("sawhney", tmp_path, capsys, "--quick", "--seeds", "2")
    assert len(ran.claims) > 20 and "of the paper's" in ran.page


def test_only_the_whole_experiment_flies_over_the_model():
    for quick in (True, False):
        flown = {trial.point.record.over_model for trial in sweep.experiment(Amount(quick, 2))}
        assert flown == {False, not quick}


def test_the_model_of_jacksboro_is_a_world_to_fly_over():
    """30.0 × 31.9 km of 236 … 1,076 m; 4 m of air above it; rows run from north to south."""
    with np.load(cbook.get_sample_data("jacksboro_fault_dem.npz", asfileobj=False)) as dem:
        elevation_m = dem["elevation"]
    world = load_world(model_file(), 1.0, ceiling_m=4.0)
    assert world.grid.shape[:2] == (75, 80) and world.ceiling is not None
    ground = world.occupied.sum(axis=2)
    assert ground.max() - ground.min() == pytest.approx((1076 - 236) / 50, abs=1.0)
    assert 3 <= (world.ceiling - ground).min() and (world.ceiling - ground).max() <= 5
    highest = np.unravel_index(np.argmax(elevation_m), elevation_m.shape)
    x, y = 75 * highest[1] / 403, 80 * (1.0 - highest[0] / 344)
    assert ground[max(int(x) - 1, 0) : int(x) + 2, max(int(y) - 1, 0) : int(y) + 2].max() == ground.max()

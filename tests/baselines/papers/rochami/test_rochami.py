"""RochaMI: its claims and page."""

from __future__ import annotations

import math

import numpy as np
import pytest

from baselines.experiments.rows import Record
from baselines.papers.rochami import EXPERIMENT, sweep
from baselines.papers.rochami.claims import all_claims, steered_ratio
from baselines.papers.rochami.sweep import (
    cell_id,
    kappa_id,
    sharing_id,
)
from entropy_explore_env.settings.changes import with_settings
from entropy_explore_env.settings.scenarios import BOX
from tests.baselines.papers.pages import cells_of, run_paper


def as_the_paper_says(starts=20) -> dict[str, list[Record]]:
    """Missions in which every claim of the paper holds, a random walk is slower and steering pays."""
    luck = np.random.default_rng(0).uniform(0.95, 1.05, starts)
    joint = {1: 1.0, 2: 0.59, 3: 0.55, 4: 0.5, 5: 0.46, 6: 0.43, 7: 0.41, 8: 0.4, 9: 0.42, 10: 0.44}
    apart = {1: 1.0, 2: 0.81, **{n: 0.81 + 0.07 * (n - 2) for n in range(3, 11)}}
    records = {}
    for cell in cells_of(EXPERIMENT, starts).values():
        n, time_s, way_m, sent = cell.scenario.robots, 300.0, 20.0, 3.0
        if cell.id.startswith("sharing"):
            fill, i_min_bits = cell.scenario.channel.i_min_fill, cell.scenario.channel.i_min_bits
            sent = 4.0 * fill if fill else {0.6215: 1.0, 0.3219: 2.0, 0.0291: 3.0}[i_min_bits]
            time_s = (200.0 if fill else 250.0) - 20.0 * sent
        elif cell.strategy == "random":
            time_s *= 1.2 * joint[n]
        else:
            time_s *= (joint if cell.strategy == "mutual-information" else apart)[n]
            kappa = getattr(cell.record, "distance_cost", 0.0)
            time_s *= 1.0 + 0.5 * kappa
            way_m /= 1.0 + 0.5 * kappa + 2.0 * min(kappa, 0.25)
        records[cell.id] = [
            {
                "seed": seed,
                "robots": n,
                "finished": True,
                "t_mission_s": time_s * luck[seed] * (1.0 + 0.001 * (seed % 3)),
                "distance_m": n * way_m * luck[seed],
                "bits_sent": 1e6 * sent,
                "scans": 10 * n,
                "blocked_moves": n,
            }
            for seed in range(min(starts, cell.seeds))
        ]
    return records


PAPER = as_the_paper_says()


def claims_of(records):
    return {claim.id: claim for claim in all_claims(records)}


def test_where_everything_is_as_the_paper_says_every_claim_holds():
    claims = claims_of(PAPER)
    assert len(claims) > 50
    assert [claim.claim for claim in claims.values() if not claim.holds] == []
    assert claims["pair-wait-coordinated"].ours == pytest.approx(0.59, abs=1e-6)


@pytest.mark.parametrize(
    ("cell", "factor", "broken"),
    [
        (cell_id(5, "coordinated"), 3.0, {"faster-wait-5", "falls-wait"}),
        (cell_id(2, "uncoordinated", "wander"), 0.8, {"pair-wander-uncoordinated"}),
        (cell_id(10, "uncoordinated"), 0.3, {"faster-wait-10", "worsens-wait", "slower-wait"}),
        (cell_id(10, "coordinated", "wander"), 0.5, {"flattens-wander"}),
        (kappa_id(1.0), 0.5, {"kappa-time", "kappa-product"}),
        (kappa_id(0.25), 2.0, {"kappa-time", "kappa-product", "kappa-product-falls"}),
        (sharing_id(4, 0.3219), 0.5, {"steered-4-0.3219"}),
        ("n6-random-1m", 0.5, {"random-6-steps"}),
    ],
)
def test_a_claim_fails_where_its_cell_says_otherwise(cell, factor, broken):
    records = dict(PAPER)
    records[cell] = [{**r, "t_mission_s": r["t_mission_s"] * factor} for r in PAPER[cell]]
    failed = {name for name, claim in claims_of(records).items() if not claim.holds}
    assert broken <= failed and len(failed) <= len(broken) + 3


def test_a_steered_i_min_is_read_between_its_fills():
    (ratio, low, high), where = steered_ratio(PAPER, 2, 0.3219)  # 2 Mbit: 160 s over 210 s
    assert ratio == pytest.approx(160 / 210) and low <= ratio <= high and where == "2.00 Mbit"


# --- the command, from end to end, in a tiny box


def test_the_command_writes_its_page_and_goes_on_where_it_was(tmp_path, capsys, monkeypatch):
    robot = {"motion": "planar", "sensor_height_m": 1.25, "body_radius_m": 0.1}
    room = with_settings(BOX, {"ending": {"sigma_end": 1.0, "time_limit_s": 100.0}})
    base = {"robot": {"when_blocked": "wait"}, "ending": {"sigma_end": 0.5, "time_limit_s": 60.0}}
    monkeypatch.setattr(sweep, "LAB", with_settings(BOX, {"robot": robot, "ending": {"sigma_end": 0.5}}))
    monkeypatch.setattr(sweep, "ROOM", room)
    monkeypatch.setattr(sweep, "_BASE", base)
    ran = run_paper("rochami", tmp_path, capsys, "--quick", "--seeds", "2")
    assert {"faster-wait-2", "faster-wander-8", "kappa-product", "steered-2-0.3219"} <= set(ran.claims)
    assert all(math.isfinite(claim["ours"]) for claim in ran.claims.values())
    assert len([row for row in ran.rows if row.cell == cell_id(4, "coordinated")]) == 2

"""The claims of Rocha04 on records that are as the paper says, that contradict it, and of the real room."""

from __future__ import annotations

import copy
import json
import math
from collections.abc import Callable

import numpy as np
import pytest

from baselines.experiments.claims import Claim, told
from baselines.experiments.rows import Record
from baselines.papers.rocha04 import EXPERIMENT
from baselines.papers.rocha04.claims import all_claims
from baselines.papers.rocha04.sweep import TEAMS, team_id
from tests.baselines.papers.pages import cells_of


def as_the_paper_says(starts: int = 12) -> dict[str, list[Record]]:
    """Missions in which every claim of the paper holds, and in which random walks are slower."""
    rng = np.random.default_rng(0)
    luck = rng.uniform(0.9, 1.1, starts)
    room = cells_of(EXPERIMENT, starts).values()
    start = 28_577 * (0.5 * math.log2(2 * math.pi * math.e) + math.log2(30.0))
    threshold = 28_577 * (0.5 * math.log2(2 * math.pi * math.e) + math.log2(0.03))
    records: dict[str, list[Record]] = {}
    for cell in room:
        robots, channel = cell.scenario.robots, cell.scenario.channel
        gain = 1.0 if robots == 1 else 1.2 + 0.002 * channel.burst - 0.05 * channel.i_min_bits
        factor = (1.5 if cell.strategy == "random" else 1.0) / (robots * gain if robots > 1 else 1.0)
        scans = round(1211 * factor)
        batch = min(channel.burst, 128) if robots > 1 else 0
        late = batch if channel.i_min_bits < 0.1 else batch // 2
        sent = [batch] * (3 * scans // 4) + [late] * (scans - 3 * scans // 4)
        records[cell.id] = [
            {
                "seed": seed,
                "finished": True,
                "t_mission_s": 2142.0 * factor * luck[seed],
                "half_s": 2142.0 * factor * luck[seed] / (7.452 * rng.uniform(0.95, 1.05)),
                "scans": round(1211 * factor * luck[seed]),
                "measurements": 128 * round(1211 * factor * luck[seed]),
                "entropy_start_bits": start,
                "entropy_threshold_bits": threshold,
                "sent_by_scan": sent,
            }
            for seed in range(starts)
        ]
    return records


PAPER = as_the_paper_says()


def claims_of(records: dict[str, list[Record]]) -> dict[str, Claim]:
    claims = told(all_claims(records), EXPERIMENT.groups)
    assert len({claim.id for claim in claims}) == len(claims)
    return {claim.id: claim for claim in claims}


def test_every_claim_holds_of_records_that_are_as_the_paper_says():
    claims = claims_of(PAPER)
    assert [claim.id for claim in claims.values() if not claim.holds] == []
    assert len(claims) == 49
    for claim in claims.values():
        assert json.loads(json.dumps(claim.row(), allow_nan=False)) == claim.row()
        assert isinstance(claim.holds, bool) and claim.claim
        assert (claim.low is None) == (claim.high is None)
        if claim.low is not None and claim.high is not None and not isinstance(claim.ours, str):
            assert claim.ours is not None and claim.low <= claim.ours <= claim.high


def scaled(cell: str, factor: float) -> Callable[[dict[str, list[Record]]], None]:
    def change(records: dict[str, list[Record]]) -> None:
        for record in records[cell]:
            record["t_mission_s"] *= factor

    return change


def set_first(cell: str, name: str, value: object) -> Callable[[dict[str, list[Record]]], None]:
    def change(records: dict[str, list[Record]]) -> None:
        records[cell][0][name] = value

    return change


def emptied_early(records: dict[str, list[Record]]) -> None:
    """Batches are small from the beginning on."""
    for record in records[team_id(2, 64, 0.6215)]:
        record["sent_by_scan"] = [20] * len(record["sent_by_scan"])


@pytest.mark.parametrize(
    ("change", "fallen"),
    [
        (set_first("single", "entropy_start_bits", 1.9e5), {"H0"}),
        (set_first("single", "entropy_threshold_bits", -86_067.0), {"H_th"}),
        (set_first("single", "measurements", 7), {"batch"}),
        (scaled("single", 1.3), {"single-t_mission"}),
        (scaled("single-random", 0.4), {"random-1"}),
        (scaled("team-3-random", 0.4), {"random-3"}),
        (emptied_early, {"binds-late-0.6215"}),
        (
            set_first(team_id(2, 64, 0.0291), "sent_by_scan", [64, 64, 64, 64, 64, 63, 64, 64]),
            {"never-binds"},
        ),
    ],
)
def test_a_claim_falls_that_the_records_contradict(change, fallen):
    records = copy.deepcopy(PAPER)
    change(records)
    lost = {claim.id for claim in claims_of(records).values() if not claim.holds}
    assert fallen <= lost
    assert {name for name in lost if not name.startswith(("single-", "plane-"))} <= fallen


def copied(records: dict[str, list[Record]], source: str, target: str) -> None:
    """Give a cell the times of another, every second a tenth longer and the others a tenth shorter."""
    for seed, (record, other) in enumerate(zip(records[target], records[source], strict=True)):
        record["t_mission_s"] = other["t_mission_s"] * (1.1 if seed % 2 else 0.9)


def test_faster_has_to_be_certain_and_not_slower_may_be_chance():
    """A ratio whose interval holds 1 is not "faster", and is "not slower"."""
    records = copy.deepcopy(PAPER)
    for robots in TEAMS:
        copied(records, team_id(robots, 32, 0.6215), team_id(robots, 64, 0.6215))
        copied(records, team_id(robots, 128, 0.6215), team_id(robots, 128, 0.3219))
    copied(records, "single", "single-random")
    copied(records, "single", team_id(4, 32, 0.0291))
    claims = claims_of(records)
    for name in ("burst-32-64-0.6215", "i-min-0.6215-0.3219-128", "random-1", "team-size-32-0.0291"):
        claim = claims[name]
        assert claim.low is not None and claim.high is not None and claim.low < 1.0 < claim.high
        assert claim.holds == name.startswith("i-min")


def test_a_small_sample_s_interval_decides_for_the_single_robot():
    """The paper's 2142 s holds if 10 of our starts could have given it: ± 1.96 σ/√10."""
    for mean_s, holds in ((2142.0 - 60.0, True), (2142.0 - 160.0, False)):
        records = copy.deepcopy(PAPER)
        spread = np.tile([-200.0, 200.0], 6)  # σ = 200 s, so ± 124 s
        for record, off in zip(records["single"], spread, strict=True):
            record["t_mission_s"] = mean_s + off
        assert claims_of(records)["single-t_mission"].holds == holds

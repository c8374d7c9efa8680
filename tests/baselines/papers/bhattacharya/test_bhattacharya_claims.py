"""What Bhattacharya's report concludes from records, by hand."""

from __future__ import annotations

import pytest

from baselines.papers.bhattacharya.claims import (
    all_claims,
    channel_claims,
    channel_table,
    first_floor,
)
from baselines.papers.bhattacharya.sweep import (
    CHANNELS,
    CONTROLS,
    FLOORS,
    LOSSES,
    RIVALS,
    channel_cells,
    channel_id,
    coverage_id,
    exploration_id,
)

SPLITS = {"band": {"plain": 0.2, "0.01": 1.05}, "patch": {"plain": 1.0, "0.01": 0.4}}


def run(iterations=1000, explored_at=900, ended="converged", **others):
    """A record of (a) or (b)."""
    return {
        "iterations": iterations,
        "explored_at": explored_at,
        "ended": ended,
        "rises": 0,
        "largest_rise": 0.0,
        "seconds_an_iteration": 0.02,
        "seconds_with_tessellation": 0.05,
        **others,
    }


def mission(time_s, utility=1.0, **others):
    """A record of (f)."""
    figures = {"finished": True, "scans": 10, "bits_sent": 5000, "joint": {"explored": 0.5}}
    return {"t_mission_s": time_s, "bits_gained_per_bit_sent": utility, **figures, **others}


@pytest.fixture
def records():
    """Two runs of everything."""
    found = {
        coverage_id(control, starts): [run(100), run(110)]
        for control in CONTROLS
        for starts in ("random", "cluster")
    }
    for name, floor in FLOORS.items():
        for range_cells in floor.ranges:
            found[exploration_id(name, "paper", range_cells)] = [run(), run()]
        for variant in floor.variants:
            found[exploration_id(name, variant, floor.middle)] = [run(), run()]
    found["measured"] = [{"splits": SPLITS, "ours_s": 0.01, "scipy_s": 0.05}]
    return found


def claim(claims, name):
    """The only one with this name."""
    (found,) = [claim for claim in claims if claim.id == name]
    return found


def test_every_claim_has_a_name_of_its_own(records):
    claims = all_claims(records)
    assert len({claim.id for claim in claims}) == len(claims)
    assert claim(claims, "scipy").ours == pytest.approx(5.0)
    assert [claim(claims, f"split-{name}").holds for name in ("band", "patch")] == [True, False]
    assert [claim(claims, f"split-plain-{name}").holds for name in ("band", "patch")] == [True, False]


def test_iterations_count_against_the_paper_s_only_where_all_runs_end(records):
    small = records[exploration_id("small", "paper", 35.0)]
    small[:] = [run(800), run(1000)]
    found = claim(all_claims(records), "within-paper-small-35")
    assert found.ours == 900 and found.holds
    small[1] = run(1100)
    assert not claim(all_claims(records), "within-paper-small-35").holds
    small[1] = run(4000, None, "cut off")
    claims = all_claims(records)
    assert claim(claims, "explores-paper-small-35").ours == 0.5
    assert not claim(claims, "explores-paper-small-35").holds
    assert "within-paper-small-35" not in {claim.id for claim in claims}


def test_variants_are_compared_plan_by_plan(records):
    records[exploration_id("small", "length", 35.0)] = [run(1000, 600), run(1000, 600)]
    records[exploration_id("small", "phases", 35.0)][1] = run(1800, None, "cut off")
    claims = all_claims(records)
    metric, phases = claim(claims, "variant-metric-small"), claim(claims, "variant-phases-small")
    assert metric.ours == pytest.approx(1.5) and not metric.holds
    assert phases.ours == pytest.approx(1800 / 2700)  # what never ended counts with all its iterations
    assert not any(name.id == "variant-phases-wide" for name in claims)  # not run there


def test_variants_are_pictured_on_the_largest_plan_in_which_they_were_run(records):
    assert [first_floor(records, name) for name in ("paper", "nearest-length")] == ["wide", "narrow"]
    small = {name: r for name, r in records.items() if "-small-" in name}
    assert [first_floor(small, name) for name in ("paper", "nearest-length")] == ["small", "small"]


def test_rivals_send_as_many_measurements_a_scan():
    for phases, utility in RIVALS.items():
        assert "phase_s" in CHANNELS[phases] and "phase_s" not in CHANNELS[utility]
        assert CHANNELS[phases]["burst"] * CHANNELS[phases].get("repeats", 1) == CHANNELS[utility]["burst"]
    cells = channel_cells(8)
    assert len({cell.id for cell in cells}) == len(cells)
    assert {cell.seeds for cell in cells} == {8} and len({cell.strategy for cell in cells}) == 1


def test_channels_are_compared_seed_by_seed():
    missions = {channel_id(c, loss): [mission(200.0), mission(300.0)] for c in CHANNELS for loss in LOSSES}
    missions[channel_id("utility-64", 0.5)] = [mission(100.0, 2.0), mission(150.0, 2.0)]
    missions[channel_id("utility-all", 0.0)] = [mission(400.0, None), mission(600.0, 1.0)]
    claims = channel_claims(missions)
    assert len({claim.id for claim in claims}) == len(claims) == 2 * len(RIVALS) * len(LOSSES)
    utility, time = (claim(claims, f"{name}-phases-32-twice-0.5") for name in ("utility", "time"))
    assert (utility.ours, utility.low, utility.holds) == (2.0, 2.0, True)
    assert (time.ours, time.high, time.holds) == (0.5, 0.5, True)
    assert not claim(claims, "time-phases-32-twice-0").holds  # equal is not faster
    assert claim(claims, "time-phases-all-once-0").ours == 2.0
    assert claim(claims, "utility-phases-all-once-0").ours == 0.5  # who gained nothing counts 0
    assert "| utility-64 | 250 | 125 | 1.000 | 2.000 |" in channel_table(missions)

"""The claims of Sujan's cliff, each beside what was measured."""

from __future__ import annotations

import numpy as np

from baselines.experiments.claims import Claim
from baselines.experiments.outcome import Record
from baselines.experiments.statistics import mean_interval, ratio_interval
from baselines.papers.sujan.cliff.sweep import LOOKS, METHODS, STEPS, cell_id

Records = dict[str, list[Record]]
FEW, MORE = 10, 20
"""Steps after which the paper shows methods 5 and 3 (fig. 25)."""
_PAPER_RATIO, _PAPER_SHARE = 10.0, 0.5


def all_claims(records: Records) -> list[Claim]:
    """Every claim, from the missions' records by cell."""
    return [*_ratio_claims(records), *_order_claims(records), _step_claim(records), *_look_claims(records)]


def new_columns(records: Records, method: int) -> np.ndarray:
    """(N, STEPS + 1) columns mapped since the first looks, after each step; at its end it stays."""
    rows = []
    for record in records[cell_id(method)]:
        counts = np.asarray(record["columns"], float)[: LOOKS + STEPS + 1]
        counts = np.pad(counts, (0, LOOKS + STEPS + 1 - len(counts)), mode="edge")
        rows.append(counts[LOOKS:] - counts[LOOKS])
    return np.stack(rows)


def looks_of(records: Records, method: int, field: str, steps: int) -> np.ndarray:
    """(N, S) `expected` or `obtained` new columns of the first chosen looks; 0 where there are no more."""
    rows = [np.asarray(record[field], float)[:steps] for record in records[cell_id(method)]]
    return np.stack([np.pad(row, (0, steps - len(row))) for row in rows])


def interest_in(records: Records, part: str, steps: int) -> np.ndarray:
    """(N,) mean interest of method 5 in columns below the cliff, `unreadable` or `readable`, after steps."""
    rows = [record[f"interest_{part}"] for record in records[cell_id(5)]]
    return np.array([row[min(LOOKS + steps, len(row) - 1)] for row in rows])


def steps_needed(records: Records) -> np.ndarray:
    """(N,) steps of method 5 until it has mapped what method 3 has after MORE, over MORE."""
    wanted = new_columns(records, 3)[:, MORE]
    reached = new_columns(records, 5) >= wanted[:, None]
    steps = np.where(reached.any(axis=1), reached.argmax(axis=1), STEPS)
    return np.asarray(steps / MORE)


def _ratio_claims(records: Records) -> list[Claim]:
    claims = []
    for steps in (FEW, MORE, STEPS):
        best, first = (new_columns(records, method)[:, steps] for method in (5, 1))
        ratio, low, high = ratio_interval(best, first)
        text = f"method 5 maps about ten times what method 1 maps, after {steps} steps; ratio"
        claims.append(Claim(f"ten-{steps}", text, _PAPER_RATIO, ratio, low, high, high >= _PAPER_RATIO))
    return claims


def _order_claims(records: Records) -> list[Claim]:
    claims = []
    for better, worse in ((3, 1), (3, 2), (4, 3), (5, 4), (5, 3)):
        ours, others = (new_columns(records, method)[:, FEW] for method in (better, worse))
        ratio, low, high = ratio_interval(ours, others)
        text = f"method {better} maps more than method {worse} ({METHODS[worse]}) in {FEW} steps; ratio"
        claims.append(Claim(f"more-{better}-{worse}", text, "> 1", ratio, low, high, low > 1))
    return claims


def _step_claim(records: Records) -> Claim:
    mean, low, high = mean_interval(steps_needed(records))
    text = f"method 5 needs about half the steps that method 3 needs for what it maps in {MORE}; share"
    return Claim("half", text, _PAPER_SHARE, mean, low, high, low <= _PAPER_SHARE)


def _look_claims(records: Records) -> list[Claim]:
    answered = {
        method: looks_of(records, method, "obtained", MORE).sum(axis=1)
        / np.maximum(looks_of(records, method, "expected", MORE).sum(axis=1), 1.0)
        for method in (3, 5)
    }
    ratio, low, high = ratio_interval(answered[5], answered[3])
    text = f"of what its looks should show, method 5 obtains more than method 3, in {MORE} steps; ratio"
    claims = [Claim("answered", text, "> 1", ratio, low, high, low > 1)]
    for steps in (FEW, STEPS):
        dark, lit = (interest_in(records, part, steps) for part in ("unreadable", "readable"))
        ratio, low, high = ratio_interval(dark, lit)
        text = (
            f"after {steps} steps of method 5 interest is less in unreadable than in readable ground; ratio"
        )
        claims.append(Claim(f"interest-{steps}", text, "< 1", ratio, low, high, high < 1))
    stops = sum(record["edge_stops"] for method in METHODS for record in records[cell_id(method)])
    text = "drives that the edge ended, of all methods"
    return [*claims, Claim("edge", text, 0, stops, None, None, stops == 0)]

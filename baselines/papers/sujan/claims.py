"""The claims of Sujan's planar experiments, each beside what was measured."""

from __future__ import annotations

import numpy as np

from baselines.experiments.claims import Claim
from baselines.experiments.outcome import Record
from baselines.experiments.statistics import ratio_interval
from baselines.papers.sujan.sweep import METHODS, SCANS, TEAMS, cell_id

Records = dict[str, list[Record]]


def all_claims(records: Records) -> list[Claim]:
    """Every claim, from the missions' records by cell."""
    kinds = (_most_claims, _order_claims, _ratio_claims)
    return [claim for robots in TEAMS for claims in kinds for claim in claims(records, robots)]


def by_scan(records: Records, cell: str, field: str, scans: int = SCANS) -> np.ndarray:
    """(N, scans + 1) a figure of each mission before its first scan and after each; at the end it stays."""
    rows = [np.asarray(record[field], float)[: scans + 1] for record in records[cell]]
    return np.stack([np.pad(row, (0, scans + 1 - len(row)), mode="edge") for row in rows])


def at_end(records: Records, cell: str, field: str) -> np.ndarray:
    """(N,) a figure of each mission after its last scan."""
    return np.asarray([record[field][-1] for record in records[cell]], float)


def mapped(records: Records, cell: str) -> np.ndarray:
    """(N,) mean share mapped over the scans of each mission: how much is mapped for the same scans."""
    return np.asarray(by_scan(records, cell, "mapped")[:, 1:].mean(axis=1))


def mapped_per_metre(records: Records, cell: str) -> np.ndarray:
    """(N,) share mapped at the end, over the way of the team in hundreds of metres."""
    share, way_m = (at_end(records, cell, field) for field in ("mapped", "driven_m_by_scan"))
    return np.asarray(100.0 * share / np.maximum(way_m, 1.0))


def _team(robots: int) -> str:
    return "one robot" if robots == 1 else f"{robots} robots"


def _most_claims(records: Records, robots: int) -> list[Claim]:
    """(v) maps most for the same number of scans."""
    claims, best = [], mapped(records, cell_id(robots, "v"))
    for method in ("i", "ii", "iii", "iv"):
        other = mapped(records, cell_id(robots, method))
        ratio, low, high = ratio_interval(best, other)
        text = f"{_team(robots)}: (v) maps more for the same scans than ({method}) {METHODS[method]}; ratio"
        claims.append(Claim(f"most-{robots}-{method}", text, "> 1", ratio, low, high, low > 1))
    return claims


def _order_claims(records: Records, robots: int) -> list[Claim]:
    """Random poses map more than (iii) and (iv), as the paper's text says."""
    claims, walk = [], mapped(records, cell_id(robots, "i"))
    for method in ("iii", "iv"):
        ratio, low, high = ratio_interval(walk, mapped(records, cell_id(robots, method)))
        text = f"{_team(robots)}: (i) random poses map more than ({method}) {METHODS[method]}; ratio"
        claims.append(Claim(f"order-{robots}-{method}", text, "> 1", ratio, low, high, low > 1))
    return claims


def _ratio_claims(records: Records, robots: int) -> list[Claim]:
    """(v) maps most for each metre, random poses least; (v) drives a little more than (iii)."""
    claims = []
    for method in ("i", "ii", "iii", "iv"):
        best, other = (mapped_per_metre(records, cell_id(robots, name)) for name in ("v", method))
        ratio, low, high = ratio_interval(best, other)
        text = f"{_team(robots)}: (v) maps more for each metre than ({method}) {METHODS[method]}; ratio"
        claims.append(Claim(f"metre-{robots}-{method}", text, "> 1", ratio, low, high, low > 1))
    for method in ("ii", "iii", "iv"):
        walk, other = (mapped_per_metre(records, cell_id(robots, name)) for name in ("i", method))
        ratio, low, high = ratio_interval(walk, other)
        than = f"({method}) {METHODS[method]}"
        text = f"{_team(robots)}: (i) random poses map less for each metre than {than}; ratio"
        claims.append(Claim(f"worst-{robots}-{method}", text, "< 1", ratio, low, high, high < 1))
    ways = [at_end(records, cell_id(robots, name), "driven_m_by_scan") for name in ("v", "iii")]
    ratio, low, high = ratio_interval(*ways)
    text = f"{_team(robots)}: (v) drives slightly more than (iii) most-unmapped; ratio"
    return [*claims, Claim(f"way-{robots}", text, "> 1", ratio, low, high, low > 1)]

"""What Sujan says of shared maps: quadtrees are much smaller than maps, compressed ones smaller still."""

from __future__ import annotations

import numpy as np

from baselines.experiments.claims import Claim
from baselines.experiments.outcome import Record
from baselines.experiments.statistics import ratio_interval
from baselines.papers.sujan.sharing.mission import THRESHOLDS_BITS
from baselines.papers.sujan.sharing.sweep import MAKERS

Records = dict[str, list[Record]]
_CHOSEN = THRESHOLDS_BITS.index(0.5)


def all_claims(records: Records) -> list[Claim]:
    """Every claim, from the missions' records by cell."""
    claims = []
    for name in MAKERS:
        tree, packed = (bits_of(records, name, field)[:, _CHOSEN] for field in ("tree_bits", "packed_bits"))
        full, full_packed = (
            np.array([record[field] for record in records[name]], float)
            for field in ("full_bits", "full_packed_bits")
        )
        pairs = {
            "tree": (tree, full, "the quadtree has fewer bits than the full map"),
            "packed": (packed, tree, "the compressed quadtree has fewer bits than the quadtree"),
            "lossless": (
                packed,
                full_packed,
                "the compressed quadtree has fewer bits than the compressed map",
            ),
        }
        for what, (smaller, larger, text) in pairs.items():
            ratio, low, high = ratio_interval(smaller, larger)
            claims.append(
                Claim(f"{what}-{name}", f"{name}: {text}; ratio", "< 1", ratio, low, high, high < 1)
            )
    return claims


def bits_of(records: Records, cell: str, field: str) -> np.ndarray:
    """(N, T) a figure of each mission's map at each threshold."""
    return np.array([record[field] for record in records[cell]], float)

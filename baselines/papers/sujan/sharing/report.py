"""The report on shared maps: Markdown with claims and tables, and a figure of bits against errors."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import matplotlib as mpl
import numpy as np
from matplotlib.figure import Figure

from baselines.cli.figures import COLOURS, STYLE, png
from baselines.experiments.claims import Claim, claims_table
from baselines.experiments.statistics import mean_interval
from baselines.experiments.tables import markdown_table
from baselines.papers.sujan.sharing.claims import Records, bits_of
from baselines.papers.sujan.sharing.mission import THRESHOLDS_BITS
from baselines.papers.sujan.sharing.sweep import MAKERS, SCANS
from entropy_explore_env.writing import write_atomically


def write_report(folder: Path, records: Records, claims: Sequence[Claim], command: str) -> Path:
    """Write `sujan-sharing.md` and, in a folder `sujan-sharing` beside it, its figure.

    Returns:
        Path of the report.
    """
    with mpl.rc_context(STYLE):
        write_atomically(folder / "sujan-sharing" / "bits.png", png(figure_bits(records)))
    write_atomically(folder / "sujan-sharing.md", _text(records, claims, command))
    return folder / "sujan-sharing.md"


_ABOUT = """\
Written by `{command}`: the map that one robot has after {scans} scans,
in {worlds} worlds of each scenario. A full map holds two 32-bit numbers a voxel. A quadtree (an octree in
3-D) is what `encode_map` makes of it: two bits a node, sixteen a leaf; compressed, by its range coder. Errors
are those of the mean coverage of voxels that were measured; wrong are those whose side of ½ changes. A
leaf's σ is coarser than the map's, and never smaller: that is part of what a quadtree saves. Claims are at
the threshold of 0.5 bits, with 95 % paired bootstrap intervals over worlds."""


def _text(records: Records, claims: Sequence[Claim], command: str) -> str:
    worlds = len(next(iter(records.values())))
    parts = [
        "# Sujan and Meggiolaro, maps shared as summaries: bits against errors",
        _ABOUT.format(command=command, worlds=worlds, scans=SCANS),
        f"## Claims: {sum(claim.holds for claim in claims)} of {len(claims)} hold",
        claims_table(claims),
    ]
    for name in MAKERS:
        parts += [f"## {name}", _maps(records, name), _table(records, name)]
    return "\n\n".join([*parts, "![Bits against errors](sujan-sharing/bits.png)"]) + "\n"


def _maps(records: Records, name: str) -> str:
    full, packed, measured = (
        np.mean([record[field] for record in records[name]])
        for field in ("full_bits", "full_packed_bits", "measured")
    )
    share = measured / (full / 64)
    return f"Full maps: {full:,.0f} bits, compressed {packed:,.0f}; {share:.0%} of their voxels measured."


def _table(records: Records, name: str) -> str:
    rows = []
    for number, threshold in enumerate(THRESHOLDS_BITS):
        figures = [bits_of(records, name, field)[:, number] for field in ("tree_bits", "packed_bits")]
        errors = [bits_of(records, name, field)[:, number] for field in ("rms_error", "wrong")]
        shown = ["{:,.0f} ({:,.0f} … {:,.0f})".format(*mean_interval(bits)) for bits in figures]
        rows.append([f"{threshold:g}", *shown, f"{errors[0].mean():.4f}", f"{errors[1].mean():.2%}"])
    head = ["threshold (bits)", "quadtree (bits)", "compressed (bits)", "rms error", "wrong"]
    return markdown_table(head, rows)


def figure_bits(records: Records) -> Figure:
    """Bits of quadtrees, compressed and not, as shares of the full map's, against the error."""
    figure = Figure(figsize=(9.0, 3.4), layout="constrained")
    for axes, name in zip(figure.subplots(1, len(MAKERS), sharey=True), MAKERS, strict=True):
        full = np.array([record["full_bits"] for record in records[name]], float)[:, None]
        error = bits_of(records, name, "rms_error").mean(axis=0)
        for colour, field in enumerate(("tree_bits", "packed_bits")):
            share = (bits_of(records, name, field) / full).mean(axis=0)
            label = "quadtree" if colour == 0 else "compressed quadtree"
            axes.plot(error, share, color=COLOURS[colour], marker="o", label=label)
        packed = np.mean([record["full_packed_bits"] / record["full_bits"] for record in records[name]])
        axes.axhline(float(packed), color="black", linestyle="dotted", label="compressed map")
        axes.set(title=name, xlabel="rms error of coverage", yscale="log")
    figure.axes[0].set_ylabel("bits over the full map's")
    figure.axes[0].legend(frameon=False)
    return figure

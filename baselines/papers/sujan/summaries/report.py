"""The report on summaries beside batches: Markdown with claims and tables, and figures over bits a second."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import matplotlib as mpl
import numpy as np
from matplotlib.figure import Figure

from baselines.cli.figures import COLOURS, STYLE, png
from baselines.experiments.claims import Claim, claims_table
from baselines.experiments.tables import markdown_table
from baselines.papers.sujan.summaries.claims import Records, figure_of, shown
from baselines.papers.sujan.summaries.sweep import BURSTS, EVERY_S, TASKS, batch_id, summary_id
from entropy_explore_env.scenarios import find_scenario
from entropy_explore_env.writing import write_atomically


def write_report(folder: Path, records: Records, claims: Sequence[Claim], command: str) -> Path:
    """Write `sujan-summaries.md` and, in a folder `sujan-summaries` beside it, its figure.

    Returns:
        Path of the report.
    """
    with mpl.rc_context(STYLE):
        write_atomically(folder / "sujan-summaries" / "bits.png", png(figure_bits(records)))
    write_atomically(folder / "sujan-summaries.md", _text(records, claims, command))
    return folder / "sujan-summaries.md"


_ABOUT = """\
Written by `{command}`.

Teams of three share Rocha04's batches, at most {bursts} measurements of a scan, or
summaries, one every {every} s (threshold {threshold:g} bits), in {worlds} worlds of each scenario; the same
worlds and starts in every cell. Channels lose nothing and reach everybody; robots announce where they go
in all of them. A mission ends when one robot's map is known well enough (over terrain where σ is {sigma:g} on
average, elsewhere as the scenarios have it), or at the scenario's time limit.

Summaries are compared with batches at equal bits a second: the batches' means over their mean bits a second
are a curve, which is read at the bits of the summaries; beyond its ends its nearest point is taken. Ratios
are batches over summaries, with 95 % paired bootstrap intervals over worlds; a claim holds if the whole
interval is above 1. Errors are of coverage, over all voxels that can be seen, an unknown one being ½; robots'
maps are those that they act on, the joint map fuses all that the team measured. They are taken at a moment
of the mission: {moments}."""


def _text(records: Records, claims: Sequence[Claim], command: str) -> str:
    about = _ABOUT.format(
        command=command,
        bursts=", ".join(map(str, BURSTS)),
        every=", ".join(f"{every_s:g}" for every_s in EVERY_S),
        threshold=find_scenario("office").channel.summary_threshold_bits,
        worlds=len(next(iter(records.values()))),
        sigma=TASKS["terrain"].settings["ending"]["sigma_end"],
        moments=", ".join(f"{task.moment_s:g} s ({name})" for name, task in TASKS.items()),
    )
    parts = [
        "# Summaries of maps beside batches of measurements, at equal bits",
        about,
        f"## Claims: {sum(claim.holds for claim in claims)} of {len(claims)} hold",
        claims_table(claims),
        _reading(records),
    ]
    for task in TASKS:
        parts += [f"## {task}, by `{TASKS[task].strategy}`", _table(records, task)]
    return "\n\n".join([*parts, "![Over bits a second](sujan-summaries/bits.png)"]) + "\n"


def _reading(records: Records) -> str:
    """Why: what a bit that is sent takes from teammates' maps."""
    lines = []
    for task in TASKS:
        gains = {
            name: np.mean([record["bits_gained_per_bit_sent"] or 0.0 for record in records[name]])
            for name in (batch_id(task, BURSTS[-1]), *(summary_id(task, every_s) for every_s in EVERY_S))
        }
        batches, *summaries = gains.values()
        shares = ", ".join(f"{gain:.2f}" for gain in summaries)
        lines.append(
            f"- {task}: a bit of batches of {BURSTS[-1]} takes {batches:.2f} bits of entropy from teammates' "
            f"maps, one of summaries {shares} (every {', '.join(f'{s:g}' for s in EVERY_S)} s). Times of "
            f"missions of one channel differ up to {spread(records, task):.1f}-fold between worlds."
        )
    why = (
        "Why: a measurement costs 96 bits whatever it says, and is traced anew by whoever hears it; a leaf "
        "costs some bits, stands for all voxels that are much the same, and for all scans since the last "
        "summary. The longer a robot waits, the more scans one leaf stands for, but teammates learn of it "
        "later. The joint map depends on what is shared only through where robots go. Where missions of one "
        "channel differ much between worlds, intervals are wide."
    )
    return "\n".join([why, "", *lines])


def spread(records: Records, task: str) -> float:
    """The longest over the shortest mission of one channel, in that channel in which they differ most."""
    times = [figure_of(records[cell], "time") for _, cell in _cells(task)]
    return max(float(time.max() / time.min()) for time in times)


def _cells(task: str) -> list[tuple[str, str]]:
    """Name and cell of each channel of a task."""
    batches = [(f"batches of {burst}", batch_id(task, burst)) for burst in BURSTS]
    return batches + [(f"summaries, {every_s:g} s", summary_id(task, every_s)) for every_s in EVERY_S]


def _table(records: Records, task: str) -> str:
    rows = []
    for name, cell in _cells(task):
        found = records[cell]
        rows.append(
            [
                name,
                shown(found, "bits", ",.0f"),
                f"{sum(record['finished'] for record in found)} of {len(found)}",
                shown(found, "time", ",.0f"),
                shown(found, "error", ".4f"),
                f"{figure_of(found, 'known').mean():.3f}",
                f"{figure_of(found, 'wrong').mean():.2%}",
                shown(found, "joint", ".4f"),
            ]
        )
    head = ["channel", "bits/s", "mapped", "time (s)", "error of robots' maps", "known", "of it wrong"]
    return markdown_table([*head, "error of the joint map"], rows)


def figure_bits(records: Records) -> Figure:
    """Mission time, and the error of robots' maps, over bits a second."""
    figure = Figure(figsize=(9.0, 5.4), layout="constrained")
    labels = {"time": "mission time (s)", "error": "error of robots' maps"}
    for row, axes_of in zip(labels, figure.subplots(2, len(TASKS)), strict=True):
        for axes, task in zip(axes_of, TASKS, strict=True):
            kinds = {
                "batches": [batch_id(task, burst) for burst in BURSTS],
                "summaries": [summary_id(task, every_s) for every_s in EVERY_S],
            }
            for colour, (kind, cells) in enumerate(kinds.items()):
                bits = [figure_of(records[cell], "bits").mean() for cell in cells]
                values = [figure_of(records[cell], row).mean() for cell in cells]
                axes.plot(bits, values, color=COLOURS[colour], marker="o", label=kind)
            axes.set(xscale="log", xlabel="bits/s", title=task if row == "time" else "")
            axes.set_xticks([500, 1000, 2000, 4000], ["500", "1000", "2000", "4000"], minor=False)
            axes.set_xticks([], minor=True)
        axes_of[0].set_ylabel(labels[row])
    figure.axes[0].legend(frameon=False)
    return figure

"""The page that `training.experiment` writes: curves, tables, what holds and what does not."""

from __future__ import annotations

from pathlib import Path

import matplotlib as mpl
import numpy as np
from matplotlib.figure import Figure

from baselines.cli.figures import COLOURS, STYLE, png
from baselines.experiments.tables import csv_table, markdown_table
from entropy_explore_env.writing import write_atomically
from training.evaluate import SIMPLE, table_cells
from training.experiment import ABLATIONS, BESIDE, Found, Task, planned_runs

_LINES = {"gradient": "--", "random": ":", "information-rate": "-."}


def write_page(out: Path, found: Found, command: str) -> Path:
    """Write `ppo.md`, and its figures and curves into `ppo`.

    Args:
        out: Folder.
        found: What the experiment came to.
        command: That makes it again.

    Returns:
        The page.
    """
    for task in found.tasks:
        name = f"curve-{task.scenario}"
        write_atomically(out / "ppo" / f"{name}.png", png(curve_figure(task, found)))
        write_atomically(out / "ppo" / f"{name}.csv", _curves_csv(task, found))
    if found.ablations:
        write_atomically(out / "ppo" / "ablations.png", png(ablation_figure(found)))
    parts = [
        "# Learning with PPO\n",
        f"Made by `{command}`. One network drives every robot; it sees what its robot knows and nothing "
        "else. Runs learn on starts and worlds of their own, are validated on 32 others, and the policy that "
        "validated best is tested on starts, and worlds of the test split, that it never saw. Times are "
        "simulated; intervals are 95 % bootstrap intervals over starts, paired by start.\n",
    ]
    for task in found.tasks:
        parts += _task_parts(task, found)
    if found.ablations:
        parts += _ablation_parts(found)
    else:
        parts.append("Runs with one thing changed at a time are not complete yet, and left out.\n")
    page = out / "ppo.md"
    write_atomically(page, "\n".join(parts))
    return page


def _task_parts(task: Task, found: Found) -> list[str]:
    """The section of a scenario."""
    compared = found.compared[task.scenario]
    starts, rows = compared["seeds"], [dict(row) for row in compared["rows"]]
    names = [task.run(seed) for seed in range(task.seeds)]
    policies = [row for row in rows if row["strategy"].rsplit("/", 1)[-1] in names]
    for row in policies:
        row["strategy"] = "PPO, seed " + row["strategy"].rsplit("-", 1)[-1]
    head = ["strategy", "mission time, median", "mean", "finished", "scans", "PPO's share", "PPO faster"]
    options = " ".join(planned_runs(found.tasks, found.steps, False)[task.run(0)])
    runs = []
    for name in names:
        spent, curve = found.spent[name], found.curves[name]
        loop = spent["collecting_s"] + spent["learning_s"]
        best = min(curve, key=lambda row: row["mean_s"])
        runs.append(
            (
                name,
                f"{spent['steps']:,}",
                f"{(loop + spent['validating_s']) / 60:.1f}",
                f"{spent['processor_s'] / 60:.1f}",
                f"{spent['collecting_s'] / loop:.0%}",
                f"{best['median_s']:.1f} s at {best['steps']:,.0f}",
            )
        )
    columns = ["run", "steps", "minutes", "processor minutes", "collecting", "best validation, median"]
    return [
        f"## {task.scenario}, three robots\n",
        f"    python -m training.ppo {options} --threads 1 --out runs/{task.run(0)}\n",
        markdown_table(columns, runs),
        "Minutes are those of the clock, processor minutes those of the run's one thread: other work on the "
        "machine makes the difference. Collecting is the share of missions and choices in the loop, learning "
        "the rest.\n",
        f"![Validation as learning goes on](ppo/curve-{task.scenario}.png)\n",
        f"On {starts} test starts (the seeds 0 … {starts - 1}). PPO's share is the median time of seed 0's "
        "policy over that of the row's strategy; PPO faster, the starts on which it was.\n",
        markdown_table(head, [table_cells(row, starts) for row in rows]),
        _verdicts(task, found),
    ]


def _verdicts(task: Task, found: Found) -> str:
    """What was to be reached, and whether it was."""
    compared = found.compared[task.scenario]
    rows = {row["strategy"]: row for row in compared["rows"]}
    starts, better = compared["seeds"], rows[compared["better_rival"]]
    policy, informed = rows[compared["policy"]], rows["information-rate"]
    faster, needed = compared["faster_than_simple"], int(np.ceil(0.95 * starts))
    goals = [
        (
            f"median at most {task.goal} × that of the better of {' and '.join(SIMPLE)}",
            f"{better['ratio']:.2f} ({better['ratio_low']:.2f} … {better['ratio_high']:.2f})",
            better["ratio"] <= task.goal,
        ),
        (f"faster than both on at least {needed} of {starts} starts", f"{faster}", faster >= needed),
        ("every mission finished", f"{policy['finished']} of {starts}", policy["finished"] == starts),
        (
            "stretch: median at most 0.9 × that of information-rate",
            f"{informed['ratio']:.2f} ({informed['ratio_low']:.2f} … {informed['ratio_high']:.2f})",
            informed["ratio"] <= 0.9,
        ),
    ]
    rows_shown = [(text, value, "yes" if holds else "no") for text, value, holds in goals]
    return markdown_table(["goal", "found", "holds"], rows_shown)


def curve_figure(task: Task, found: Found) -> Figure:
    """Median mission time in validation over steps, a line a run; and the strategies' on test starts."""
    with mpl.rc_context(STYLE):
        figure = Figure(figsize=(7.4, 3.9), layout="constrained")
        axes = figure.subplots()
        for seed in range(task.seeds):
            curve = found.curves[task.run(seed)]
            steps = np.array([row["steps"] for row in curve]) / 1e6
            axes.plot(
                steps, [row["median_s"] for row in curve], color=COLOURS[seed], label=f"PPO, seed {seed}"
            )
        for row in found.compared[task.scenario]["rows"]:
            if row["strategy"] in _LINES:
                style = _LINES[row["strategy"]]
                axes.axhline(
                    row["median_s"], color="0.35", linestyle=style, label=row["strategy"], linewidth=1
                )
        axes.set(yscale="log", xlabel="robot-steps, millions", ylabel="mission time, median, s")
        ticks = [each for each in (30, 50, 75, 100, 150, 200, 300, 500, 750, 1000, 2000)]
        axes.set_yticks(ticks, [f"{tick:,}" for tick in ticks])
        axes.minorticks_off()
        low, high = _limits(task, found)
        axes.set_ylim(low, high)
        axes.grid(axis="y", color="0.9", linewidth=0.8)
        axes.legend(frameon=False, ncols=2)
    return figure


def _limits(task: Task, found: Found) -> tuple[float, float]:
    """What the ordinate shows."""
    shown = [row["median_s"] for seed in range(task.seeds) for row in found.curves[task.run(seed)]]
    shown += [row["median_s"] for row in found.compared[task.scenario]["rows"]]
    return 0.8 * min(shown), 1.25 * max(shown)


def _curves_csv(task: Task, found: Found) -> str:
    rows = [{"seed": seed, **row} for seed in range(task.seeds) for row in found.curves[task.run(seed)]]
    return csv_table({name: [row[name] for row in rows] for name in rows[0]})


def _ablation_parts(found: Found) -> list[str]:
    """The section of what was changed one thing at a time."""
    ends = {name: np.array([_end(curve) for curve in curves]) for name, curves in found.ablations.items()}
    usual = ends["default"]
    rows = []
    for name, (sentence, options) in ABLATIONS.items():
        own, base = ends[name], BESIDE[name]
        more = own - ends[base]
        apart = "" if name == base else f"{np.mean(more):+.1f}"
        spread = "" if name == base else f"{np.min(more):+.1f} … {np.max(more):+.1f}"
        times = ", ".join(f"{time:.1f}" for time in own)
        shown = f"`{' '.join(options)}`" if options else ""
        rows.append((name, sentence, shown, times, "" if name == base else base, apart, spread))
    head = [
        "run",
        "what is changed",
        "options",
        "seconds, seeds 0, 1, 2",
        "beside",
        "mean difference",
        "range",
    ]
    return [
        "## What the design rests on\n",
        f"Runs of {found.steps:,} steps in the room, three robots, three seeds each, one thing changed at a "
        "time. Seconds are the mean mission time in the last validation (32 missions); differences, their "
        "mean and range, are to the run of the same seed that it stands beside. Three seeds tell large "
        "differences from none, not small ones: what lies within the spread of the default's own runs "
        f"({usual.min():.1f} … {usual.max():.1f} s) is not told apart from chance.\n",
        markdown_table(head, rows),
        "![Mission times of the changed runs](ppo/ablations.png)\n",
    ]


def _end(curve: list[dict[str, float]]) -> float:
    """Mean mission time in a run's last validation."""
    return curve[-1]["mean_s"]


def ablation_figure(found: Found) -> Figure:
    """A row a change: the last validation of each seed."""
    names = list(found.ablations)
    with mpl.rc_context(STYLE):
        figure = Figure(figsize=(7.4, 0.32 * len(names) + 0.9), layout="constrained")
        axes = figure.subplots()
        usual = np.mean([_end(curve) for curve in found.ablations["default"]])
        axes.axvline(float(usual), color="0.8", linewidth=1, zorder=0)
        for place, name in enumerate(names):
            ends = [_end(curve) for curve in found.ablations[name]]
            colour = "black" if name == "default" else COLOURS[0]
            axes.plot(ends, [place] * len(ends), "o", color=colour, markersize=5, alpha=0.8)
        axes.set_yticks(range(len(names)), names)
        axes.invert_yaxis()
        axes.set_xlabel("mean mission time in the last validation, s; a dot a seed")
        axes.grid(axis="x", color="0.92", linewidth=0.8)
    return figure

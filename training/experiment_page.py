"""The page that `training.experiment` writes: curves, tables, and which goals are reached."""

from __future__ import annotations

from pathlib import Path

import matplotlib as mpl
import numpy as np
from matplotlib.figure import Figure

from baselines.cli.figures import COLOURS, STYLE, png
from baselines.experiments.tables import csv_table, markdown_table
from entropy_explore_env.writing import write_atomically
from training.evaluate import SIMPLE, table_cells
from training.experiment import ABLATIONS, ExperimentResults, Task, planned_runs

_LINES = {"gradient": "--", "random": ":", "planned-rate": "-."}


def write_page(out: Path, results: ExperimentResults, command: str) -> Path:
    """Write `ppo.md`, and its figures and curves into `ppo`.

    Args:
        out: Folder.
        results: What the page shows.
        command: The command that makes the page again.

    Returns:
        The page.
    """
    for task in results.tasks:
        name = f"curve-{task.scenario}"
        write_atomically(out / "ppo" / f"{name}.png", png(curve_figure(task, results)))
        write_atomically(out / "ppo" / f"{name}.csv", _curves_csv(task, results))
    if results.ablations:
        write_atomically(out / "ppo" / "ablations.png", png(ablation_figure(results)))
    parts = [
        "# Learning with PPO\n",
        f"Made by `{command}`. One network drives every robot; it sees what its robot knows and nothing "
        "else. Runs learn on starts and worlds of their own, are validated on 32 others, and the policy that "
        "validated best is tested on starts, and worlds of the test split, that it never saw. Times are "
        "simulated; intervals are 95 % bootstrap intervals over starts, paired by start.\n",
    ]
    for task in results.tasks:
        parts += _task_parts(task, results)
    if results.ablations:
        parts += _ablation_parts(results)
    else:
        parts.append("Runs with one thing changed at a time are not complete yet, and left out.\n")
    page = out / "ppo.md"
    write_atomically(page, "\n".join(parts))
    return page


def _task_parts(task: Task, results: ExperimentResults) -> list[str]:
    """The section of a scenario."""
    compared = results.comparisons[task.scenario]
    starts, rows = compared["seeds"], [dict(row) for row in compared["rows"]]
    names = [task.run(seed) for seed in range(task.seeds)]
    policies = [row for row in rows if row["strategy"].rsplit("/", 1)[-1] in names]
    for row in policies:
        row["strategy"] = "PPO, seed " + row["strategy"].rsplit("-", 1)[-1]
    head = ["strategy", "mission time, median", "mean", "finished", "scans", "PPO's share", "PPO faster"]
    options = " ".join(planned_runs(results.tasks, results.ablation_steps, False)[task.run(0)])
    runs = []
    for name in names:
        spent, curve = results.progress[name], results.curves[name]
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
        _verdicts(task, results),
    ]


def _verdicts(task: Task, results: ExperimentResults) -> str:
    """The goals, and whether they are reached."""
    compared = results.comparisons[task.scenario]
    rows = {row["strategy"]: row for row in compared["rows"]}
    starts, better = compared["seeds"], rows[compared["better_rival"]]
    policy, informed = rows[compared["policy"]], rows["planned-rate"]
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
            "stretch: median at most 0.9 × that of planned-rate",
            f"{informed['ratio']:.2f} ({informed['ratio_low']:.2f} … {informed['ratio_high']:.2f})",
            informed["ratio"] <= 0.9,
        ),
    ]
    rows_shown = [(text, value, "yes" if holds else "no") for text, value, holds in goals]
    return markdown_table(["goal", "found", "holds"], rows_shown)


def curve_figure(task: Task, results: ExperimentResults) -> Figure:
    """Median mission time in validation over steps, by run, and that of strategies on test starts."""
    with mpl.rc_context(STYLE):
        figure = Figure(figsize=(7.4, 3.9), layout="constrained")
        axes = figure.subplots()
        for seed in range(task.seeds):
            curve = results.curves[task.run(seed)]
            steps = np.array([row["steps"] for row in curve]) / 1e6
            axes.plot(
                steps, [row["median_s"] for row in curve], color=COLOURS[seed], label=f"PPO, seed {seed}"
            )
        for row in results.comparisons[task.scenario]["rows"]:
            if row["strategy"] in _LINES:
                style = _LINES[row["strategy"]]
                axes.axhline(
                    row["median_s"], color="0.35", linestyle=style, label=row["strategy"], linewidth=1
                )
        axes.set(yscale="log", xlabel="robot-steps, millions", ylabel="mission time, median, s")
        ticks = [each for each in (30, 50, 75, 100, 150, 200, 300, 500, 750, 1000, 2000)]
        axes.set_yticks(ticks, [f"{tick:,}" for tick in ticks])
        axes.minorticks_off()
        low, high = _limits(task, results)
        axes.set_ylim(low, high)
        axes.grid(axis="y", color="0.9", linewidth=0.8)
        axes.legend(frameon=False, ncols=2)
    return figure


def _limits(task: Task, results: ExperimentResults) -> tuple[float, float]:
    """Limits of the time axis."""
    shown = [row["median_s"] for seed in range(task.seeds) for row in results.curves[task.run(seed)]]
    shown += [row["median_s"] for row in results.comparisons[task.scenario]["rows"]]
    return 0.8 * min(shown), 1.25 * max(shown)


def _curves_csv(task: Task, results: ExperimentResults) -> str:
    rows = [{"seed": seed, **row} for seed in range(task.seeds) for row in results.curves[task.run(seed)]]
    return csv_table({name: [row[name] for row in rows] for name in rows[0]})


def _ablation_parts(results: ExperimentResults) -> list[str]:
    """The section of the ablations."""
    ends = {name: np.array([_end(curve) for curve in curves]) for name, curves in results.ablations.items()}
    usual = ends["default"]
    rows = []
    for name, (change, options, reference) in ABLATIONS.items():
        shown = f"`{' '.join(options)}`" if options else ""
        times = ", ".join(f"{time:.1f}" for time in ends[name])
        row = (name, change, shown, times)
        if name == reference:
            rows.append((*row, "", "", ""))
            continue
        more = ends[name] - ends[reference]
        rows.append((*row, reference, f"{np.mean(more):+.1f}", f"{np.min(more):+.1f} … {np.max(more):+.1f}"))
    head = [
        "run",
        "what is changed",
        "options",
        "seconds, seeds 0, 1, 2",
        "compared with",
        "mean difference",
        "range",
    ]
    return [
        "## What the design rests on\n",
        f"Runs of {results.ablation_steps:,} steps in the room, three robots, three seeds each, one thing "
        "changed at a time. Seconds are the mean mission time in the last validation (32 missions); mean and "
        "range of the differences are those between runs of the same seed. Three seeds tell large "
        "differences from none, not small ones: what lies within the spread of the default's own runs "
        f"({usual.min():.1f} … {usual.max():.1f} s) is not told apart from chance.\n",
        markdown_table(head, rows),
        "![Mission times of the changed runs](ppo/ablations.png)\n",
    ]


def _end(curve: list[dict[str, float]]) -> float:
    """Mean mission time in a run's last validation."""
    return curve[-1]["mean_s"]


def ablation_figure(results: ExperimentResults) -> Figure:
    """A row for each ablation: the last validation of each seed."""
    names = list(results.ablations)
    with mpl.rc_context(STYLE):
        figure = Figure(figsize=(7.4, 0.32 * len(names) + 0.9), layout="constrained")
        axes = figure.subplots()
        usual = np.mean([_end(curve) for curve in results.ablations["default"]])
        axes.axvline(float(usual), color="0.8", linewidth=1, zorder=0)
        for place, name in enumerate(names):
            ends = [_end(curve) for curve in results.ablations[name]]
            colour = "black" if name == "default" else COLOURS[0]
            axes.plot(ends, [place] * len(ends), "o", color=colour, markersize=5, alpha=0.8)
        axes.set_yticks(range(len(names)), names)
        axes.invert_yaxis()
        axes.set_xlabel("mean mission time in the last validation, s; a dot a seed")
        axes.grid(axis="x", color="0.92", linewidth=0.8)
    return figure

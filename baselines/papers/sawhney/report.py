"""The report of Sawhney 2009: Markdown with the claims and what was found, figures and tables beside it."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import matplotlib as mpl
import numpy as np

from baselines.cli.figures import STYLE, png
from baselines.experiments.claims import Claim, claims_table
from baselines.experiments.statistics import mean_interval
from baselines.experiments.tables import csv_table, markdown_table
from baselines.papers.sawhney.claims import (
    ENDS,
    PARTS,
    Records,
    best_beta,
    betas_in,
    changed_from,
    changed_itself,
    changed_ratio,
    changes_in,
    compared,
    fastest_changed,
    relative,
    teams_in,
    times,
    worlds_in,
)
from baselines.papers.sawhney.figures import figure_beta, figure_curves, figure_teams, figure_times
from baselines.papers.sawhney.illustrations import OptionMeans, pictures, visible_area_m2
from baselines.papers.sawhney.map_files import STARTS as MAP_STARTS
from baselines.papers.sawhney.map_files import TEAM as MAP_TEAM
from baselines.papers.sawhney.map_files import maps_table
from baselines.papers.sawhney.sweep import (
    BONUS,
    CHANGED_METHODS,
    CHANGED_TEAM,
    CHANGES,
    POINT,
    SIGMA,
    TIME_LIMIT_S,
    cell_id,
)
from entropy_explore_env.frontiers.frontier_map import FrontierConfig
from entropy_explore_env.frontiers.terrain_frontiers import PATCH_M, TOO_HIGH
from entropy_explore_env.writing import write_atomically

PAPER_RUNS = {"plans": 160, "terrains": 120}
_PICTURES = {"times": figure_times, "beta": figure_beta, "teams": figure_teams, "curves": figure_curves}


def write_report(
    folder: Path, records: Records, claims: Sequence[Claim], command: str, dem: Path | None = None
) -> Path:
    """Write `sawhney.md` and, in a folder `sawhney` beside it, its figures and tables.

    Args:
        folder: Where.
        records: Cell id → records.
        claims: What is claimed.
        command: That made them.
        dem: The height map's file that was flown over as well.

    Returns:
        Path of the report.
    """
    with mpl.rc_context(STYLE):
        for part in PARTS:
            for name, draw in _PICTURES.items() if worlds_in(records, part) else ():
                figure, table = draw(records, part)
                write_atomically(folder / "sawhney" / f"{part}-{name}.png", png(figure))
                write_atomically(folder / "sawhney" / f"{part}-{name}.csv", csv_table(table))
        drawn, means = pictures([part for part in PARTS if worlds_in(records, part)], dem)
        for name, figure in drawn.items():
            write_atomically(folder / "sawhney" / f"{name}.png", png(figure))
    text = _text(records, claims, command) + _pictures_text(list(drawn), means)
    write_atomically(folder / "sawhney.md", text)
    return folder / "sawhney.md"


def _text(records: Records, claims: Sequence[Claim], command: str) -> str:
    missions = sum(len(cell) for cell in records.values())
    parts = [
        "# Sawhney, Krishna & Srinathan 2009, reproduced",
        f"Written by `{command}`: {missions:,} missions; seeds 0, 1, … are the same worlds and starts in "
        f"every cell. {_cut(records)} The figures' numbers lie as CSV in `sawhney/`.",
        *(_runs(records, part) for part in PARTS),
        _RULES,
        f"## Claims: {_held(claims)}",
        _HOLDS,
        claims_table(claims),
        _FIGURES,
    ]
    for part, name in PARTS.items():
        if worlds_in(records, part):
            parts += [
                f"## {name}",
                f"![Times over team size](sawhney/{part}-times.png)",
                f"![β](sawhney/{part}-beta.png)",
                f"![Team sizes](sawhney/{part}-teams.png)",
                f"![Curves](sawhney/{part}-curves.png)",
                _times_table(records, part),
                _betas_table(records, part),
                _worlds_table(records, part),
            ]
    if table := maps_table(records, ENDS):
        parts += ["## Plans from files", _MAPS, table]
    changed = [part for part in PARTS if changes_in(records, part)]
    if changed:
        parts += ["## One thing changed at a time", _CHANGED]
        for part in changed:
            parts += [_causes_table(records, part), _changed_worlds_table(records, part)]
        parts += [_changes_table(records, part) for part in changed]
    return "\n\n".join(part.strip() for part in parts) + "\n"


def _cut(records: Records) -> str:
    """Which missions were cut off."""
    counts: dict[str, int] = {}
    for cell, found in records.items():
        if count := sum(not record["finished"] for record in found):
            method = cell.rsplit("/", 1)[-1]
            counts[method] = counts.get(method, 0) + count
    if not counts:
        return f"All missions ended before {TIME_LIMIT_S:g} s."
    listed = ", ".join(f"{count} of `{method}`" for method, count in counts.items())
    return f"Cut off at {TIME_LIMIT_S:g} s, which counts as their time: {listed}."


def _held(claims: Sequence[Claim]) -> str:
    """How many claims hold, the paper's and ours."""
    ours = [claim.holds for claim in claims if claim.paper is None]
    paper = [claim.holds for claim in claims if claim.paper is not None]
    return f"{sum(paper)} of the paper's {len(paper)} hold, and {sum(ours)} of {len(ours)} of ours"


def _runs(records: Records, part: str) -> str:
    """How many missions a point has, beside the paper's."""
    worlds, teams = worlds_in(records, part), teams_in(records, part)
    if not worlds:
        return f"**{PARTS[part]} was not run.**"
    runs = sum(len(records[cell_id(world, teams[0], "ptv")]) for world in worlds)
    betas = ", ".join(map(str, betas_in(records, part)))
    fewer = f", fewer than the paper's {PAPER_RUNS[part]}" if runs < PAPER_RUNS[part] else ""
    return (
        f"{PARTS[part]}: {', '.join(worlds)}; teams of {', '.join(map(str, teams))}; "
        f"**{runs} runs a point{fewer}**; β ∈ {{{betas}}} in the paper's numbers, each {POINT[part]:g} "
        + ("m²/s." if part == "plans" else "m³/s.")
    )


TITLES = {
    "worlds": "Worlds, fig. 5",
    "options": "Options, fig. 1",
    "plan-mission": "A mission in a plan, fig. 7",
    "ways": "Ways, figs. 11 and 12",
    "terrain-mission": "A mission over terrain, fig. 9",
    "section": "A section, figs. 2 to 4",
}
_PAPER_MEANS = {"V - 2t": "18.8, 2.7, 10", "V - 20t": "11, 1, 11", "V/t": "15.2, 1.3, 12.5"}
_OPTIONS = """Fig. 1, whose options are taken to be all pairs of t = 1 … 10 and V = 2, 4 … 20: means of V, t
and V/t over the ten that a metric goes for first. The paper's ten of V - 2t leave out some that are worth
more by that metric, such as (3, 18): its figure has fewer points."""


def _pictures_text(drawn: Sequence[str], means: Sequence[OptionMeans]) -> str:
    """The figures that show no measurements."""
    parts = ["## The paper's other figures", *(f"![{TITLES[name]}](sawhney/{name}.png)" for name in drawn)]
    if means:
        rows = [
            [name, _PAPER_MEANS[name], f"{seen:.3g}, {seconds:.3g}, {ratio:.3g}"]
            for name, seen, seconds, ratio in means
        ]
        parts += [_OPTIONS, markdown_table(["metric", "paper", "ours"], rows)]
    return "\n" + "\n\n".join(parts) + "\n"


_FRONTIERS = FrontierConfig()
_RULES = f"""Plans are the scenarios of these names: cells of 0.1 m, robots without bodies at 0.5 m/s and
0.5 m/s² with a laser of 360 rays all around up to 3 m; a scan takes 2 s. Terrains are 96 × 72 m of fractal
ground with up to 18 m of relief, Hurst exponents 0.95, 0.8 and 0.5, under an exposure surface at least 4 m
above it; `dem` is a height map from a file, if not said otherwise the elevations of Jacksboro, Tennessee,
in 1 : 400 and heights in 1 : 50: 30 × 32 km become 75 × 80 m with 17 m of relief. UAVs at 3 m/s and 2 m/s²
fly planned ways below it, and have a scanner that looks down, all around, up to 20 m; a scan takes 2 s.
Everybody hears every measurement and announcement at once: the centralised form. The paper gives none of
these numbers.

A cell of a plan, or the surface of a column of ground, is explored once its σ has fallen below {SIGMA:g}.
Candidates lie a sixth of the sensor's range apart, over terrain in height as well; γ = {_FRONTIERS.gamma:g},
z_av is the mean ground within {PATCH_M:g} m, and candidates higher above it than
{TOO_HIGH:g} of the range are dropped. "95 %" is a share of the cells that can be seen from where
robots can be, measured at all; over terrain a share of all columns. t takes ways along the grid; robots
drive them pulled straight, up to 8 % shorter in plans and 11 % in the air. What somebody under way has
promised to see is worked out anew from its target at each decision, by the map as it is then; in the paper
the marks stay those of the allocation.

V is the area of unexplored cells, or of columns of ground (times the height factor, metres), t the seconds
of the drive from rest to rest on the shortest way and of the scan. The paper counts V in terrain points
and gives no unit: its β are taken to count points of {POINT["plans"]:g} m² in plans and of
{POINT["terrains"]:g} m³ over terrain, so that its numbers 1 … 70 reach from well below to well above what
a robot discovers a second. Promises weigh 1/(1 + promises): a literal 1/n_r would make the first one free.
The finishing rule is ours: (V + v)/t with v = {BONUS["plans"]:g} m² in plans and {BONUS["terrains"]:g} m³
over terrain. The metrics of Yamauchi and Burgard stand on these same candidates; so they are not the rules
of those papers. What holds over them need not hold over `nearest-frontier` and `coordinated-frontier`, which
weigh every frontier cell and may replan under way (docs/explorers.md); these stand beside V/t in the
scoreboard.
Who waits for a synchronous team scans meanwhile, and so leaves up to 2 s after the last has
scanned."""

_FIGURES = """The paper's curves are pictures without numbers; what its text says of them stands in the table
of claims, and as a star or a dotted line below."""

_HOLDS = """Relative times are over the mean of asynchronous V/t in the same world with the same team, so
that all weigh alike; ratios are of their means. Missions of all team sizes in one world with one seed have
the same plan or ground and count as one; 95 % bootstrap intervals are over these, paired by world and
seed. (The three fractal terrains of a seed are nearly the same hills, rougher and smoother, and `dem` is
one world from different starts: over terrain the intervals are rather too narrow.) "Faster" holds if the
whole interval is below 1. The best β is chosen from the same missions, which favours it over V/t, and over
the extremes; only where worlds have their own, others judge."""

_MAPS = f"""Teams of {MAP_TEAM}, the settings of the other plans, cells resampled to 0.1 m, up to
{MAP_STARTS} starts; mean times with 95 % intervals, and median seconds of computing on one thread."""

_CHANGED = f"""Teams of {CHANGED_TEAM}, V/t over another method. "Holds with" lists the changes with which
V/t is faster, and faster against the same method than it is without (95 % intervals of the ratio, and of
the ratio of the two ratios, wholly below 1): what is changed there is a cause. The best β moves with a
change, so V/t is held against the faster of the two β that were run with it. The tables after it give
every ratio, and beside them V/t and the other method each over itself as it is, to 95 %: so one sees which
of the two a change helps or hurts."""


def _times_table(records: Records, part: str) -> str:
    """Relative times of every method at the three ends, and scans."""
    world, n = worlds_in(records, part)[0], teams_in(records, part)[0]
    prefix = cell_id(world, n, "")
    rows = []
    for method in [name[len(prefix) :] for name in records if name.startswith(prefix)]:
        cells = [cell_id(w, k, method) for w in worlds_in(records, part) for k in teams_in(records, part)]
        scans = np.mean([record["scans"] / record["robots"] for cell in cells for record in records[cell]])
        shown = [_interval(mean_interval(relative(records, part, method, end))) for end in ENDS]
        rows.append([f"`{method}`", *shown, f"{_after_99(records, part, method):.0%}", f"{scans:.0f}"])
    head = [
        "method",
        *(f"relative time {text}" for text in ENDS.values()),
        "of it after 99 %",
        "scans a robot",
    ]
    return markdown_table(head, rows)


def _betas_table(records: Records, part: str) -> str:
    """The best β of each team, and what a robot discovers a second meanwhile."""
    plans = worlds_in(records, part) if part == "plans" else ()
    rows, areas_m2 = [], {world: visible_area_m2(world) for world in plans}
    for n in teams_in(records, part):
        best = [best_beta(records, part, end, teams=(n,)) for end in ENDS]
        shown = [f"{_discovered(records, n, areas_m2):.1f}"] if areas_m2 else []
        rows.append([str(n), *(str(beta) for beta in best), *shown])
    head = ["robots", *(f"best β {text}" for text in ENDS.values())]
    head += ["discovered a robot and second, same unit, with the areas of seed 0"] if areas_m2 else []
    return markdown_table(head, rows)


def _discovered(records: Records, n: int, areas_m2: dict[str, float]) -> float:
    """By V/t in plans of these areas up to 95 %, in the paper's numbers; over terrain V is no area alone."""
    rates = [
        0.95 * area_m2 / (n * times(records, cell_id(world, n, "ptv"), "t95_s"))
        for world, area_m2 in areas_m2.items()
    ]
    return float(np.mean(np.concatenate(rates))) / POINT["plans"]


def _causes_table(records: Records, part: str) -> str:
    """With which changes V/t is faster than others, and faster against them than as it is."""
    rows, changes = [], changes_in(records, part)
    everywhere = next(iter(changes.values()))
    for end, text in ENDS.items():
        plain = _other_methods(records, part, None, end, everywhere)
        for name, method in plain.items():
            ratio, causes = changed_ratio(records, None, method, end, everywhere), []
            for change, worlds in changes.items():
                other = _other_methods(records, part, change, end, worlds)[name]
                then = changed_ratio(records, change, other, end, worlds)
                moved = changed_from(records, change, (other, method), end, worlds)
                if then[2] < 1.0 and moved[2] < 1.0:
                    causes.append(f"{CHANGES[part][change].text}: {_interval(then)}")
            listed = "; ".join(causes) or "none that was tried"
            rows.append([f"{name}, {text}", _interval(ratio), "holds as it is" if ratio[2] < 1.0 else listed])
    return markdown_table([f"{PARTS[part]}, V/t is faster than", "as it is", "holds with"], rows)


def _changed_worlds_table(records: Records, part: str) -> str:
    """V/t over the faster of the two β to 95 %, in every world, as it is and with one thing changed."""
    rows, changes = [], changes_in(records, part)
    worlds = next(iter(changes.values()))
    for change in (None, *changes):
        found = []
        for world in worlds:
            other = next(iter(_other_methods(records, part, change, "t95_s", (world,)).values()))
            found.append(_interval(changed_ratio(records, change, other, "t95_s", (world,))))
        rows.append(["as it is" if change is None else CHANGES[part][change].text, *found])
    return markdown_table([f"{PARTS[part]}, V/t over the faster β, to 95 %", *worlds], rows)


def _other_methods(
    records: Records, part: str, change: str | None, end: str, worlds: Sequence[str]
) -> dict[str, str]:
    """Name → method that V/t is compared with; of the two β that are changed, too, the faster one."""
    betas = [method for method in CHANGED_METHODS[part] if method.startswith("beta-")]
    faster = fastest_changed(records, change, betas, end, worlds)
    others = [method for method in CHANGED_METHODS[part][1:] if method not in betas]
    listed = " and ".join(f"`{beta}`" for beta in betas)
    return {f"the faster of {listed}": faster, **{f"`{method}`": method for method in others}}


def _interval(found: tuple[float, float, float]) -> str:
    return "{:.2f} ({:.2f} … {:.2f})".format(*found)


def _changes_table(records: Records, part: str) -> str:
    """V/t over the others with one thing changed, and both over themselves as it is."""
    rows = []
    changes = changes_in(records, part)
    everywhere = next(iter(changes.values()))
    for change in (None, *changes):
        worlds = everywhere if change is None else changes[change]
        for method in CHANGED_METHODS[part][1:]:
            ratios = [_interval(changed_ratio(records, change, method, end, worlds)) for end in ENDS]
            text, itself = ("as it is", ["1", "1"]) if change is None else (CHANGES[part][change].text, [])
            if change is not None:
                both = (changed_itself(records, change, m, "t95_s", worlds) for m in ("ptv", method))
                itself = [_interval(found) for found in both]
            rows.append([text, f"V/t over `{method}`", *ratios, *itself])
    head = [f"changed, {PARTS[part]}", "ratio", *ENDS.values()]
    return markdown_table([*head, "V/t to 95 %, over as it is", "the other's"], rows)


def _worlds_table(records: Records, part: str) -> str:
    """V/t over the best β of all, world by world."""
    rows = []
    for world in worlds_in(records, part):
        ratios = [
            compared(records, part, "ptv", f"beta-{best_beta(records, part, end)}", end, (), (world,))
            for end in ENDS
        ]
        rows.append([world, *(_interval(ratio) for ratio in ratios)])
    heads = [f"{text} (β = {best_beta(records, part, end)})" for end, text in ENDS.items()]
    return markdown_table(["V/t over the best β in", *heads], rows)


def _after_99(records: Records, part: str, method: str) -> float:
    """Share of a mission's time to no frontier that follows 99 %, mean over all missions of a method."""
    cells = [cell_id(w, n, method) for w in worlds_in(records, part) for n in teams_in(records, part)]
    shares = [1.0 - times(records, cell, "t99_s") / times(records, cell, "t_none_s") for cell in cells]
    return float(np.mean(np.concatenate(shares)))

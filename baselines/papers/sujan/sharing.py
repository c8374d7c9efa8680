"""What Sujan's shared maps cost: bits of maps, of quadtrees and of compressed ones, against errors."""

from __future__ import annotations

import itertools
import zlib
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure

from baselines.experiments.claims import Claim, below
from baselines.experiments.experiment import Amount, Experiment, Records
from baselines.experiments.mission import run_mission
from baselines.experiments.plots import COLOURS
from baselines.experiments.rows import Record
from baselines.experiments.statistics import mean_interval, ratio_interval
from baselines.experiments.tables import markdown_table
from baselines.experiments.trials import Cell, CellTrial, trials_of
from baselines.strategies import make_strategy
from entropy_explore_env.belief.map_update import PRIOR_MEAN
from entropy_explore_env.belief.raycast import STOP_AT_COVERED
from entropy_explore_env.envs.parallel_env import EntropyExploreEnv
from entropy_explore_env.missions.view import view_of
from entropy_explore_env.robots.map_summary import decode_map, encode_map, tree_bits
from entropy_explore_env.settings.changes import with_settings
from entropy_explore_env.settings.scenarios import find_scenario

MAKERS = {"occlusions": "nearest-frontier", "office": "nearest-frontier", "terrain": "random"}
"""Scenario → what one robot maps it by."""
SCANS = 60
THRESHOLDS_BITS = (0.0, 0.25, 0.5, 1.0, 2.0, 5.0)
"""Most information content of a region that becomes one leaf."""
_CHOSEN = THRESHOLDS_BITS.index(0.5)
_BITS_PER_VOXEL = 64
"""Of a full map: mean and precision, float32 each."""
GROUPS = {
    "tree-": "the quadtree has fewer bits than the full map, 3 scenarios; ratio",
    "packed-": "the compressed quadtree has fewer bits than the quadtree; ratio",
    "lossless-": "the compressed quadtree has fewer bits than the compressed map; ratio",
}
"""Beginning of ids → what the claims are, on the page."""


def record_summaries(env: EntropyExploreEnv, strategy: str, seed: int) -> Record:
    """Run the mission, and summarise the map of its first robot.

    Returns:
        `full_bits`; `full_packed_bits`, of the same by zlib; `measured`, how many voxels are; and of each
        threshold `tree_bits`, `packed_bits`, `rms_error` of the mean coverage of measured voxels, and
        `wrong`, the share of them that the summary says free and the map covered, or the other way round.
    """
    run_mission(env, make_strategy(strategy), seed)
    view = view_of(env.missions, 0, 0)
    prior = np.float32(view.scenario.sigma_prior**-2)
    measured = view.precision > prior
    mean = np.where(measured, view.mean, np.float32(PRIOR_MEAN))
    precision = np.where(measured, view.precision - prior, np.float32(0.0))
    record: Record = {
        "full_bits": _BITS_PER_VOXEL * mean.size,
        "full_packed_bits": 8 * len(zlib.compress(mean.tobytes() + precision.tobytes())),
        "measured": int(measured.sum()),
        "tree_bits": [],
        "packed_bits": [],
        "rms_error": [],
        "wrong": [],
    }
    for threshold in THRESHOLDS_BITS:
        data = encode_map(mean, precision, threshold)
        said = decode_map(data, mean.shape).mean[measured]
        held = mean[measured]
        record["tree_bits"].append(tree_bits(data, mean.shape))
        record["packed_bits"].append(8 * len(data))
        record["rms_error"].append(round(float(np.sqrt(((said - held) ** 2).mean())), 6))
        flipped = (said > STOP_AT_COVERED) != (held > STOP_AT_COVERED)
        record["wrong"].append(round(float(flipped.mean()), 6))
    return record


def experiment(amount: Amount) -> list[CellTrial]:
    """Return all missions, one a world."""
    settings = {"robots": 1, "ending": {"max_cycles": SCANS, "time_limit_s": 1e6}}
    cells = [
        Cell(name, with_settings(find_scenario(name), settings), strategy, amount.seeds, record_summaries)
        for name, strategy in MAKERS.items()
    ]
    return trials_of(cells)


def all_claims(records: Records) -> list[Claim]:
    """Return every claim."""
    claims = []
    for name in MAKERS:
        tree, packed = (bits_of(records, name, field)[:, _CHOSEN] for field in ("tree_bits", "packed_bits"))
        full, full_packed = (bits_of(records, name, field) for field in ("full_bits", "full_packed_bits"))
        pairs = {"tree": (tree, full), "packed": (packed, tree), "lossless": (packed, full_packed)}
        claims += [below(f"{what}-{name}", ratio_interval(*pair)) for what, pair in pairs.items()]
    return claims


def bits_of(records: Records, cell: str, field: str) -> np.ndarray:
    """Return (N, …) a figure of each mission's map, at each threshold where it depends on that."""
    return np.array([record[field] for record in records[cell]], float)


def _bits_table(records: Records) -> str:
    """Return a table of bits and errors at each threshold."""
    rows = []
    for name, (number, threshold) in itertools.product(MAKERS, enumerate(THRESHOLDS_BITS)):
        bits = [bits_of(records, name, field)[:, number] for field in ("tree_bits", "packed_bits")]
        errors = [bits_of(records, name, field)[:, number].mean() for field in ("rms_error", "wrong")]
        shown = [f"{mean_interval(each):,.0f}" for each in bits]
        rows.append([name, f"{threshold:g}", *shown, f"{errors[0]:.4f}", f"{errors[1]:.2%}"])
    head = ["map", "threshold (bits)", "quadtree (bits)", "compressed (bits)", "rms error", "wrong"]
    return markdown_table(head, rows)


def figure_bits(records: Records) -> Figure:
    """Draw bits of quadtrees, compressed and not, as shares of the full map's, against the error."""
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
        axes.locator_params(axis="x", nbins=4)
    figure.axes[0].set_ylabel("bits over the full map's")
    figure.axes[0].legend(frameon=False)
    return figure


EXPERIMENT = Experiment(
    name="sujan-sharing",
    title="Sujan, shared maps",
    template=Path(__file__).with_name("sharing.md.j2"),
    trials=experiment,
    claims=all_claims,
    groups=GROUPS,
    figures={"bits": figure_bits},
    tables={"bits": _bits_table},
    quick_seeds=4,
)

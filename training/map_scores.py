"""How good predictions of maps are: log loss beside two baselines, calibration, and pictures to look at.

Scores count the cells of a workspace in which nothing was measured, and nothing else. A log loss is in bits a
cell,

    -mean(y log2 p + (1 - y) log2(1 - p)),

with y = 1 where a cell is solid. The base rate is the best constant p for each recipe, which no predictor is
told. `nearest` takes the share of solid cells in samples of training that have the same nearest measured
cell (solid or free) at the same distance. The expected calibration error is the mean of |share solid - mean
p| over ten bins of p, weighed by their cells.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from scipy.ndimage import distance_transform_edt

from baselines.experiments.plots import png
from entropy_explore_env.prediction.crop import OUTSIDE, SOLID
from entropy_explore_env.prediction.predictor import new_predicting
from entropy_explore_env.prediction.unet import Form, Network, fill_unmeasured, infer
from entropy_explore_env.writing import write_atomically
from training.map_samples import RECIPES, STEPS, Samples, as_channels, unmeasured

BINS = 10
_EDGES_M = np.array([0.3, 0.5, 0.9, 1.7, 3.3, 6.5])
"""Distances of the nearest measured cell at which the bins of `nearest` end; farther cells are one more."""
NEAR_M = 4.0
"""Cells as near as this to a measured one are scored once more, by themselves."""
_LEAST = 1e-6
_LEAST_DRAWN = 0.005
"""Bins of fewer cells, as a share of all, are left out of the reliability diagram."""


class Scored(NamedTuple):
    """M cells in which nothing was measured."""

    truth: np.ndarray
    """(M,) bool, whether it is solid."""
    predicted: np.ndarray
    """(M,) probability."""
    nearest: np.ndarray
    """(M,) probability by the nearest measured cell."""
    near: np.ndarray
    """(M,) bool, whether a measured cell is within NEAR_M."""
    recipe: np.ndarray
    """(M,) number in RECIPES."""


def predictions(network: Network, form: Form, samples: Samples) -> np.ndarray:
    """Return (N, L, C, C) float32, the probability to be solid; of measured cells it means nothing."""
    predicting, found = new_predicting(network, form), np.empty(samples.truth.shape, np.float32)
    for solid, cells in zip(found, samples.cells, strict=True):
        solid[:] = -1.0
        infer(network, predicting.planes, as_channels(cells))
        fill_unmeasured(predicting.planes, solid)
    return found


def nearest_bins(cells: np.ndarray, cell_m: float) -> tuple[np.ndarray, np.ndarray]:
    """Return the bin of `nearest` of each cell, and whether it is near; both (N, L, C, C).

    Args:
        cells: (N, 2·L + 1, C, C), channels.
        cell_m: Edge of a cell.
    """
    layers = cells.shape[1] // 2
    bins, near = np.full((len(cells), layers, *cells.shape[2:]), 2 * len(_EDGES_M), np.int64), []
    for number, sample in enumerate(cells):
        measured = (sample[:layers] > 0) | (sample[layers : 2 * layers] > 0)
        inside = sample[2 * layers] == 0
        above = (sample[:layers] == STEPS)[:, inside].all(axis=1)  # layers over the workspace count as solid
        measured[above] = False
        near.append(measured)
        if not measured.any():
            continue
        found: Any = distance_transform_edt(~measured, return_indices=True)
        apart_m, (layer, x, y) = cell_m * found[0], found[1]
        bins[number] = 2 * np.searchsorted(_EDGES_M, apart_m) + (sample[layer, x, y] > 0)
        near[-1] = apart_m <= NEAR_M
    return bins, np.array(near)


def nearest_shares(samples: Samples, cell_m: float) -> np.ndarray:
    """Return (2·B,) float64, the share of solid cells of each bin of `nearest`."""
    asked = unmeasured(samples.cells)
    bins = nearest_bins(samples.cells, cell_m)[0][asked]
    size = 2 * len(_EDGES_M) + 2
    solid = np.bincount(bins, samples.truth[asked], minlength=size)
    return (solid + 1.0) / (np.bincount(bins, minlength=size) + 2.0)


def scored(
    samples: Samples, recipes: np.ndarray, cell_m: float, predicted: np.ndarray, shares: np.ndarray
) -> Scored:
    """Return the cells in which nothing was measured, with what is predicted of them.

    Args:
        samples: N of validation.
        recipes: (N,) number in RECIPES of where each comes from.
        cell_m: Edge of a cell.
        predicted: (N, L, C, C) of a predictor.
        shares: Of `nearest_shares`.
    """
    asked = unmeasured(samples.cells)
    bins, near = nearest_bins(samples.cells, cell_m)
    where = np.broadcast_to(recipes[:, None, None, None], asked.shape)[asked]
    return Scored(samples.truth[asked], predicted[asked], shares[bins[asked]], near[asked], where)


def log_loss_bits(truth: np.ndarray, predicted: np.ndarray) -> float:
    """Return the mean log loss in bits."""
    sure = np.clip(predicted.astype(np.float64), _LEAST, 1.0 - _LEAST)
    return float(-np.log2(np.where(truth, sure, 1.0 - sure)).mean())


def reliability(truth: np.ndarray, predicted: np.ndarray) -> list[list[float]]:
    """Return of each of the bins of p that hold cells: mean p, share of solid cells, number of cells."""
    bins = np.minimum((predicted * BINS).astype(int), BINS - 1)
    counts = np.bincount(bins, minlength=BINS)
    means = np.bincount(bins, predicted, minlength=BINS), np.bincount(bins, truth, minlength=BINS)
    return [
        [float(means[0][k] / counts[k]), float(means[1][k] / counts[k]), int(counts[k])]
        for k in range(BINS)
        if counts[k]
    ]


def calibration_error(table: Sequence[Sequence[float]]) -> float:
    """Return the expected calibration error of a table of `reliability`."""
    cells = sum(row[2] for row in table)
    return sum(row[2] * abs(row[1] - row[0]) for row in table) / cells


def figures_of(cells: Scored) -> dict[str, Any]:
    """Return the figures of all cells, of those that are near, and of each recipe."""
    every = {"all": _figures(cells), "near": _figures(_chosen(cells, cells.near))}
    for number in np.unique(cells.recipe):
        every[RECIPES[number]] = _figures(_chosen(cells, cells.recipe == number))
    return every


def _chosen(cells: Scored, which: np.ndarray) -> Scored:
    return Scored(*(values[which] for values in cells))


def _figures(cells: Scored) -> dict[str, Any]:
    """Return the figures of some cells; the base rate is each recipe's own."""
    rates = np.bincount(cells.recipe, cells.truth) / np.maximum(np.bincount(cells.recipe), 1)
    table = reliability(cells.truth, cells.predicted)
    return {
        "cells": len(cells.truth),
        "solid": float(cells.truth.mean()),
        "base_rate_bits": log_loss_bits(cells.truth, rates[cells.recipe]),
        "nearest_bits": log_loss_bits(cells.truth, cells.nearest),
        "predicted_bits": log_loss_bits(cells.truth, cells.predicted),
        "calibration_error": calibration_error(table),
        "reliability": table,
    }


def table_text(figures: dict[str, Any], left_out: str | None) -> str:
    """Return the figures as a table."""
    lines = [f"{'validation':<22}{'cells':>10}{'solid':>8}{'base':>8}{'nearest':>9}{'network':>9}{'ECE':>8}"]
    for name, row in figures.items():
        shown = f"{name} (left out)" if name == left_out else name
        bits = f"{row['base_rate_bits']:>8.3f}{row['nearest_bits']:>9.3f}{row['predicted_bits']:>9.3f}"
        lines.append(
            f"{shown:<22}{row['cells']:>10,}{row['solid']:>8.3f}{bits}{row['calibration_error']:>8.4f}"
        )
    return "\n".join([*lines, "log loss in bits a cell; ECE = expected calibration error"])


def as_plans(samples: Samples) -> Samples:
    """Return each layer of samples as a sample of one layer."""
    layers = samples.truth.shape[1]
    solid, free = samples.cells[:, :layers], samples.cells[:, layers : 2 * layers]
    outside = np.broadcast_to(samples.cells[:, 2 * layers :], solid.shape)
    cells = np.stack([solid, free, outside], axis=2).reshape(-1, 3, *solid.shape[2:])
    return Samples(cells, samples.truth.reshape(-1, 1, *solid.shape[2:]))


def draw_figure(
    file: Path, samples: Samples, recipes: np.ndarray, predicted: np.ndarray, figures: dict[str, Any]
) -> None:
    """Draw partial maps, their predictions and the truth, one of each recipe, and the reliability diagram.

    Args:
        file: Picture.
        samples: N of validation.
        recipes: (N,) number in RECIPES of where each comes from.
        predicted: (N, L, C, C) of a predictor.
        figures: Of `figures_of`.
    """
    from matplotlib.figure import Figure

    plans, where = as_plans(samples), np.repeat(recipes, samples.truth.shape[1])
    predicted = predicted.reshape(-1, *predicted.shape[2:])
    shown = [_half_seen(plans, np.flatnonzero(where == number)) for number in np.unique(recipes)]
    figure = Figure(figsize=(2.4 * len(shown) + 3.4, 7.4), layout="constrained")
    left, right = figure.subfigures(1, 2, squeeze=False, width_ratios=[2.4 * len(shown), 3.4])[0]
    panels: Any = left.subplots(3, len(shown), squeeze=False)
    for column, number in enumerate(shown):
        cells, asked = plans.cells[number], unmeasured(plans.cells[[number]])[0, 0]
        known = np.where(cells[SOLID] > 0, 1.0, 0.0)
        known[cells[OUTSIDE] > 0] = 1.0
        maps = (
            np.where(asked, np.nan, known),
            np.where(asked, predicted[number], known),
            plans.truth[number, 0],
        )
        for row, (name, values) in enumerate(zip(("measured", "predicted", "true"), maps, strict=True)):
            panel = panels[row, column]
            panel.set_facecolor("#f2c879")  # what is unknown
            panel.imshow(np.asarray(values, float).T, origin="lower", cmap="gray_r", vmin=0.0, vmax=1.0)
            panel.set(xticks=[], yticks=[], title=RECIPES[where[number]] if row == 0 else "")
            if column == 0:
                panel.set_ylabel(name)
    diagram = right.subplots()
    diagram.plot([0, 1], [0, 1], color="#999999", linewidth=1)
    for name, values in figures.items():
        if name in RECIPES:
            table = np.array(values["reliability"])
            table = table[table[:, 2] >= _LEAST_DRAWN * values["cells"]]
            diagram.plot(table[:, 0], table[:, 1], marker=".", label=name)
    diagram.set(xlabel="predicted probability", ylabel="share of solid cells", aspect="equal")
    diagram.legend(frameon=False)
    write_atomically(file, png(figure))


def _half_seen(samples: Samples, those: np.ndarray) -> int:
    """Return the sample of which the largest share is unmeasured, among those at most 0.4 of which are.

    Layers of a volume that hold rock alone are left out.
    """
    those = those[~samples.truth[those].all(axis=(1, 2, 3))]
    shares = unmeasured(samples.cells[those]).mean(axis=(1, 2, 3))
    return int(those[np.argmax(np.where(shares <= 0.4, shares, -shares))])

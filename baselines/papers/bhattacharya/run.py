"""One run of Bhattacharya's simulation as a trial: its plan, its starts, and what is kept of it."""

from __future__ import annotations

import base64
import io
import math
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np

from baselines.experiments.rows import Record
from baselines.experiments.trials import described
from baselines.papers.bhattacharya.simulation.team import Rules, Simulation, Trace
from entropy_explore_env.belief.paths.geodesic_cells import new_tessellation, tessellate
from entropy_explore_env.settings.changes import with_settings
from entropy_explore_env.settings.grid import Grid
from entropy_explore_env.settings.scenarios import find_scenario
from entropy_explore_env.worlds.load import make_world

SNAPSHOTS = 6
"""Moments of a run that are kept for its picture."""
_SNAPSHOT_PERIOD = 100
_KEPT_SERIES = 400


@dataclass(frozen=True)
class Run:
    """One run.

    Attributes:
        cell: Name of the runs that differ by seed.
        world: Name of the recipe.
        shape: Cells of the plan along x and y.
        starts: `random` all over the plan; `cluster`, side by side somewhere; `corner`, in the lower left.
        seed: Of plan, starts and lost messages.
        robots: How many.
        known: Whether the plan is known.
        limit: Most iterations.
        pictured: Whether maps are kept for a picture.
        cell_m: What the recipe takes a cell for.
    """

    cell: str
    world: str
    shape: tuple[int, int]
    starts: Literal["random", "cluster", "corner"]
    seed: int
    robots: int
    rules: Rules
    known: bool
    limit: int
    pictured: bool = False
    cell_m: float = 0.1

    @property
    def settings(self) -> dict[str, Any]:
        """All that decides its record, but the seed."""
        fields = {name: value for name, value in described(self).items() if name not in ("cell", "seed")}
        return {**fields, "rules": described(self.rules)}

    def run(self) -> Record:
        """Carry it out, and return its record with maps for its picture."""
        occupied = self.plan()
        starts = start_cells(occupied, self.starts, self.robots, self.seed)
        simulation = Simulation(occupied, starts, self.rules, self.known, self.seed)
        if not self.pictured:
            return record_of(simulation.run(self.limit, 1 if self.known else 0))
        taken: list[dict[str, np.ndarray]] = []

        def note(goes_on: bool) -> None:
            if len(simulation.trace.places) % _SNAPSHOT_PERIOD == 1 or not goes_on:
                taken.append(_snapshot(simulation))

        trace = simulation.run(self.limit, 0, note)
        chosen = np.unique(np.linspace(0, len(taken) - 1, SNAPSHOTS).round().astype(int))
        maps = {
            f"{name}_{number}": array
            for number, index in enumerate(chosen)
            for name, array in taken[index].items()
        }
        return {**record_of(trace), "maps": packed(maps)}

    def plan(self) -> np.ndarray:
        """Return (X, Y, 1) bool, occupied."""
        grid = Grid((*self.shape, 1), self.cell_m)
        scenario = with_settings(find_scenario(self.world), {"grid": grid})
        return make_world(scenario, np.random.default_rng(self.seed)).occupied


def packed(maps: dict[str, np.ndarray]) -> str:
    """Return arrays as a text that `unpacked` reads."""
    buffer = io.BytesIO()
    np.savez_compressed(buffer, allow_pickle=False, **maps)
    return base64.b64encode(buffer.getvalue()).decode("ascii")


def unpacked(text: str) -> dict[str, np.ndarray]:
    """Return the arrays of a record's maps."""
    with np.load(io.BytesIO(base64.b64decode(text))) as maps:
        return dict(maps)


def start_cells(occupied: np.ndarray, starts: str, robots: int, seed: int) -> list[int]:
    """Return free cells for the robots; those of a cluster are 10 cells apart at least."""
    free = np.flatnonzero(~occupied.reshape(-1))
    rng = np.random.default_rng((seed, 1))
    if starts == "random":
        return rng.choice(free, robots, replace=False).tolist()
    width = occupied.shape[1]
    first = (
        int(free[np.argmin(free // width + free % width)]) if starts == "corner" else int(rng.choice(free))
    )
    space = new_tessellation(occupied.shape)
    tessellate(space, np.where(occupied, np.inf, 1.0).astype(np.float32), np.array([first]))
    costs, found = space.costs.reshape(-1), list[int]()
    for cell in np.argsort(costs, kind="stable"):
        apart = [max(abs(cell // width - f // width), abs(cell % width - f % width)) for f in found]
        if math.isfinite(costs[cell]) and min(apart, default=math.inf) >= 10:
            found.append(int(cell))
        if len(found) == robots:
            break
    return found


def _snapshot(simulation: Simulation) -> dict[str, np.ndarray]:
    """Return robot 0's map and cells, in bytes."""
    planner = simulation.planners[0]
    return {
        "entropy": np.round(255.0 * planner.belief.entropy[:, :, 0] / math.log(2.0)).astype(np.uint8),
        "occupied": planner.belief.occupied[:, :, 0],
        "cells": planner.space.cells[:, :, 0].astype(np.int8),
        "places": simulation.places.copy(),
        "iteration": np.array(len(simulation.trace.places)),
    }


def record_of(trace: Trace) -> Record:
    """Return what the page needs of a run."""
    functional = np.array(trace.functional)
    falls = -np.diff(functional) / functional[:-1] if np.isfinite(functional).all() else np.zeros(0)
    busy = np.array(trace.tessellations) > 0
    rows = np.unique(np.linspace(0, len(trace.places) - 1, _KEPT_SERIES).round().astype(int))
    seconds = np.array(trace.seconds)[1:]
    return {
        "iterations": len(trace.places),
        "ended": trace.ended,
        "cycle": trace.cycle,
        "explored_at": trace.explored_at,
        "seconds_an_iteration": float(seconds.mean()) if len(seconds) else 0.0,
        "seconds_with_tessellation": float(np.median(seconds[busy[1:]])) if busy[1:].any() else 0.0,
        "rises": int((falls < -1e-12).sum()),
        "largest_rise": float(max((-falls).max(initial=0.0), 0.0)),
        "places": trace.places,
        "series": {"iteration": rows.tolist(), "uncertain": np.array(trace.uncertain)[rows].tolist()},
    }

"""The strategy `voronoi`: explore and cover by geodesic Voronoi cells (Bhattacharya, Michael & Kumar 2010).

Each robot parts its own belief among the team, from where it last heard the others, by ways that cost the
entropy along them, and goes to a target in its own cell. A centralised team is the same code with perfect
messages.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Literal

import numpy as np

from baselines.strategies.information_rate.expected_bits import (
    Build,
    build_of,
    free_by_belief,
    new_scratch,
    sees_all_around,
    weigh_viewpoints,
)
from baselines.strategies.protocol import random_viewpoint
from baselines.strategies.voronoi.controls import (
    CellSearch,
    gradient_step,
    nearest_uncertain,
    projected_centroids,
)
from baselines.strategies.voronoi.occupancy_entropy import (
    close_voxels,
    fill_deviation_entropy,
    fill_occupancy_entropy,
    filtered,
)
from entropy_explore_env.belief.paths.geodesic_cells import (
    UNREACHED,
    extract_path,
    new_tessellation,
    tessellate,
)
from entropy_explore_env.belief.visibility import CONE
from entropy_explore_env.missions.view import RobotView
from entropy_explore_env.robots.motion import MoveEnd
from entropy_explore_env.scenario import Scenario
from entropy_explore_env.validation import check, check_choice, check_count

Control = Literal["projected-centroid", "gradient-search", "nearest"]
Metric = Literal["entropy", "length"]
Known = Literal["occupancy", "deviation"]

_GAZES = 16
_PITCHES = (-0.6, 0.0, 0.6)
_NOT_QUITE = 0.999
"""Of the reach, so that rounding does not pull a place towards the robot."""


@dataclass(frozen=True)
class Coverage:
    """How robots share the work.

    Once all is explored the projected centroid may lead robots in circles, as on a known map in the paper's
    reproduction; its guard (`Rules.guarded`) is not part of this strategy, as missions are over by then.

    Attributes:
        control: `projected-centroid` (eqs. 6-8); `gradient-search` (eq. 3), which takes `steps` steps a
            decision and falls back on the projected centroid where none helps and the cell is not explored;
            `nearest`: the uncertain voxel of the own cell that costs least to reach (ours).
        metric: What ways cost until all is explored: `entropy` (sect. 5.2) or `length`.
        known: What makes a voxel certain: its `occupancy` (p = P(c > ½), as in the paper), or its
            `deviation`, which has to fall to the mission's σ_end (ours).
        eta: η, what a voxel edge of way costs besides its entropy.
        tau: τ in nats: from here on a voxel is uncertain.
        tau_floor: τ′, the least density, below τ.
        steps: Steps of the gradient search a decision.
    """

    control: Control = "projected-centroid"
    metric: Metric = "entropy"
    known: Known = "occupancy"
    eta: float = 0.01
    tau: float = 0.35
    tau_floor: float = 0.33
    steps: int = 5

    def __post_init__(self) -> None:
        """Check every field."""
        check_choice(self, "control", Control)
        check_choice(self, "metric", Metric)
        check_choice(self, "known", Known)
        check(self, "eta", "a number from 1e-6 to 1e3", lambda v: 1e-6 <= v <= 1e3)
        check(self, "tau", "a number from 1e-6 to ln 2", lambda v: 1e-6 <= v <= 0.6931)
        check(self, "tau_floor", "a number above 0 and below tau", lambda v: 0.0 < v < self.tau)
        check_count(self, "steps", 1, 1000)


@dataclass
class _Errand:
    """What a robot remembers from one decision to the next."""

    way: np.ndarray = field(default_factory=lambda: np.zeros(0, np.int64))
    """(N,) voxels to the target that are still ahead."""
    to_see: bool = False
    """Whether the target was uncertain when it was chosen."""
    failures: int = 0
    """Drives in a row that something ended early."""


class VoronoiCoverage:
    """Goes to a target in the robot's own geodesic Voronoi cell, and looks where most is to be seen."""

    def __init__(self, coverage: Coverage | None = None) -> None:
        """Take the settings."""
        self.coverage = coverage or Coverage()

    def reset(self, scenario: Scenario, rng: np.random.Generator) -> None:
        """A new mission begins."""
        grid = scenario.grid
        self._rng = rng
        self._errands = [_Errand() for _ in range(scenario.robots)]
        self._builds = [build_of(scenario, kind) for kind in scenario.kinds]
        self._space, self._inner = new_tessellation(grid.shape), new_tessellation(grid.shape)
        self._entropy = np.empty(grid.shape, np.float32)
        self._scratch = new_scratch(grid, self._builds)

    def choose(self, views: Sequence[RobotView]) -> list[np.ndarray]:
        """The viewpoint of each view, by its own belief and where it last heard the others."""
        return [self._choose(view) for view in views]

    def _choose(self, view: RobotView) -> np.ndarray:
        errand, here = self._errands[view.robot], _voxel(view, view.pose)
        ended_early = view.move_end not in (MoveEnd.ARRIVED, MoveEnd.SEEN)
        errand.failures = errand.failures + 1 if ended_early else 0
        if errand.failures > 1:  # choosing again from the same belief would lead here again
            errand.way, errand.failures = errand.way[:0], 0
            return random_viewpoint(view, self._rng)
        entropy = self._uncertainty(view)
        rates = self._rates(view, entropy, here)
        ahead = np.flatnonzero(errand.way == here)
        errand.way = errand.way[ahead[-1] + 1 :] if len(ahead) else errand.way[:0]
        if ended_early or not self._stands(errand, entropy, rates):
            self._choose_target(view, entropy, rates, here)
        return self._towards(view, errand)

    def _uncertainty(self, view: RobotView) -> np.ndarray:
        """(X, Y, Z) float32 nats, filtered."""
        out, mean, precision = self._entropy.reshape(-1), view.mean.reshape(-1), view.precision.reshape(-1)
        if self.coverage.known == "occupancy":
            fill_occupancy_entropy(mean, precision, out)
        else:
            prior, end = view.scenario.sigma_prior**-2, view.scenario.ending.sigma_end**-2
            fill_deviation_entropy(precision, prior, end, out)
        return filtered(self._entropy)

    def _rates(self, view: RobotView, entropy: np.ndarray, here: int) -> np.ndarray:
        """(X, Y, Z) float32, what ways cost by the coverage's metric; inf where the body does not fit."""
        lattice, shape = self._build(view).lattice, view.scenario.grid.shape
        rates = entropy.copy() if self.coverage.metric == "entropy" else np.ones(shape, np.float32)
        x, y, z = (int(i) for i in np.unravel_index(here, shape))
        close_voxels(view.mean, lattice.footprint, lattice.margin, lattice.layer, (x, y, z), rates)
        return rates

    def _stands(self, errand: _Errand, entropy: np.ndarray, rates: np.ndarray) -> bool:
        """Whether a target is still ahead, not seen if that was wanted, and not known to be blocked."""
        if len(errand.way) == 0 or np.isinf(rates.reshape(-1)[errand.way]).any():
            return False
        return not errand.to_see or bool(entropy.reshape(-1)[errand.way[-1]] >= self.coverage.tau)

    def _choose_target(self, view: RobotView, entropy: np.ndarray, rates: np.ndarray, here: int) -> None:
        """Part the belief, and choose the target in the robot's own cell."""
        coverage, errand = self.coverage, self._errands[view.robot]
        sources, own = self._sources(view, here)
        density = np.maximum(entropy, np.float32(coverage.tau_floor))
        by_length = coverage.metric == "length"
        metric = (0.0 if by_length else coverage.eta, by_length)
        tessellate(self._space, rates, sources, *metric)
        targets, uncertain = projected_centroids(self._space.cells, density, coverage.tau, len(sources))
        if not uncertain.any() and not by_length:  # all is explored: what is left is to cover it
            rates, metric = np.where(np.isinf(rates), rates, np.float32(1.0)), (0.0, True)
            tessellate(self._space, rates, sources, *metric)
            targets, uncertain = projected_centroids(self._space.cells, density, coverage.tau, len(sources))
        target = int(targets[own])
        if uncertain[own] and coverage.control == "nearest":
            arrays = self._space.cells, self._space.costs, density
            target = int(nearest_uncertain(*arrays, coverage.tau, len(sources))[own])
        errand.way, errand.to_see = np.zeros(0, np.int64), False
        if coverage.control == "gradient-search":
            errand.way = self._descent(rates, density, own, here, metric)
        if (
            len(errand.way) == 0
            and target != UNREACHED
            and (coverage.control != "gradient-search" or uncertain[own])
        ):
            errand.way = extract_path(self._space, rates, target, *metric)[1:]
            errand.to_see = bool(entropy.reshape(-1)[target] >= coverage.tau)

    def _descent(
        self, rates: np.ndarray, density: np.ndarray, own: int, here: int, metric: tuple[float, bool]
    ) -> np.ndarray:
        """(N,) voxels, the steps of a gradient search; none where no neighbour is better."""
        cell, way = self._space.cells == own, list[int]()
        if not cell.any():
            return np.zeros(0, np.int64)
        search = CellSearch(self._inner, rates, density, cell)
        for _ in range(self.coverage.steps):
            step = gradient_step(search, cell, here, *metric)
            if step == here:
                break
            way.append(step)
            here = step
        return np.array(way, np.int64)

    def _sources(self, view: RobotView, here: int) -> tuple[np.ndarray, int]:
        """Voxels of the robots by number, as far as they were heard, and the place of the own one."""
        heard = {
            mate: _voxel(view, seen.pose) for mate, seen in view.teammates.items() if seen.heard_s >= 0.0
        }
        heard[view.robot] = here
        robots = sorted(heard)
        return np.array([heard[robot] for robot in robots], np.int64), robots.index(view.robot)

    def _towards(self, view: RobotView, errand: _Errand) -> np.ndarray:
        """The farthest place on the way that one drive reaches, and the best gaze there."""
        grid, robot = view.scenario.grid, view.kind.robot
        viewpoint = view.pose.copy()
        places = grid.centre_of(np.stack(np.unravel_index(errand.way, grid.shape), axis=-1))
        if view.planar:
            places[:, 2] = view.pose[2]
        within = np.linalg.norm(places - view.pose[:3], axis=1) <= robot.reach_m * _NOT_QUITE
        for index in np.flatnonzero(within)[::-1]:
            if index == 0 or robot.navigator == "planned" or self._in_sight(view, places[index]):
                viewpoint[:3] = places[index]
                break
        return self._gazing(view, viewpoint)

    def _in_sight(self, view: RobotView, place: np.ndarray) -> bool:
        """Whether the straight way to a place is free by the belief."""
        way = (place - view.pose[:3]) / view.scenario.grid.voxel_size_m
        length = float(np.linalg.norm(way))
        if length < 1e-9:
            return True
        mean, size = view.mean.reshape(-1), view.scenario.grid.shape
        radius = view.kind.robot.body_radius_m / view.scenario.grid.voxel_size_m
        x, y, z = (way / length).tolist()
        start = view.scenario.grid.in_grid_units(view.pose)
        return bool(free_by_belief(mean, size, start, (x, y, z), length, radius, self._scratch))

    def _gazing(self, view: RobotView, viewpoint: np.ndarray) -> np.ndarray:
        """The viewpoint with the gaze from which most bits are expected; as it is for a sensor all around."""
        build, kind = self._build(view), view.kind
        if view.planar and sees_all_around(kind.sensor):
            return viewpoint
        yaws = view.pose[3] + np.arange(_GAZES) * (2.0 * math.pi / _GAZES)
        pitches = (0.0,) if view.planar else _PITCHES
        gazes = np.stack(np.meshgrid(yaws, pitches, indexing="ij"), axis=-1).reshape(-1, 2)
        drawn = np.tile(view.scenario.grid.in_grid_units(viewpoint), (len(gazes), 1))
        drawn[:, 3:] = gazes
        bits, seconds = np.zeros(len(drawn)), np.zeros(len(drawn))
        weigh_viewpoints(
            view.mean.reshape(-1),
            view.precision.reshape(-1),
            view.scenario.grid.shape,
            view.scenario.grid.voxel_size_m,
            view.scenario.grid.in_grid_units(view.pose),
            drawn,
            build.yaws,
            build.pitches,
            build.sight,
            np.zeros(0, CONE),
            (1.0, 1.0, math.inf, 1.0, 0.0),
            True,
            self._scratch,
            bits,
            seconds,
        )
        viewpoint[3:] = gazes[int(np.argmax(bits))]
        return viewpoint

    def _build(self, view: RobotView) -> Build:
        return self._builds[view.robot % len(self._builds)]


def _voxel(view: RobotView, pose: np.ndarray) -> int:
    """Number of the voxel of a pose."""
    grid = view.scenario.grid
    place = np.clip(grid.voxel_of(pose[:3]), 0, np.array(grid.shape) - 1)
    return int(np.ravel_multi_index(tuple(place), grid.shape))

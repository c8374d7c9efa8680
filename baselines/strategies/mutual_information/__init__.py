"""The strategies `mutual-information` and `ground-gradient`: exploration coordinated or not (RochaMI).

A robot goes to the voxel l near it that maximises eq. 13 and looks along the entropy gradient there (eq. 11):

    ‖∇H(l)‖_N · λ(l) · ρ(x, l) · η(l) - κ · ϑ(x, l)

`ground-gradient` is the uncoordinated method, λ = η = 1 and nothing heard of teammates in ρ. What the paper
leaves open, both share:

- H is never negative (belief/visibility.py): gradients between voxels that count as known are 0.
- ‖·‖_N divides by the steepest gradient among the candidates; of equal voxels chance takes one.
- ρ is 1 - max μ over the voxels on the straight line but the last, and 0 where the body would touch
  something that is believed covered, or does not fit at its end.
- Where no candidate is worth anything, and behind a teammate if robots do not wait there, the robot wanders:
  a random viewpoint within reach. So it does where it would choose a viewpoint once too often (a trap).
"""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np

from baselines.strategies.information_rate.expected_bits import announced_cone
from baselines.strategies.mutual_information.candidates import (
    CANDIDATE,
    FACTORS,
    MATE,
    best_candidate,
    steep_voxels,
)
from baselines.strategies.protocol import random_viewpoint
from entropy_explore_env.belief.paths.lattice import new_lattice
from entropy_explore_env.belief.raycast import longest_crossing
from entropy_explore_env.belief.visibility import CONE, mark_cone
from entropy_explore_env.errors import SettingError
from entropy_explore_env.missions.view import RobotView
from entropy_explore_env.robots.motion import MoveEnd
from entropy_explore_env.scenario import Scenario
from entropy_explore_env.settings import RobotKind, gaussian_entropy_bits
from entropy_explore_env.validation import check, check_kind, check_not_negative, check_positive

_ALIKE_RAD = math.radians(15.0)


@dataclass(frozen=True)
class Coordination:
    """How viewpoints are weighed (RochaMI, eq. 13).

    Attributes:
        coordinated: Whether what teammates announce counts: in λ, η and ρ.
        overlap: Whether λ does (eq. 12); else 1.
        overlap_scale: ξ, as a share of what the robot's cone would hold if nothing were known in it.
        interference: η for each teammate in the candidate's cone, in ]0, 1]; 1 = they do not count.
        teammates_block: Whether ρ is 0 where a teammate stands or drives.
        static_reach: Whether ρ heeds what is believed covered; else it is 1.
        occlusion: Whether obstacles hide voxels of cones; the paper's ignore them.
        distance_cost: κ.
        least_radius_m: Candidates lie within r̂ of the latest scan, but at least this far …
        most_radius_m: … and at most this far; never beyond the robot's reach.
        known_sigma: σ of a voxel that counts as known, H = 0; None = the mission's σ_end.
        repeats: A viewpoint chosen so often among the latest decisions is a trap.
        memory: So many decisions.
    """

    coordinated: bool = True
    overlap: bool = True
    overlap_scale: float = 0.1
    interference: float = 0.5
    teammates_block: bool = True
    static_reach: bool = True
    occlusion: bool = False
    distance_cost: float = 0.0
    least_radius_m: float = 0.5
    most_radius_m: float = math.inf
    known_sigma: float | None = None
    repeats: int = 2
    memory: int = 8

    def __post_init__(self) -> None:
        """Check every field."""
        for name in ("coordinated", "overlap", "teammates_block", "static_reach", "occlusion"):
            check_kind(self, name, bool)
        check_positive(self, "overlap_scale", "least_radius_m")
        check_positive(self, "most_radius_m", finite=False)
        check(self, "interference", "a number above 0 up to 1", lambda v: 0 < v <= 1)
        check_not_negative(self, "distance_cost")
        if self.known_sigma is not None:
            check(self, "known_sigma", "None, or a number from 1e-6 to 1e4", lambda v: 1e-6 <= v <= 1e4)
        for name in ("repeats", "memory"):
            check(self, name, "a whole number ≥ 1", lambda v: v >= 1 and v == int(v))
        if self.most_radius_m < self.least_radius_m:
            raise SettingError("Coordination.most_radius_m", self.most_radius_m, "at least least_radius_m")


class _Build(NamedTuple):
    """What a kind of robot is, for kernels."""

    ball: np.ndarray
    """(B, 3) int64, voxels that its body touches, by axis."""
    half_angle_rad: float
    """Of its sensor's widest ray, before it has scanned."""
    space: tuple[np.ndarray, np.ndarray]
    """What `cast_ray` needs."""


@dataclass
class _Memory:
    """Viewpoints that a robot chose lately."""

    chosen: deque[np.ndarray] = field(default_factory=deque)


class MutualInformation:
    """Chooses viewpoints by eq. 13; coordinated or not.

    Attributes:
        coordination: The settings.
        decisions: How many of this mission's decisions followed the rule, and why others wandered: a teammate
            was in the way, no candidate was worth anything, or it was a trap.
    """

    def __init__(self, coordination: Coordination | None = None) -> None:
        """Take the settings."""
        self.coordination = coordination or Coordination()

    def reset(self, scenario: Scenario, rng: np.random.Generator) -> None:
        """A new mission begins."""
        grid, settings = scenario.grid, self.coordination
        self._rng = rng
        self.decisions = {"rule": 0, "blocked": 0, "nothing": 0, "trap": 0}
        self._memories = [_Memory(deque(maxlen=settings.memory)) for _ in range(scenario.robots)]
        self._builds = [self._build(scenario, kind) for kind in scenario.kinds]
        self._marks = np.zeros(grid.voxels, np.uint8)
        self._candidates = np.zeros(0, CANDIDATE)
        self._cone = np.zeros(1, CONE)
        self._factors = np.zeros(1, FACTORS)
        sigma = scenario.ending.sigma_end if settings.known_sigma is None else settings.known_sigma
        self._factors["known_precision"] = sigma**-2
        self._factors["distance_cost"] = settings.distance_cost
        self._factors["static_reach"] = settings.static_reach
        self._factors["interference"] = settings.interference if settings.coordinated else 1.0
        unknown_bits = gaussian_entropy_bits(scenario.sigma_prior) - gaussian_entropy_bits(sigma)
        self._unknown_bits = max(unknown_bits, 0.0)

    def _build(self, scenario: Scenario, kind: RobotKind) -> _Build:
        grid, sensor = scenario.grid, kind.sensor
        radius = kind.robot.body_radius_m / grid.voxel_size_m
        widest = 0.5 * sensor.angular_step_rad * math.hypot(sensor.columns - 1, sensor.rows - 1)
        places = longest_crossing(*grid.shape, math.inf, 1)
        return _Build(
            ball=new_lattice(grid.shape, radius, scenario.layer_of(kind.robot)).footprint,
            half_angle_rad=min(widest, math.pi),
            space=(np.zeros(places, np.int32), np.zeros(places, np.int64)),
        )

    def choose(self, views: Sequence[RobotView]) -> list[np.ndarray]:
        """The viewpoint of each view, by its own belief and what it has heard."""
        return [self._choose(view) for view in views]

    def _choose(self, view: RobotView) -> np.ndarray:
        memory, grid = self._memories[view.robot], view.scenario.grid
        blocked = view.move_end is MoveEnd.TEAMMATE and view.kind.robot.when_blocked == "wander"
        viewpoint = None if blocked else self._best(view)
        if viewpoint is None:
            self.decisions["blocked" if blocked else "nothing"] += 1
            return random_viewpoint(view, self._rng)
        alike = sum(_alike(viewpoint, earlier, grid.voxel_size_m) for earlier in memory.chosen)
        if alike >= self.coordination.repeats:
            memory.chosen.clear()
            self.decisions["trap"] += 1
            return random_viewpoint(view, self._rng)
        memory.chosen.append(viewpoint)
        self.decisions["rule"] += 1
        return viewpoint

    def _best(self, view: RobotView) -> np.ndarray | None:
        """(5,) the viewpoint of eq. 13, map frame; None if no candidate is worth anything."""
        grid, settings = view.scenario.grid, self.coordination
        edge, origin = grid.voxel_size_m, np.asarray(grid.origin_m)
        position = grid.in_grid_units(view.pose)[:3]
        depth_m = max(view.depth_m, settings.least_radius_m)
        most_m = min(settings.most_radius_m, view.kind.robot.reach_m, float(grid.size_m.sum()))
        radius = min(depth_m, most_m) / edge
        candidates = self._near(view, position, radius)
        if len(candidates) == 0:
            return None
        cone = self._own_cone(view, depth_m / edge)
        best = best_candidate(
            candidates,
            self._ranked(candidates, radius),
            (view.mean.reshape(-1), view.precision.reshape(-1), grid.shape),
            (position, radius, view.kind.robot.body_radius_m / edge, self._builds[self._kind(view)].ball),
            self._heard(view),
            cone,
            self._sight(view) if settings.occlusion else None,
            self._marks,
            self._builds[self._kind(view)].space,
            self._factors[0],
        )
        if best < 0:
            return None
        chosen = candidates[best]
        return np.array([*(origin + chosen["place"] * edge), chosen["yaw"], chosen["pitch"]])

    def _kind(self, view: RobotView) -> int:
        return view.robot % len(self._builds)

    def _near(self, view: RobotView, position: np.ndarray, radius: float) -> np.ndarray:
        """(K,) CANDIDATE with a gradient."""
        layer = view.scenario.layer_of(view.kind.robot)
        across = 2 * math.floor(radius) + 3
        most = min(across, view.mean.shape[0]) * min(across, view.mean.shape[1])
        most *= 1 if layer is not None else min(across, view.mean.shape[2])
        if len(self._candidates) < most:
            self._candidates = np.zeros(most, CANDIDATE)
        known = self._factors["known_precision"][0]
        flat = -1 if layer is None else layer
        count = steep_voxels(view.precision, known, position, radius, flat, self._candidates)
        return self._candidates[:count]

    def _ranked(self, candidates: np.ndarray, radius: float) -> np.ndarray:
        """(K,) the candidates, those first that could be worth most; equals in an order of chance."""
        most = candidates["steepness"] / candidates["steepness"].max()
        if self.coordination.distance_cost > 0.0:
            most = most - self.coordination.distance_cost * candidates["distance"] / radius
        shuffled = self._rng.permutation(len(candidates))
        return shuffled[np.argsort(-most[shuffled], kind="stable")]

    def _sight(self, view: RobotView) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        return view.mean.reshape(-1), *self._builds[self._kind(view)].space

    def _own_cone(self, view: RobotView, depth: float) -> np.ndarray:
        """The robot's cone, still without a place; ξ goes with what it could hold."""
        angle = view.half_angle_rad or self._builds[self._kind(view)].half_angle_rad
        self._cone["radius"], self._cone["cosine"] = depth, math.cos(angle)
        voxels = 2.0 / 3.0 * math.pi * depth**3 * (1.0 - math.cos(angle))
        scale_bits = self.coordination.overlap_scale * voxels * self._unknown_bits
        heeded = self.coordination.coordinated and self.coordination.overlap
        self._factors["scale_bits"] = max(scale_bits, 1e-9) if heeded else math.inf
        return self._cone[0]

    def _heard(self, view: RobotView) -> np.ndarray:
        """(M,) MATE of whom the robot has heard; their cones are marked."""
        settings, grid = self.coordination, view.scenario.grid
        mates = [number for number, mate in view.teammates.items() if mate.heard_s >= 0.0]
        if not settings.coordinated or not mates:
            return np.zeros(0, MATE)
        heard = np.zeros(len(mates), MATE)
        self._marks[:] = 0
        sight = self._sight(view) if settings.occlusion else None
        own_m = view.kind.robot.body_radius_m
        for place, number in enumerate(mates):
            mate = view.teammates[number]
            under_way = mate.announced_s >= mate.heard_s
            touching_m = own_m + view.scenario.kind_of(number).robot.body_radius_m
            heard[place]["begin"] = grid.in_grid_units(mate.pose)[:3]
            heard[place]["end"] = grid.in_grid_units(mate.viewpoint if under_way else mate.pose)[:3]
            heard[place]["touching"] = touching_m / grid.voxel_size_m if settings.teammates_block else -1.0
            if settings.overlap and mate.announced_s >= 0.0 and mate.depth_m > 0.0:
                mark_cone(announced_cone(grid, mate), grid.shape, sight, self._marks)
        return heard


def _alike(one: np.ndarray, other: np.ndarray, voxel_size_m: float) -> bool:
    """Whether two viewpoints are less than a voxel and 15° apart."""
    turn = abs((one[3] - other[3] + math.pi) % (2.0 * math.pi) - math.pi)
    near = float(np.abs(one[:3] - other[:3]).max()) < voxel_size_m
    return near and max(turn, abs(one[4] - other[4])) < _ALIKE_RAD

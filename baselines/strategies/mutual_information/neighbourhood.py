"""What eq. 13 of RochaMI is evaluated on: voxels near a robot, its cone, and what it heard of teammates."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from baselines.strategies.mutual_information.candidates import MATE, Body, Factors, Team, best_candidate
from entropy_explore_env.belief.paths.lattice import new_lattice
from entropy_explore_env.belief.raycast import Crossing, longest_crossing
from entropy_explore_env.belief.visibility import CONE, mark_cones
from entropy_explore_env.frontiers.knowledge import announced_cone, belief_of
from entropy_explore_env.robots.knowledge import RobotKnowledge
from entropy_explore_env.settings.ending import gaussian_entropy_bits
from entropy_explore_env.settings.scenario import Scenario
from entropy_explore_env.settings.validation import check_kind, check_not_negative
from entropy_explore_env.viewpoints.gradient_candidates import gradient_candidates

_OVERLAP_SCALE = 0.1
"""ξ, as a share of what the robot's cone would hold if nothing were known in it."""
_LEAST_RADIUS_M = 0.5
"""Lower bound of the radius within which candidates lie, which is r̂ of the latest scan or the reach."""


@dataclass(frozen=True)
class MutualInformationConfig:
    """How viewpoints are weighed (RochaMI, eq. 13).

    Attributes:
        coordinated: Whether λ, η and ρ use what teammates announce.
        distance_cost: κ.
    """

    coordinated: bool = True
    distance_cost: float = 0.0

    def __post_init__(self) -> None:
        """Check every field."""
        check_kind(self, "coordinated", bool)
        check_not_negative(self, "distance_cost")


class Neighbourhood:
    """Finds the best viewpoint of eq. 13 near a robot; memory is shared by the robots of a mission."""

    def __init__(self, config: MutualInformationConfig, scenario: Scenario, rng: np.random.Generator) -> None:
        """Begin a mission; `rng` decides between equal voxels."""
        self.config, self._rng, grid = config, rng, scenario.grid
        self._footprints = [
            new_lattice(
                grid.shape, kind.robot.planning_radius_m / grid.voxel_size_m, scenario.layer_of(kind.robot)
            ).footprint
            for kind in scenario.kinds
        ]
        longest = longest_crossing(*grid.shape, math.inf, 1)
        self._crossing = Crossing(np.zeros(longest, np.int32), np.zeros(longest, np.int64))
        self._marks = np.zeros(grid.voxels, np.uint8)
        sigma = scenario.ending.sigma_end
        self._known_precision = float(sigma**-2)
        unknown_bits = gaussian_entropy_bits(scenario.sigma_prior) - gaussian_entropy_bits(sigma)
        self._unknown_bits = max(unknown_bits, 0.0)

    def best(self, view: RobotKnowledge) -> np.ndarray | None:
        """Return the viewpoint (5,) of eq. 13, map frame; None if no candidate has a gain above 0."""
        grid, robot = view.scenario.grid, view.kind.robot
        edge, origin = grid.voxel_size_m, np.asarray(grid.origin_m)
        position = grid.in_grid_units(view.pose)[:3]
        depth_m = max(view.depth_m, _LEAST_RADIUS_M)
        radius = min(depth_m, robot.reach_m, float(grid.size_m.sum())) / edge
        layer = view.scenario.layer_of(robot)
        candidates = gradient_candidates(view.precision, self._known_precision, position, radius, layer)
        if len(candidates) == 0:
            return None
        x, y, z = position.tolist()
        footprint = self._footprints[view.robot % len(self._footprints)]
        cone, scale_bits = self._own_cone(view, depth_m / edge)
        best = best_candidate(
            candidates,
            self._order(candidates, radius),
            belief_of(view),
            Body((x, y, z), radius, float(robot.planning_radius_m / edge), footprint, self._crossing),
            Team(self._heard(view), self._marks),
            cone,
            Factors(float(self.config.distance_cost), scale_bits, self._known_precision),
        )
        if best < 0:
            return None
        chosen = candidates[best]
        return np.array([*(origin + chosen["place"] * edge), chosen["yaw"], chosen["pitch"]])

    def _order(self, candidates: np.ndarray, radius: float) -> np.ndarray:
        """Return the (K,) candidates by the upper bound of their value, highest first; ties at random."""
        most = candidates["steepness"] / candidates["steepness"].max()
        if self.config.distance_cost > 0.0:
            most = most - self.config.distance_cost * candidates["distance"] / radius
        shuffled = self._rng.permutation(len(candidates))
        return shuffled[np.argsort(-most[shuffled], kind="stable")]

    def _own_cone(self, view: RobotKnowledge, depth: float) -> tuple[np.ndarray, float]:
        """Return the robot's cone, without an apex yet, and ξ, a share of the bits that it could hold."""
        sensor = view.kind.sensor
        widest = 0.5 * sensor.angular_step_rad * math.hypot(sensor.columns - 1, sensor.rows - 1)
        cone = np.zeros(1, CONE)
        cosine = math.cos(view.half_angle_rad or min(widest, math.pi))  # before the first scan the widest ray
        cone["radius"], cone["cosine"] = depth, cosine
        voxels = 2.0 / 3.0 * math.pi * depth**3 * (1.0 - cosine)
        return cone[0], max(_OVERLAP_SCALE * voxels * self._unknown_bits, 1e-9)

    def _heard(self, view: RobotKnowledge) -> np.ndarray:
        """Return the teammates that the robot has heard, (M,) MATE, and mark the voxels of their cones."""
        grid = view.scenario.grid
        mates = [number for number, mate in view.teammates.items() if mate.heard_s >= 0.0]
        if not self.config.coordinated or not mates:
            return np.zeros(0, MATE)
        heard, cones = np.zeros(len(mates), MATE), []
        self._marks[:] = 0
        own_m = view.kind.robot.body_radius_m
        for place, number in enumerate(mates):
            mate = view.teammates[number]
            under_way = mate.announced_s >= mate.heard_s
            touching_m = own_m + view.scenario.kind_of(number).robot.body_radius_m
            heard[place]["begin"] = grid.in_grid_units(mate.pose)[:3]
            heard[place]["end"] = grid.in_grid_units(mate.viewpoint if under_way else mate.pose)[:3]
            heard[place]["touching"] = touching_m / grid.voxel_size_m
            if mate.announced_s >= 0.0 and mate.depth_m > 0.0:
                cones.append(announced_cone(grid, mate))
        mark_cones(np.array(cones, CONE), grid.shape, self._marks, 1)
        return heard

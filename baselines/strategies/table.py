"""The table of strategies: each one's name, family, factory, and one line that says what it does.

`--help`, the lists in docs/strategies.md, the suites' strategies and "did you mean" are made from it. In the
lines h is a voxel's entropy, μ its expected coverage, V what would newly be seen, t seconds of driving,
turning and scanning, d the length of a path through known free space, r the robot's place, v one that it can
go to.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from enum import Enum
from functools import partial
from types import MappingProxyType

from baselines.strategies.protocol import Strategy
from baselines.strategies.rules.assigned_frontier import AssignedFrontier
from baselines.strategies.rules.cliff import CliffNextBestView
from baselines.strategies.rules.cliff_raster import CliffRaster
from baselines.strategies.rules.coordinated_frontier import CoordinatedFrontier
from baselines.strategies.rules.distance_advantage import DistanceAdvantage
from baselines.strategies.rules.gradient import GradientStrategy
from baselines.strategies.rules.information_gain import InformationGain
from baselines.strategies.rules.most_unmapped import LeastMapped, MostUnmapped, RandomKnown
from baselines.strategies.rules.mutual_information import MutualInformation
from baselines.strategies.rules.nearest_frontier import NearestFrontier
from baselines.strategies.rules.next_best_view import NextBestView
from baselines.strategies.rules.per_time_visibility import PerTimeVisibility
from baselines.strategies.rules.random_walk import RandomWalk
from baselines.strategies.rules.raster import Raster
from baselines.strategies.rules.receding_horizon import RecedingHorizon
from baselines.strategies.rules.voronoi import VoronoiCoverage
from entropy_explore_env.explorer.planned_rate import PlannedRate
from entropy_explore_env.planner.tour import Tour
from entropy_explore_env.planner.weights import shipped_weights


class Family(Enum):
    """Where strategies come from."""

    PAPER = "Of the five papers, and a random walk"
    FRONTIER = "Rules of exploration, as their authors run them"
    OWN = "Our own"
    CLIFF = "For a rover above a cliff alone"


_EVERYWHERE = ("plans", "volumes", "teams", "others")
_NAMED_SUITES = ("plans", "volumes", "teams")
_TEAM_SUITES = ("volumes", "teams")
_C2 = ("c2",)


@dataclass(frozen=True)
class Entry:
    """A strategy of the package.

    Attributes:
        name: What `--strategy` takes.
        make: Makes a new strategy.
        line: What it does, with its source.
        suites: Names of the suites whose tables it stands in; variants of a rule stand in none, nor do rules
            that coordinate teams where one robot explores.
    """

    name: str
    make: Callable[[], Strategy]
    line: str
    suites: tuple[str, ...] = ()


_PAPER = (
    Entry("random", RandomWalk, "any viewpoint within reach, any gaze", _EVERYWHERE),
    Entry(
        "gradient",
        GradientStrategy,
        "argmax ‖∇h(l)‖ (1 - μ(l)) over the voxels l within reach, gaze along ∇h; planar robots as "
        "`gradient-plane` (Rocha04, eqs. 32-34)",
        _EVERYWHERE,
    ),
    Entry(
        "gradient-plane",
        partial(GradientStrategy, motion_plane=True),
        "argmax ρ(l) ‖proj ∇h(l)‖ (1 - μ(l)), proj on the plane of motion, ρ reachability (Rocha04, eqs. "
        "35-40)",
    ),
    Entry(
        "mutual-information",
        MutualInformation,
        "argmax ‖∇H(l)‖ λ(l) ρ(l) η(l) - κ ϑ(l), λ = exp(-I/ξ) with I what teammates announced to see there, "
        "η teammates in the view, ϑ distance (RochaMI, eqs. 11-13)",
        _NAMED_SUITES,
    ),
    Entry(
        "ground-gradient",
        partial(MutualInformation, coordinated=False),
        "`mutual-information` without teammates: λ = η = 1 (RochaMI)",
    ),
    Entry(
        "voronoi",
        VoronoiCoverage,
        "the centroid Σ q φ(q)/Σ φ(q) of the robot's geodesic cell of its own map, whose paths cost "
        "(e(s) + e(t))/2 + η‖s - t‖, e entropy (Bhattacharya, eqs. 6-8)",
        _TEAM_SUITES,
    ),
    Entry(
        "next-best-view",
        NextBestView,
        "argmax (NI - w_d d - w_LE LE)(1 - P_occ) over poses in known free space, NI new information, LE how "
        "much less exactly a drifting robot will know its pose there (Sujan, eq. 23, method (v))",
        _EVERYWHERE,
    ),
    Entry(
        "most-unmapped",
        MostUnmapped,
        "the pose that shows the largest unmapped region (Sujan, method (iii))",
    ),
    Entry(
        "least-mapped",
        LeastMapped,
        "the pose that shows the smallest mapped region (Sujan, method (iv))",
    ),
    Entry(
        "random-known",
        RandomKnown,
        "any pose in known free space (Sujan, method (i))",
    ),
    Entry(
        "raster",
        Raster,
        "the next place in row order, looking in all directions (Sujan, method (ii))",
    ),
    Entry(
        "per-time-visibility",
        PerTimeVisibility,
        "argmax V/t over frontier candidates; over terrain V/t (z_f - z_av)^γ z_f^(1-γ); points promised to "
        "n others weigh 1/n (Sawhney)",
        _EVERYWHERE + _C2,
    ),
)
_FRONTIER = (
    Entry("nearest-frontier", NearestFrontier, "argmin d(r, v) (Yamauchi 1997)", _EVERYWHERE + _C2),
    Entry(
        "coordinated-frontier",
        CoordinatedFrontier,
        "argmax U(v) - β d(r, v)/R, U(v) = 1 - Σ max(1 - |v - t|/R, 0) over teammates' targets t, R the "
        "sensor's range (Burgard 2005)",
        _TEAM_SUITES + _C2,
    ),
    Entry(
        "assigned-frontier",
        AssignedFrontier,
        "the nearest cell of the group of frontier cells that the optimal assignment gives the robot "
        "(Hungarian method)",
        _TEAM_SUITES,
    ),
    Entry(
        "information-gain",
        InformationGain,
        "argmax λ log(1 + gain(v)) - d(r, v), gain: unknown voxels that would be seen from v (as compared in "
        "Ericson 2025)",
        _NAMED_SUITES,
    ),
    Entry(
        "distance-advantage",
        DistanceAdvantage,
        "argmax mean over u of d(u, v) - d(r, v), u the free cells around the robot (Ericson, Pedro & "
        "Jensfelt 2025)",
        _NAMED_SUITES + _C2,
    ),
    Entry(
        "receding-horizon",
        RecedingHorizon,
        "first edge of the random tree's branch with the greatest Σ unknown(n) exp(-λ c(n)) (Bircher 2016)",
        _NAMED_SUITES,
    ),
    Entry(
        "tour",
        Tour,
        "first place of a short open tour through near viewpoints and far regions (after TARE, Cao 2021)",
        _NAMED_SUITES + _C2,
    ),
)
_OWN = (
    Entry(
        "planned-rate",
        PlannedRate,
        "argmax of expected bits for their time, over viewpoints nearby and far places on planned paths; "
        "short tours through frontier cells where ground robots see all of a plan and drones gain little",
        _EVERYWHERE + _C2,
    ),
    Entry(
        "pretrained:plans",
        partial(PlannedRate, shipped_weights("plans")),
        "`planned-rate` that chooses among 12 candidates by learned weights of 19 features",
        _NAMED_SUITES,
    ),
    Entry(
        "voronoi-nearest",
        partial(VoronoiCoverage, "nearest"),
        "the nearest uncertain voxel of the robot's geodesic cell",
    ),
)
_CLIFF = (
    Entry(
        "cliff-raster-fixed-yaw",
        partial(CliffRaster, turning=False),
        "raster on the plateau, in one direction (Sujan, method 1)",
    ),
    Entry(
        "cliff-raster",
        CliffRaster,
        "raster on the plateau, in all directions (Sujan, method 2)",
    ),
    Entry(
        "cliff-straight-edge",
        partial(CliffNextBestView, "line", interest_decay=0.0),
        "`cliff-polygon-edge` with the edge a straight line (Sujan, method 3)",
    ),
    Entry(
        "cliff-polygon-edge",
        partial(CliffNextBestView, interest_decay=0.0),
        "`cliff-next-best-view` without the interest function (Sujan, method 4)",
    ),
    Entry(
        "cliff-next-best-view",
        CliffNextBestView,
        "argmax NI - w_d d over poses on the rover's plateau, NI over its elevation map, with the interest "
        "function (Sujan, eqs. 3, 5, 9, method 5)",
    ),
)
TABLE = MappingProxyType(
    {Family.PAPER: _PAPER, Family.FRONTIER: _FRONTIER, Family.OWN: _OWN, Family.CLIFF: _CLIFF}
)
"""Family → its strategies."""


def _factories(*families: Family) -> MappingProxyType[str, Callable[[], Strategy]]:
    return MappingProxyType({entry.name: entry.make for family in families for entry in TABLE[family]})


STRATEGIES = _factories(Family.PAPER, Family.FRONTIER, Family.OWN)
"""Name → a function that makes the strategy."""
CLIFF_STRATEGIES = _factories(Family.CLIFF)
"""The strategies for rovers above a cliff; the word `all` leaves them out."""
ALIASES: MappingProxyType[str, str] = MappingProxyType({"best": "planned-rate"})
"""Alias → the name that tables and records hold."""


def help_text() -> str:
    """Return what `--help` says of the strategies of the package: a paragraph of names for each family."""
    return "\n".join(
        f"{family.value}: {', '.join(entry.name for entry in entries)}." for family, entries in TABLE.items()
    )


def suite_names(suite: str) -> tuple[str, ...]:
    """Return the names of the strategies that stand in a suite's table."""
    return tuple(entry.name for entries in TABLE.values() for entry in entries if suite in entry.suites)


def markdown_list(family: Family) -> str:
    """Return a family's strategies as a list in Markdown: name and line."""
    return "\n".join(f"- `{entry.name}`: {entry.line}" for entry in TABLE[family])

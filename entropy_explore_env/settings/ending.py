"""When a mission is over."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Literal

from entropy_explore_env.errors import SettingError
from entropy_explore_env.settings.grid import MAX_VOXELS
from entropy_explore_env.settings.validation import check, check_count, check_fields, check_within

BITS_OF_UNIT_GAUSSIAN = 0.5 * math.log2(2.0 * math.pi * math.e)
"""Differential entropy of N(0, 1) in bits: Rocha04, eq. 15 at σ = 1."""

SIGMA_PRIOR = 30.0
"""Standard deviation of the coverage of a voxel that was never measured (Rocha04, table 2)."""


def gaussian_entropy_bits(sigma: float) -> float:
    """Return the differential entropy of a Gaussian in bits, log2 √(2πe) + log2 σ (Rocha04, eq. 15)."""
    return BITS_OF_UNIT_GAUSSIAN + math.log2(sigma)


@dataclass(frozen=True)
class Ending:
    """When a mission is over: by the entropy of maps (Rocha04, eq. 41), or by what the team has seen.

    The threshold is the entropy of a map in which every voxel that can be seen at all has the
    standard deviation `sigma_end`; where everything can be seen it is V·h(σ_end), as in Rocha04.

    With `seen_share` or `unseen_free_voxels`, one of the two, the threshold ends nothing; rewards are still
    counted in shares of it. A voxel is seen when some robot has measured it at least once. What can be seen
    are those voxels of `World.visible`, the free ones that are connected with where robots can be and the
    solid ones beside them, that are in line of sight and range of a place that a body of the team can reach
    from its start: behind a gap too narrow for bodies only what beams through it reach
    (`worlds.sight.visible_from`). Nothing acts on it: the mission keeps the joint map for it
    (`Scenario.track_truth`). Such a mission is cut off (`MissionEnd.EXHAUSTED`) when the team has seen all
    that robots can drive up to, and has long driven without seeing anything new: the rest lies behind such
    gaps (`missions.endings.exhausted`). A mission that ends by entropy needs no such end, as measuring again
    what is in reach lowers the entropy without bound.

    Attributes:
        sigma_end: Standard deviation of coverage at which a voxel counts as known.
        termination: Whose map has to pass the threshold: `any` robot's, that of `all` robots, or with
            `shared` that of every robot that has not stopped for good (`Faults.stop`). With `seen_share` or
            `unseen_free_voxels`, `any` and `all` mean what the team has seen together, `shared` what each
            such robot's own map holds, and `one` what the own map of at least one of them holds. By entropy,
            `one` is `any` among the robots that have not stopped for good.
        seen_share: Share of what can be seen at which the mission ends; None = by entropy.
        unseen_free_voxels: Number of unseen free voxels, of those that can be seen, at which the mission
            ends; None = by entropy, or by `seen_share`.
        return_to_start: With `seen_share` or `unseen_free_voxels`: the mission ends when so much is seen and
            every robot that still works stands where it started, up to the width of its body. Frontier rules
            and `planned-rate` drive home when they find no frontier.
        time_limit_s: Simulated time after which the mission is cut off (a truncation), 1e-3 to 1e9; inf =
            never.
        max_cycles: Steps after which the mission is cut off; None = never.
    """

    sigma_end: float = 0.03
    termination: Literal["any", "all", "shared", "one"] = "any"
    seen_share: float | None = None
    unseen_free_voxels: int | None = None
    return_to_start: bool = False
    time_limit_s: float = 10_000.0
    max_cycles: int | None = None

    def __post_init__(self) -> None:
        """Check every field."""
        check_fields(self)
        allowed = f"a number from 1e-4 to below {SIGMA_PRIOR:g}, the σ of what was never measured"
        check(self, "sigma_end", allowed, lambda v: 1e-4 <= v < SIGMA_PRIOR)
        if self.seen_share is not None:
            check(self, "seen_share", "None, or a number above 0 up to 1", lambda v: 0 < v <= 1)
        if self.unseen_free_voxels is not None:
            check_count(self, "unseen_free_voxels", 0, MAX_VOXELS)
            if self.seen_share is not None:
                allowed = "None where seen_share is given"
                raise SettingError("Ending.unseen_free_voxels", self.unseen_free_voxels, allowed)
        if self.return_to_start and (not self.by_seen or self.termination in ("shared", "one")):
            allowed = "False, unless a mission ends by what the team has seen, and termination is any or all"
            raise SettingError("Ending.return_to_start", True, allowed)
        check_within(self, "time_limit_s", least=1e-3, most=1e9, inf=True)
        if self.max_cycles is not None:
            check_count(self, "max_cycles", 1, 2**62)

    @property
    def by_seen(self) -> bool:
        """Whether a mission ends by what the team has seen, and not by entropy."""
        return self.seen_share is not None or self.unseen_free_voxels is not None

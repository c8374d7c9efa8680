"""What a robot's range sensor measures."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from entropy_explore_env.errors import SettingError
from entropy_explore_env.settings.validation import check, check_count, check_within, is_number


@dataclass(frozen=True)
class RangeSensor:
    """A range sensor that samples yaw and pitch around its gaze (Rocha04, eqs. 3-5, table 1).

    Attributes:
        field_of_view_rad: Full widths (yaw, pitch); (π/6, π/12) at π/90 gives 16 × 8 rays.
        angular_step_rad: Angle between neighbouring rays.
        max_range_m: Farthest return, 1e-6 to 1e6; inf = the workspace's boundary, which is a wall.
        sigma_min: Standard deviation of coverage right before the sensor (eq. 5).
        sigma_slope_per_m: Growth of that standard deviation with the measured distance, ζ (eq. 5), 0 to 1e6;
            per mⁿ.
        sigma_exponent: Power n of the distance with which it grows, 0.25 to 4: 1 in eq. 5, 2 for stereo
            cameras (Sujan, eq. 4).
        range_noise_m: Standard deviation of the measured distance, 0 to 1e6.
        voxels_behind: Voxels behind the hit that a ray still updates (as covered: eq. 4).
        scan_time_s: Duration of a scan, standing still, 1e-4 to 1e5.
        scan_every_m: Distance between scans under way, 1e-3 to 1e6, which take no time; inf = scans only on
            arrival.
        min_range_m: Nearest return, as of a depth camera that is blind close by. A nearer return brings no
            measurement along its ray; farther ones measure all that they cross.
    """

    field_of_view_rad: tuple[float, float] = (math.pi / 6, math.pi / 12)
    angular_step_rad: float = math.pi / 90
    max_range_m: float = math.inf
    sigma_min: float = 0.08
    sigma_slope_per_m: float = 0.006
    sigma_exponent: float = 1.0
    range_noise_m: float = 0.0
    voxels_behind: int = 1
    scan_time_s: float = 0.5
    scan_every_m: float = math.inf
    min_range_m: float = 0.0

    def __post_init__(self) -> None:
        """Check every field."""
        limits = (2 * math.pi, math.pi)
        view = self.field_of_view_rad
        if (
            not isinstance(view, tuple)
            or len(view) != 2
            or not all(is_number(v) and 0 <= v <= limit + 1e-9 for v, limit in zip(view, limits, strict=True))
        ):
            raise SettingError(
                "RangeSensor.field_of_view_rad", view, "a tuple (yaw in [0, 2π], pitch in [0, π])"
            )
        check_within(self, "scan_time_s", least=1e-4, most=1e5)
        check_within(self, "scan_every_m", least=1e-3, most=1e6, inf=True)
        check(self, "angular_step_rad", "a finite number ≥ 1e-6", lambda v: 1e-6 <= v < math.inf)
        check_within(self, "max_range_m", least=1e-6, most=1e6, inf=True)
        check_within(self, "sigma_slope_per_m", "range_noise_m", least=0, most=1e6)
        check(self, "min_range_m", "a number ≥ 0 below max_range_m", lambda v: 0 <= v < self.max_range_m)
        check(self, "sigma_min", "a number from 1e-4 to 1e4", lambda v: 1e-4 <= v <= 1e4)
        check_within(self, "sigma_exponent", least=0.25, most=4)
        check_count(self, "voxels_behind", 0, 1000)
        if self.rays > 1_000_000:
            raise SettingError(
                "RangeSensor.angular_step_rad", self.angular_step_rad, "at most 1,000,000 rays"
            )

    @property
    def columns(self) -> int:
        """Rays side by side; a full turn is not closed by a second ray at its end."""
        return self._samples(self.field_of_view_rad[0], closed=True)

    @property
    def rows(self) -> int:
        """Rays above each other."""
        return self._samples(self.field_of_view_rad[1], closed=False)

    @property
    def rays(self) -> int:
        """R, rays of a scan."""
        return self.columns * self.rows

    def _samples(self, width_rad: float, closed: bool) -> int:
        steps = math.floor(width_rad / self.angular_step_rad + 1e-9)
        full_turn = closed and width_rad > 2 * math.pi - self.angular_step_rad / 2
        return max(steps, 1) if full_turn else steps + 1


def centred_angles(samples: int, step_rad: float) -> np.ndarray:
    """Return (samples,) float64 angles around a gaze, in its middle, `step_rad` apart."""
    return (np.arange(samples) - (samples - 1) / 2.0) * step_rad

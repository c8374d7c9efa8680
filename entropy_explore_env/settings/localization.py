"""How a robot's estimate of its pose drifts away from the truth."""

from __future__ import annotations

from dataclasses import dataclass, fields

from entropy_explore_env.settings.validation import check_within


@dataclass(frozen=True)
class Localization:
    """How a robot's estimate of its pose (x, y, z, yaw) drifts away from the truth; by default it does not.

    The errors of dead reckoning are independent from one piece of a drive to the next. So their variance
    grows with the distance, not their standard deviation, as that of a random walk: with
    `xy_m_per_sqrt_m=0.02` the standard deviation of x, and that of y, is 0.02 m after a metre, 0.04 m after
    four and 0.2 m after a hundred. What an error of the yaw does to the place of a robot that drives on comes
    on top of it: after L more metres that is L times the error. A robot starts exactly where it believes, and
    a planar one knows its height throughout.

    Attributes:
        xy_m_per_sqrt_m: Standard deviation of x, and of y, after a metre driven, 0 to 100.
        z_m_per_sqrt_m: Standard deviation of the height of a flying robot after a metre driven, 0 to 100.
        yaw_rad_per_sqrt_m: Standard deviation of the yaw after a metre driven, 0 to 10.
        yaw_rad_per_sqrt_rad: Standard deviation of the yaw after a turn of a radian, 0 to 10.
        margin_m: Width added to the body when a robot that drifts plans a path, 0 to 100, so that a small
            error does not lead it into a wall. One or two voxel edges suffice where passages are wide enough;
            true obstacles stop the body itself.
    """

    xy_m_per_sqrt_m: float = 0.0
    z_m_per_sqrt_m: float = 0.0
    yaw_rad_per_sqrt_m: float = 0.0
    yaw_rad_per_sqrt_rad: float = 0.0
    margin_m: float = 0.0

    def __post_init__(self) -> None:
        """Check every field."""
        for each in fields(self):
            check_within(self, each.name, least=0, most=10 if each.name.startswith("yaw") else 100)

    @property
    def drifts(self) -> bool:
        """Whether the estimate ever differs from the truth."""
        return any(getattr(self, each.name) > 0.0 for each in fields(self) if each.name != "margin_m")

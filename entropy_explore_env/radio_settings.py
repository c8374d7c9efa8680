"""How radio waves weaken between robots: settings of a channel that reaches by signal strength."""

from __future__ import annotations

from dataclasses import dataclass

from entropy_explore_env.validation import check_within


@dataclass(frozen=True)
class Signal:
    """The log-distance path loss with walls (Motley & Keenan 1988; Rappaport 2002, sect. 4.11).

    In decibels, of a message from a robot to a teammate d metres away, with w metres of solid voxels on the
    straight line between them:

        received = power_dbm - loss_at_1_m_db - 10 · exponent · log10(max(d, 0.01 m)) - wall_loss_db_per_m · w

    The teammate hears it where that is at least `threshold_dbm`.

    Attributes:
        power_dbm: Of the sender, antennas included, -100 to 100.
        loss_at_1_m_db: In the open, 0 to 200; 40 at 2.4 GHz.
        exponent: How fast the signal weakens in the open, 0 to 10: 2 in free space.
        wall_loss_db_per_m: Of solid voxels, 0 to 1e4.
        threshold_dbm: The weakest signal that is understood, -300 to 100.
    """

    power_dbm: float = 20.0
    loss_at_1_m_db: float = 40.0
    exponent: float = 2.0
    wall_loss_db_per_m: float = 30.0
    threshold_dbm: float = -60.0

    def __post_init__(self) -> None:
        """Check every field."""
        check_within(self, "power_dbm", least=-100, most=100)
        check_within(self, "loss_at_1_m_db", least=0, most=200)
        check_within(self, "exponent", least=0, most=10)
        check_within(self, "wall_loss_db_per_m", least=0, most=1e4)
        check_within(self, "threshold_dbm", least=-300, most=100)

    @property
    def spare_db(self) -> float:
        """What the way beyond the first metre may cost: power - loss at 1 m - threshold."""
        return self.power_dbm - self.loss_at_1_m_db - self.threshold_dbm

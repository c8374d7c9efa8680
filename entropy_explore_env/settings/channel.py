"""What robots tell each other, as settings: what is sent, how far it reaches, what is lost or late."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import Literal

from entropy_explore_env.errors import SettingError
from entropy_explore_env.settings.validation import check, check_count, check_fields, check_within

BITS_PER_MEASUREMENT = 96
BITS_PER_RECEIPT = 48
"""Bits for each teammate in each message, where robots send by need."""


@dataclass(frozen=True)
class Signal:
    """The log-distance path loss with walls (Motley & Keenan 1988; Rappaport 2002, sect. 4.11).

    In decibels, what the way beyond the first metre takes from a message to a teammate d metres away, with w
    metres of solid voxels on the straight line between the two:

        loss = 10 · exponent · log10(max(d, 0.01 m)) + wall_loss_db_per_m · w

    The teammate hears it where that is at most `budget_db`.

    Attributes:
        budget_db: Loss beyond the first metre at which a message is still understood, -400 to 500: the
            sender's power, less what the first metre takes (40 dB at 2.4 GHz), less the weakest signal
            that is understood.
        exponent: How fast the signal weakens in the open, 0 to 10: 2 in free space.
        wall_loss_db_per_m: Loss in solid voxels, 0 to 1e4.
    """

    budget_db: float = 40.0
    exponent: float = 2.0
    wall_loss_db_per_m: float = 30.0

    def __post_init__(self) -> None:
        """Check every field."""
        check_within(self, "budget_db", least=-400, most=500)
        check_within(self, "exponent", least=0, most=10)
        check_within(self, "wall_loss_db_per_m", least=0, most=1e4)


@dataclass(frozen=True)
class Channel:
    """What robots tell each other: the most useful measurements of a scan (Rocha04, eqs. 42-43), or maps.

    A batch is sent at once (Rocha04) or, with `phase_s`, broadcast in phases (Bhattacharya 2010, sect. 5.3):
    a phase's batches wait for its end and are repeated all through the next phase; robots that have them
    already ignore them. Either way `burst` and `i_min_bits` select what is in a batch: as many as there are
    rays, and 0, send everything that was newly measured.

    With `content = "summaries"` robots send no batches. At the end of a scan, if `summary_every_s` have
    passed since it last did so, a robot sends a quadtree of all that it measured itself since then (Sujan,
    sect. 2.4; robots/map_summary.py). Nothing is selected, so I_min cannot be steered, and summaries are not
    sent in phases. Range, reach, loss, delay and faults do to a summary what they do to a batch.

    Attributes:
        content: `measurements` or `summaries`.
        summary_every_s: Least time between two summaries of a robot, 1e-3 to 3600; 0 = at every scan. Only
            with summaries.
        summary_threshold_bits: Largest information content of a region that a summary gives one mean and one
            σ, 0 to 5: 0 = only equal voxels, 5 = every region measured throughout. Only with summaries.
        burst: Most measurements of one batch; 0 shares none. Above 0 where robots send summaries, whose size
            it does not limit.
        i_min_bits: I_min, the least utility of a measurement that is worth sending, 0 to 1e6. Measurements
            that bring less count as redundant, also where robots send summaries.
        i_min_fill: Share of the burst that reaches I_min on average, above 0 to 10: each robot steers its own
            I_min, from i_min_bits on (Rocha04, sect. 5.1.1). None = I_min stays.
        range_m: Farthest teammate that hears, 1e-9 to 1e6; inf = all.
        reach: Condition beside the range: `distance`, none; `line_of_sight`, no solid voxel of the true world
            on the straight line between the two robots; `signal`, a signal that is strong enough. Bodies of
            robots stop no message.
        signal: Strength of signals.
        loss_probability: Probability that a message is lost on its way to one teammate.
        delay_s: Time from sending to hearing, 0 to 3600.
        announcements: Whether robots announce the viewpoints that they choose.
        order: Which measurements a robot sends first: `utility`, the most useful ones of its latest scan
            (Rocha04, eq. 43); `need`, those of its latest scans that bring most to the teammates that lack
            them, as far as it knows from the receipts that messages then carry (missions/need.py).
        phase_s: Length of a phase of the broadcast, 1e-3 to 3600; 0 = batches are sent at once.
        repeats: How often a phase's batches are sent in the next phase, evenly spread over it; 1e-3 s apart
            or more. 1 where batches are sent at once.
    """

    content: Literal["measurements", "summaries"] = "measurements"
    summary_every_s: float = 10.0
    summary_threshold_bits: float = 0.5
    burst: int = 64
    i_min_bits: float = 0.3219
    i_min_fill: float | None = None
    range_m: float = math.inf
    reach: Literal["distance", "line_of_sight", "signal"] = "distance"
    signal: Signal = field(default_factory=Signal)
    loss_probability: float = 0.0
    delay_s: float = 0.0
    announcements: bool = True
    order: Literal["utility", "need"] = "utility"
    phase_s: float = 0.0
    repeats: int = 1

    def __post_init__(self) -> None:
        """Check every field."""
        check_fields(self)
        check_within(self, "summary_every_s", least=1e-3, most=3600, zero=True)
        check_within(self, "summary_threshold_bits", least=0, most=5)
        check_count(self, "burst", 0, 1_000_000)
        check_within(self, "i_min_bits", least=0, most=1e6)
        if self.i_min_fill is not None:
            check(self, "i_min_fill", "None, or a number above 0 up to 10", lambda v: 0 < v <= 10)
            check(self, "i_min_bits", "above 0 where I_min is steered", lambda v: v > 0)
        check_within(self, "range_m", least=1e-9, most=1e6, inf=True)
        check(self, "loss_probability", "a number from 0 to 1", lambda v: 0 <= v <= 1)
        check(self, "delay_s", "a number from 0 to 3600", lambda v: 0 <= v <= 3600)
        check_within(self, "phase_s", least=1e-3, most=3600, zero=True)
        check_count(self, "repeats", 1, 1000)
        self._check_contents()
        self._check_phases()
        self._check_order()

    def _check_contents(self) -> None:
        """Check that settings of summaries are given where robots send some, and only there."""
        if self.content == "summaries":
            if self.burst == 0:
                raise SettingError("Channel.burst", 0, "above 0 where robots send summaries")
            if self.phase_s > 0.0:
                raise SettingError("Channel.phase_s", self.phase_s, "0 where robots send summaries")
            if self.i_min_fill is not None:
                raise SettingError("Channel.i_min_fill", self.i_min_fill, "None where robots send summaries")
            return
        for name in ("summary_every_s", "summary_threshold_bits"):
            default = type(self).__dataclass_fields__[name].default
            if getattr(self, name) != default:
                allowed = f'{default:g}, its default, without content="summaries": no summaries are sent'
                raise SettingError(f"Channel.{name}", getattr(self, name), allowed)

    def _check_phases(self) -> None:
        """Check that repeats fit into phases, and that a batch waits for one reason only."""
        if self.phase_s == 0.0:
            if self.repeats > 1:
                allowed = "1 without phase_s: batches are sent at once, and once"
                raise SettingError("Channel.repeats", self.repeats, allowed)
            return
        if self.phase_s / self.repeats < 1e-3:
            raise SettingError("Channel.repeats", self.repeats, "so few that they are 1e-3 s apart or more")
        if self.delay_s > 0.0:
            raise SettingError("Channel.delay_s", self.delay_s, "0 where batches are broadcast in phases")

    def _check_order(self) -> None:
        """Check that robots which share by need send batches of measurements at once."""
        if self.order == "utility":
            return
        if self.content == "summaries":
            raise SettingError("Channel.order", self.order, "utility where robots send summaries")
        if self.phase_s > 0.0:
            raise SettingError("Channel.phase_s", self.phase_s, '0 where order="need": robots send at once')
        if self.delay_s > 0.0:
            allowed = '0 where order="need": receipts tell what was heard at once'
            raise SettingError("Channel.delay_s", self.delay_s, allowed)

"""Output of `python -m baselines.run`, and the parts of it that tests compare."""

from __future__ import annotations

from typing import NamedTuple

SHORT = ("--ending.time-limit-s", "8")
FILES = ["map.npz", "mission.gif", "mission.json", "mission.npz", "mission.png"]
"""What a folder --out gets."""


class Ran(NamedTuple):
    code: int
    out: str
    err: str


def without_clock(figures: dict) -> dict:
    return {name: value for name, value in figures.items() if name not in ("wall_s", "replayed")}


def check_refused(ran: Ran, said: list[str]) -> None:
    assert (ran.code, ran.out) == (2, "")
    assert ran.err.startswith("error: ") and ran.err.endswith("\n") and ran.err.count("\n") == 1
    assert "Traceback" not in ran.err and all(word in ran.err for word in said)

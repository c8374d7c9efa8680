"""Closed sets whose members are numbers in arrays, names in print and sentences for people."""

from __future__ import annotations

import enum


class Coded(int, enum.Enum):
    """Enum of sentences, its `value`s; a member equals its place, from 0, and prints as its name."""

    def __new__(cls, sentence: str) -> Coded:
        """Return a member numbered after those before it."""
        member = int.__new__(cls, len(cls.__members__))
        member._value_ = sentence
        return member

    def __repr__(self) -> str:
        """Return the names of its set and of the member."""
        return f"{type(self).__name__}.{self.name}"

    def __str__(self) -> str:
        """Return the member's name."""
        return self.name

    @property
    def code(self) -> int:
        """Number of this member in arrays."""
        return int(self)

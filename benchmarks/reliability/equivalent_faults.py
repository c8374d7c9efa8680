"""Faults that cannot change what the code does, each with the reason: no test could find them."""

from __future__ import annotations

from typing import NamedTuple


class Equivalent(NamedTuple):
    """One fault."""

    path: str
    """Of the source, from the root of the checkout."""
    function: str
    what: str
    """The statement as it is, and with the fault."""
    reason: str
    """Why both do the same."""


EQUIVALENT: tuple[Equivalent, ...] = ()

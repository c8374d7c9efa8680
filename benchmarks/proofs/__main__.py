"""Proofs that missions never hang, crash or leave the contract: `python -m benchmarks.proofs`.

A proof plays many small cases in a process of its own, with the kernels' assertions compiled in. Everything
in a case is drawn from its number. A case that raises, ends its process or runs past its time limit has
failed, and the command prints the line that plays it again.
"""

from __future__ import annotations

import os
import sys
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, NamedTuple

from baselines.cli.arguments import make_folder, parse, run_command
from baselines.cli.options import Mark
from baselines.experiments.origin import this_origin
from baselines.experiments.page import Page
from baselines.experiments.tables import markdown_table
from benchmarks.proofs import determinism, files, kills, settings, soak, states, training
from benchmarks.proofs.cases import Found, play_cases
from entropy_explore_env.errors import SettingError
from entropy_explore_env.settings.validation import check_whole

FAILED = 1
_SHOWN = 20
"""Failures of a proof that the page shows."""


class Proof(NamedTuple):
    """One kind of case.

    Attributes:
        play: Plays the case of a number; raises where something is wrong.
        quick: Number of cases that take a few minutes.
        full: Number of cases that the page of results asks for.
        limit_s: Elapsed seconds after which a case has failed.
    """

    play: Callable[[int], Found]
    quick: int
    full: int
    limit_s: float


PROOFS = {
    "settings": Proof(settings.play, 1_000, 10_000, 600.0),
    "states": Proof(states.play, 1_000, 20_000, 120.0),
    "determinism": Proof(determinism.play, 3, 4 * determinism.VARIANTS, 1800.0),
    "kills": Proof(kills.play, 1, 20, 600.0),
    "files": Proof(files.play, len(files.FORMATS), 200 * len(files.FORMATS), 600.0),
    "training": Proof(training.play, 1, len(training.TRAINERS), 7200.0),
    "soak": Proof(soak.play, len(soak.PAIRS), 28 * len(soak.PAIRS), 600.0),
    "memory": Proof(soak.play_memory, 1, 4, 3600.0),
}


@dataclass(frozen=True)
class Args:
    """Play drawn cases of what must hold in every mission.

    Attributes:
        names: Proofs to run; without any, all of them.
        cases: Cases of each proof; without it, those of a few minutes.
        full: Play as many cases as the page of results asks for: many hours.
        first: Number of the first case. Other numbers are other cases.
        limit_s: Seconds after which no other case of a proof is begun.
        out: Markdown file for the page.
    """

    names: Annotated[tuple[str, ...], Mark.POSITIONAL] = ()
    cases: int | None = None
    full: bool = False
    first: int = 0
    limit_s: float = float("inf")
    out: Path | None = None


class Played(NamedTuple):
    """The cases of one proof: what was found, and number → error of those that failed."""

    found: list[Found]
    failed: dict[int, str]

    @property
    def cases(self) -> int:
        """Their number."""
        return len(self.found) + len(self.failed)


def main(words: Sequence[str]) -> int:
    """Run the command; the exit code is 1 if a case failed."""
    args = checked(parse(Args, words, description=__doc__))
    os.environ["ENTROPY_EXPLORE_ASSERT"] = "1"
    played = {name: _play_all(name, args) for name in args.names or PROOFS}
    print(table(played))
    if args.out is not None:
        write_page(args.out, played, words)
    return FAILED if any(each.failed for each in played.values()) else 0


def checked(args: Args) -> Args:
    """Return the arguments, after a look at each.

    Raises:
        SettingError: A proof is unknown, a number is too small, or the page cannot be written.
    """
    for name in args.names:
        if name not in PROOFS:
            raise SettingError("names", name, "one of " + ", ".join(PROOFS))
    if args.cases is not None:
        check_whole("cases", args.cases, 1)
        if args.full:
            raise SettingError("cases", args.cases, "no value beside --full")
    check_whole("first", args.first, 0)
    if not args.limit_s > 0.0:
        raise SettingError("limit_s", args.limit_s, "a number > 0")
    if args.out is not None:
        if args.out.is_dir() or args.out.suffix != ".md":
            raise SettingError("out", str(args.out), "a Markdown file, .md, and no folder")
        make_folder("out", args.out.absolute().parent)
    return args


def _play_all(name: str, args: Args) -> Played:
    """Play the cases of a proof, and print each failure as it happens."""
    proof, begun_s = PROOFS[name], time.monotonic()
    cases = args.cases or (proof.full if args.full else proof.quick)
    numbers = range(args.first, args.first + cases)
    played = Played([], {})
    for number, outcome in play_cases(proof.play, numbers, proof.limit_s):
        if isinstance(outcome, Found):
            played.found.append(outcome)
        else:
            played.failed[number] = outcome
            print(f"\r{again(name, number)}\n    {outcome}", file=sys.stderr)
        print(f"\r{name}: {played.cases:,} of {cases:,}", end="", file=sys.stderr, flush=True)
        if time.monotonic() - begun_s > args.limit_s:
            break
    print(file=sys.stderr)
    return played


def again(name: str, number: int) -> str:
    """Return the line that plays a case again."""
    return f"python -m benchmarks.proofs {name} --cases 1 --first {number}"


def table(played: dict[str, Played]) -> str:
    """Return a row for each proof, and for each group of its cases, as Markdown."""
    rows = []
    for name, each in played.items():
        groups = [group for group in dict.fromkeys(found.of for found in each.found) if group]
        rows.append((name, "all", f"{each.cases:,}", len(each.failed), told(each.found)))
        for group in groups:
            own = [found for found in each.found if found.of == group]
            rows.append((name, group, f"{len(own):,}", "-", told(own)))
    return markdown_table(("proof", "of", "cases", "failed", "found"), rows)


def told(found: Sequence[Found]) -> str:
    """Return the figures of some cases: sums, and the largest of those whose name ends with "at most"."""
    values: dict[str, list[float]] = {}
    for each in found:
        for name, value in each.figures.items():
            values.setdefault(name, []).append(value)
    return ", ".join(
        f"{max(own):.3g} {name}" if name.endswith("at most") else f"{sum(own):,} {name}"
        for name, own in values.items()
    )


def write_page(out: Path, played: dict[str, Played], words: Sequence[str]) -> None:
    """Write the page of results; its text is in `page.md.j2`."""
    failures = [
        (again(name, number), said)
        for name, each in played.items()
        for number, said in list(each.failed.items())[:_SHOWN]
    ]
    origin = this_origin()
    texts = {
        "command": " ".join(["python -m benchmarks.proofs", *words]),
        "commit": f"{origin.commit}{'' if origin.clean else ' with changes'}",
        "versions": ", ".join(f"{name} {version}" for name, version in origin.versions.items()),
        "failures": failures,
        "played": table(played),
    }
    Page(Path(__file__).with_name("page.md.j2"), texts=texts).write(out.parent, out.stem)


if __name__ == "__main__":
    raise SystemExit(run_command(main))

"""Proofs of reliability, and their page: `python -m benchmarks.reliability`.

Each proof is many small cases, played in a process that may hang or crash, with the assertions of kernels
compiled in. What came of a case is kept in `results/reliability`, a line each: a run that was stopped goes on
where it was. The page is made of all that is kept. `--quick` plays a few minutes of each.
"""

from __future__ import annotations

import json
import os
import sys
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple

from baselines.cli.arguments import parse, run_command
from baselines.experiments.worker_pool import Failure, run_each
from benchmarks.reliability import determinism, settings_fuzz, soak, state_fuzz
from benchmarks.reliability.page import Kept, page
from entropy_explore_env.errors import SettingError
from entropy_explore_env.writing import write_atomically

FAILED = 1
Row = dict[str, Any]


class Proof(NamedTuple):
    """One kind of case."""

    play: Callable[[int], Row]
    """A case, by its number; what it raises is a failure."""
    quick: int
    """Cases of a quick run."""
    full: int
    limit_s: float
    """Of a case, on the clock."""


PROOFS = {
    "settings": Proof(settings_fuzz.play_number, 300, 10_000, 600.0),
    "states": Proof(state_fuzz.play_number, 1_000, 20_000, 120.0),
    "determinism": Proof(determinism.play_number, 2 * determinism.VARIANTS, 40 * determinism.VARIANTS, 600.0),
    "soak": Proof(soak.play_number, 10, 2_000, 3600.0),
}


@dataclass(frozen=True)
class Args:
    """Play what must hold in every mission, and write the page of what was found.

    Attributes:
        proofs: Which; nothing = all of them.
        quick: A few minutes.
        results: Folder of what is kept.
        page: The page to write; nothing = none.
    """

    proofs: tuple[str, ...] = ()
    quick: bool = False
    results: Path = Path("results/reliability")
    page: Path | None = None


def main(words: Sequence[str]) -> int:
    """Run the command; 1 where a case failed."""
    args = parse(Args, words)
    for name in args.proofs:
        if name not in PROOFS:
            raise SettingError("proofs", name, "one of " + ", ".join(PROOFS))
    os.environ["ENTROPY_EXPLORE_ASSERT"] = "1"
    for name in args.proofs or PROOFS:
        proof = PROOFS[name]
        carry_on(proof, args.results / f"{name}.jsonl", proof.quick if args.quick else proof.full)
    kept = {name: Kept(rows_of(args.results / f"{name}.jsonl"), PROOFS[name].full) for name in PROOFS}
    text = page(kept)
    print(text)
    if args.page is not None:
        write_atomically(args.page, text.encode())
    return FAILED if any("failure" in row for each in kept.values() for row in each.rows) else 0


def carry_on(proof: Proof, file: Path, cases: int) -> None:
    """Play the cases from 0 that are not kept yet."""
    file.parent.mkdir(parents=True, exist_ok=True)
    known = {row["number"] for row in rows_of(file)}
    missing = [number for number in range(cases) if number not in known]
    with file.open("a", encoding="utf-8") as kept:
        for number, outcome in run_each(proof.play, missing, 1, proof.limit_s, apart=True):
            row = {"failure": outcome.reason} if isinstance(outcome, Failure) else outcome
            kept.write(json.dumps({"number": number, **row}) + "\n")
            kept.flush()
            print(f"\r{file.stem}: {number + 1} of {cases}", end="", file=sys.stderr)
    if missing:
        print(file=sys.stderr)


def rows_of(file: Path) -> list[Row]:
    """What is kept in a file."""
    return [json.loads(line) for line in file.read_text("utf-8").splitlines()] if file.exists() else []


if __name__ == "__main__":
    raise SystemExit(run_command(main))

"""Proofs of reliability, and their page: `python -m benchmarks.reliability`.

Each proof is many small cases, played in a process that may hang or crash, with the assertions of kernels
compiled in. What came of a case is kept in `results/reliability`, a line each: a run that was stopped goes on
where it was. The page is made of all that is kept, and of what `benchmarks.reliability.mutants` and
`benchmarks.reliability.coverage` kept. `--quick` plays a few minutes of each.
"""

from __future__ import annotations

import json
import math
import os
import platform
import sys
import time
from collections.abc import Callable, Sequence
from contextlib import closing
from dataclasses import dataclass
from importlib import metadata
from pathlib import Path
from typing import Any, NamedTuple

from baselines.cli.arguments import parse, run_command
from baselines.experiments.worker_pool import Failure, run_each
from benchmarks.reliability import (
    determinism,
    file_fuzz,
    kills,
    memory,
    settings_fuzz,
    soak,
    state_fuzz,
    training_runs,
)
from benchmarks.reliability.coverage import ROOT
from benchmarks.reliability.mutants import of_these_sources
from benchmarks.reliability.page import Kept, page, read_rows
from benchmarks.reliability.sources import commits_of, library_digest
from entropy_explore_env.errors import SettingError
from entropy_explore_env.writing import write_atomically

FAILED = 1
Row = dict[str, Any]


def _any(number: int) -> bool:
    """All cases are played."""
    del number
    return True


def _one(row: Row) -> int:
    """What a case counts for: itself."""
    del row
    return 1


class Proof(NamedTuple):
    """One kind of case."""

    play: Callable[[int], Row]
    """A case, by its number; what it raises is a failure."""
    quick: int
    """What a quick run comes to."""
    full: int
    limit_s: float
    """Of a case, on the clock."""
    counts: Callable[[Row], int] = _one
    """What a case comes to, in the unit of `quick` and `full`."""
    cases: int | None = None
    """How many there are; None = as many as it takes."""


PROOFS = {
    "settings": Proof(settings_fuzz.play_number, 300, 10_000, 600.0),
    "states": Proof(state_fuzz.play_number, 1_000, 20_000, 120.0),
    "determinism": Proof(
        determinism.play_number,
        determinism.SCENARIOS_EACH * 2,
        40 * determinism.VARIANTS,
        1800.0,
        determinism.plays_of,
    ),
    "kills": Proof(kills.play_number, 2 * kills.KILLS, 200, 600.0, kills.kills_of),
    "files": Proof(
        file_fuzz.play_number,
        len(file_fuzz.LOADERS) * file_fuzz.BATCH,
        len(file_fuzz.LOADERS) * file_fuzz.FILES,
        600.0,
        file_fuzz.files_of,
        file_fuzz.CASES,
    ),
    "training": Proof(
        training_runs.play_number,
        training_runs.ROBOT_STEPS,
        len(training_runs.TRAINERS) * training_runs.ROBOT_STEPS,
        7200.0,
        soak.robot_steps,
    ),
    "soak": Proof(soak.play_number, 1_000_000, soak.ROBOT_STEPS, 600.0, soak.robot_steps),
    "memory": Proof(memory.play_number, 3 * memory.CASE_STEPS, memory.ROBOT_STEPS, 1200.0, soak.robot_steps),
}
_MOST_CASES = 20_000
"""Of a proof whose cases count for more than themselves."""


@dataclass(frozen=True)
class Args:
    """Play what must hold in every mission, and write the page of what was found.

    Attributes:
        proofs: Which; nothing = all of them.
        quick: A few minutes.
        cases: How much of each proof, in the unit in which the page counts it; nothing = all of it.
        first: Number of the first case. Others draw other cases: a night may play those of its date.
        limit_s: Seconds of a proof after which no other case is begun; what is missing can be played later.
            0 = nothing is played, the page is made of what is kept.
        loaders: Of the changed files, which loaders' are played; nothing = all, which take turns.
        results: Folder of what is kept.
        mutants: Folder of what `benchmarks.reliability.mutants` kept.
        page: The page to write; nothing = none.
    """

    proofs: tuple[str, ...] = ()
    quick: bool = False
    cases: int | None = None
    first: int = 0
    limit_s: float = math.inf
    loaders: tuple[str, ...] = ()
    results: Path = Path("results/reliability")
    mutants: Path = Path("results/mutants")
    page: Path | None = None


def main(words: Sequence[str]) -> int:
    """Run the command; 1 where a case failed."""
    args = parse(Args, words)
    for name in args.proofs:
        if name not in PROOFS:
            raise SettingError("proofs", name, "one of " + ", ".join(PROOFS))
    if args.first < 0:
        raise SettingError("first", args.first, "a whole number ≥ 0")
    if args.cases is not None and args.cases < 1:
        raise SettingError("cases", args.cases, "a whole number ≥ 1")
    for name in args.loaders:
        if name not in file_fuzz.LOADERS:
            raise SettingError("loaders", name, "one of " + ", ".join(file_fuzz.LOADERS))
    os.environ["ENTROPY_EXPLORE_ASSERT"] = "1"
    for name in args.proofs or PROOFS:
        proof = PROOFS[name]
        wanted = args.cases or (proof.quick if args.quick else proof.full)
        plays = file_fuzz.plays_one_of(args.loaders) if name == "files" and args.loaders else _any
        carry_on(proof, args.results / f"{name}.jsonl", wanted, args.limit_s, args.first, plays)
    kept = {name: _kept(proof, args.results / f"{name}.jsonl") for name, proof in PROOFS.items()}
    folders = {file.stem: of_these_sources(read_rows(file)) for file in sorted(args.mutants.glob("*.jsonl"))}
    digests = {row["library"] for each in kept.values() for row in each.rows if "library" in row}
    text = page(
        kept, folders, read_rows(args.results / "coverage.jsonl"), versions(), commits_of(ROOT, digests)
    )
    print(text)
    if args.page is not None:
        write_atomically(args.page, text.encode())
    return FAILED if any("failure" in row for each in kept.values() for row in each.rows) else 0


def _kept(proof: Proof, file: Path) -> Kept:
    rows = read_rows(file)
    return Kept(rows, sum(map(proof.counts, rows)), proof.full)


def versions() -> dict[str, str]:
    """Of what results depend on."""
    names = ("numpy", "numba", "scipy", "torch", "gymnasium")
    return {"Python": platform.python_version(), **{name: metadata.version(name) for name in names}}


def carry_on(
    proof: Proof,
    file: Path,
    wanted: int,
    limit_s: float = math.inf,
    first: int = 0,
    plays: Callable[[int], bool] = _any,
) -> None:
    """Play the cases from a first one that are not kept yet, until those that are come to what is wanted.

    Args:
        proof: Whose cases.
        file: Of what is kept, a line each.
        wanted: How much, in the proof's unit.
        limit_s: After which no other case is begun.
        first: Number of the first one.
        plays: Whether a case is played, by its number.
    """
    begun_s = time.monotonic()
    file.parent.mkdir(parents=True, exist_ok=True)
    rows = read_rows(file)
    known, reached = {row["number"] for row in rows}, sum(map(proof.counts, rows))
    cases = proof.cases or (wanted if proof.counts is _one else _MOST_CASES)
    missing = [each for each in range(first, first + cases) if each not in known and plays(each)]
    if reached >= wanted or limit_s <= 0.0:
        missing = []
    with (
        file.open("a", encoding="utf-8") as kept,
        closing(run_each(proof.play, missing, 1, proof.limit_s, apart=True)) as outcomes,
    ):
        for number, outcome in outcomes:
            row = {"failure": outcome.reason} if isinstance(outcome, Failure) else outcome
            row = {"number": number, **row, "library": library_digest()}
            kept.write(json.dumps(row) + "\n")
            kept.flush()
            reached += proof.counts(row)
            print(f"\r{file.stem}: {reached:,} of {wanted:,}", end="", file=sys.stderr)
            if reached >= wanted or time.monotonic() - begun_s > limit_s:
                break
    if missing:
        print(file=sys.stderr)


if __name__ == "__main__":
    raise SystemExit(run_command(main))

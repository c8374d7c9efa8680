"""Mutation testing: small faults put into the kernels of a folder, and whether the tests find each of them.

    python -m benchmarks.reliability.mutants entropy_explore_env/missions --sample 100

A fault is a comparison or a sum turned round, a condition denied, a number off by one, a statement left out.
Each runs in a copy of the checkout, with interpreted kernels, because compiling them takes most of a minute
for each fault. Only the tests that take its line, as `benchmarks.reliability.coverage` keeps them, are run:
those of the file itself first, then the quickest, until one fails. A test that takes too long with a fault
finds nothing: the others are run, and the fault is late if they find nothing either. Results are kept in
`results/mutants`, a line each; what has one is not run again. Faults that are named as without effect in
`benchmarks.reliability.equivalent_faults` are not counted.
"""

from __future__ import annotations

import hashlib
import json
import math
import shutil
import subprocess
import tempfile
import time
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple

from baselines.cli.arguments import Positional, parse, run_command
from benchmarks.reliability.coverage import FOLDERS, KEPT, ROOT, measure, sources_digest, test_files
from benchmarks.reliability.fault_table import reason_of
from benchmarks.reliability.faults_in_source import Mutant, mutants_of
from benchmarks.reliability.mutant_runs import LATE, Host
from benchmarks.reliability.page import read_rows
from benchmarks.reliability.reached_lines import Reached, reached_lines
from entropy_explore_env.errors import SettingError

SURVIVED = 1


@dataclass(frozen=True)
class Args:
    """Put faults into the functions of a file, or of a folder's files, and see whether the tests find them.

    Attributes:
        path: The file or the folder, from the root of the checkout.
        sample: How many faults are drawn; 0 = all.
        seed: Of the draw.
        kernels: Draw from compiled kernels only, not from all functions.
        test_s: Seconds of the processor that a test may take without a fault, to be run at all.
        tests_s: Of all tests that are run for a fault, as they take without it.
        limit_s: On the clock, of all tests for one fault.
        retry: Run those again that no test found, also those that were drawn before; but not those that are
            named as without effect.
        stop_s: Seconds on the clock after which no other fault is begun.
        kept: Folder of what files of tests took, as of `benchmarks.reliability.coverage`.
        out: Folder of the results.
    """

    path: Positional[str] = "entropy_explore_env/missions/tick.py"
    sample: int = 30
    seed: int = 0
    kernels: bool = True
    test_s: float = 3.0
    tests_s: float = 30.0
    limit_s: float = 120.0
    retry: bool = False
    stop_s: float = math.inf
    kept: Path = KEPT
    out: Path = Path("results/mutants")


class Drawn(NamedTuple):
    """A fault, and the file that it is put into."""

    path: Path
    mutant: Mutant
    digest: str
    """What it is known by: the file and its function with the fault, so that other functions may change."""


def drawn(path: Path, mutant: Mutant) -> Drawn:
    """A fault of a file, with its digest."""
    return Drawn(path, mutant, hashlib.sha256(f"{path} {mutant.function_source}".encode()).hexdigest()[:16])


def faults_of(root: Path, path: Path, kernels: bool = False) -> list[Drawn]:
    """All faults of a file, or of the files of a folder."""
    files = sorted((root / path).rglob("*.py")) if (root / path).is_dir() else [root / path]
    return [
        drawn(file.relative_to(root), mutant)
        for file in files
        for mutant in mutants_of(file.read_text("utf-8"), kernels)
    ]


def some_of(faults: Sequence[Drawn], sample: int, seed: int) -> list[Drawn]:
    """Faults drawn by their digests: where other functions change, the same are drawn again; 0 = all."""
    by_chance = sorted(faults, key=lambda fault: hashlib.sha256(f"{seed} {fault.digest}".encode()).digest())
    return by_chance[: sample or None]


def of_these_sources(rows: Sequence[dict[str, Any]], root: Path = ROOT) -> list[dict[str, Any]]:
    """Those rows whose faults can be put into the sources as they are: other functions were other code."""
    paths = {Path(row["path"]) for row in rows}
    faults = (faults_of(root, path) for path in paths if (root / path).is_file())
    digests = {fault.digest for each in faults for fault in each}
    return [row for row in rows if row["digest"] in digests]


def main(words: Sequence[str]) -> int:
    """Run the command; 1 where a fault was not found."""
    args = parse(Args, words)
    path = Path(args.path)
    if not (ROOT / path).is_dir() and (not (ROOT / path).is_file() or path.suffix != ".py"):
        raise SettingError("path", args.path, "a Python file or a folder, from the root of the checkout")
    if len(path.parts) < 2 or path.parts[1] not in FOLDERS:
        raise SettingError("path", args.path, "in entropy_explore_env/ and one of " + ", ".join(FOLDERS))
    every = faults_of(ROOT, path, args.kernels)
    faults = some_of(every, args.sample, args.seed)
    args.out.mkdir(parents=True, exist_ok=True)
    kept = args.out / f"{'.'.join(path.with_suffix('').parts)}.jsonl"
    known = {row["digest"]: row for row in read_rows(kept)}
    if args.retry:
        again = {digest for digest, row in known.items() if not row["found"] and not reason_of(row)}
        faults = [fault for fault in every if fault.digest in again | {each.digest for each in faults}]
        known = {digest: row for digest, row in known.items() if digest not in again}
    missing = [fault for fault in faults if fault.digest not in known]
    begun_s = time.monotonic()
    if missing:
        reached = _reached(args.kept, path.parts[1])
        with tempfile.TemporaryDirectory() as folder:
            _copy(ROOT, Path(folder))
            with Host(Path(folder)) as host:
                for fault in missing:
                    if time.monotonic() - begun_s > args.stop_s:
                        break
                    row = row_of(host, fault, reached, args)
                    known[fault.digest] = row
                    with kept.open("a", encoding="utf-8") as file:
                        file.write(json.dumps(row) + "\n")
                    told = row["found"] or (LATE if row["late"] else f"SURVIVED {row['tests']} tests")
                    print(f"{row['path']}:{row['line']}: {told}: {row['what']}", flush=True)
    tried = [known[fault.digest] for fault in faults if fault.digest in known]
    tried = [row for row in tried if not reason_of(row)]
    found = sum(bool(row["found"]) for row in tried)
    print(f"{found} of {len(tried)} faults were found, {len(faults)} drawn of {len(every)} that there are")
    return SURVIVED if found < len(tried) else 0


def _reached(kept: Path, package: str) -> Reached:
    """Which tests take which lines, as far as it is kept; the tests of the package are run if need be."""
    folder = kept.absolute() / sources_digest(ROOT)
    for file in test_files(ROOT, (package,)):
        measure(file, folder, test_s=10.0)
    return reached_lines(folder)


def row_of(host: Host, fault: Drawn, reached: Reached, args: Args) -> dict[str, Any]:
    """What came of a fault: its tests are run until one fails that passes without the fault."""
    tests = reached.tests_of(str(fault.path), fault.mutant.lines, args.test_s, args.tests_s)
    begun_s, found, late = time.monotonic(), "", False
    waiting, left_s = tests, args.limit_s
    while waiting and not found and left_s > 0.0:
        first = host.first_failure(fault.path, fault.mutant.source, waiting, left_s)
        left_s = begun_s + args.limit_s - time.monotonic()
        if first is None:
            break
        if first.test not in waiting:  # all of them together
            found, late = ("", True) if first.late else (first.test, late)
            break
        if host.passes_soundly(first.test):
            found, late = ("", True) if first.late else (first.test, late)
        waiting = waiting[waiting.index(first.test) + 1 :]
    return {
        "digest": fault.digest,
        "path": str(fault.path),
        "function": fault.mutant.function.name,
        "line": fault.mutant.lines[0],
        "what": fault.mutant.what,
        "found": found,
        "late": late and not found,
        "tests": len(tests),
        "seconds": round(time.monotonic() - begun_s, 1),
    }


def _copy(root: Path, folder: Path) -> None:
    """Copy what git knows of the checkout."""
    listed = subprocess.run(
        ["git", "ls-files", "-z"], cwd=root, capture_output=True, check=True
    ).stdout.decode()
    for name in filter(None, listed.split("\0")):
        if (root / name).is_file():
            (folder / name).parent.mkdir(parents=True, exist_ok=True)
            shutil.copyfile(root / name, folder / name)


if __name__ == "__main__":
    raise SystemExit(run_command(main))

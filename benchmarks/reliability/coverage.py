"""Branches of kernels that tests take, with kernels interpreted: `python -m benchmarks.reliability.coverage`.

Compiled code cannot be traced. Interpreted, a kernel gives the same bits, some hundred times slower: a test
that takes longer than `--test-s` of the processor is ended, and what it took until then counts. Each file of
tests runs in a process of its own, and what it took is kept, with the names of its tests: a run that was
stopped goes on with the files that are missing. What other sources took is not counted.
"""

from __future__ import annotations

import hashlib
import json
import math
import os
import subprocess
import sys
import tempfile
import time
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from baselines.cli.arguments import parse, run_command
from benchmarks.reliability.page import read_rows
from benchmarks.reliability.quick_tests import LIMIT, TOLD
from entropy_explore_env.errors import SettingError
from entropy_explore_env.writing import write_atomically

ROOT = Path(__file__).parents[2]
FOLDERS = ("belief", "robots", "missions")
_ALSO = {"missions": ("reset_options", "refusals", "given_worlds", "parallel_env")}
"""Folder → files of tests/envs that test what is in it."""
KEPT = Path("results/reliability/branches")
_LEFT_OUT = ("raise AssertionError", "if ASSERTING", "if TYPE_CHECKING")
"""Lines whose branches no sound mission takes, or that are there for type checkers."""


@dataclass(frozen=True)
class Args:
    """Measure the branches that tests take, and keep them for the page of the proofs.

    Attributes:
        folders: Of the library, and of the tests that are run.
        test_s: Seconds of the processor after which a test is ended.
        limit_s: Seconds on the clock after which no other file of tests is begun.
        kept: Folder of what each file of tests took.
        out: Where the rows are kept; those of other folders stay.
        missing: Print the branches that no test took.
    """

    folders: tuple[str, ...] = FOLDERS
    test_s: float = 10.0
    limit_s: float = math.inf
    kept: Path = KEPT
    out: Path = Path("results/reliability/coverage.jsonl")
    missing: bool = False


def main(words: Sequence[str]) -> int:
    """Run the command."""
    args = parse(Args, words)
    for folder in args.folders:
        if folder not in FOLDERS:
            raise SettingError("folders", folder, "one of " + ", ".join(FOLDERS))
    kept = args.kept.absolute() / sources_digest(ROOT)
    files, begun_s = test_files(ROOT, args.folders), time.monotonic()
    for file in files:
        if time.monotonic() - begun_s < args.limit_s:
            measure(file, kept, args.test_s)
    missing = [file for file in files if not data_of(file, kept).exists()]
    report = report_of([data_of(file, kept) for file in files if file not in missing])
    rows = [row for row in read_rows(args.out) if row["path"].split("/")[1] not in args.folders]
    rows += [
        {**row, "files": len(files) - len(missing), "of_files": len(files), "test_s": args.test_s}
        for row in rows_of(report)
        if row["path"].split("/")[1] in args.folders
    ]
    write_atomically(args.out, "".join(json.dumps(row) + "\n" for row in rows))
    for row in rows:
        print(f"{row['path']}: {row['covered']} of {row['branches']}")
    if args.missing:
        for path, told in sorted(report["files"].items()):
            print("".join(f"{path}:{a} -> {b}\n" for a, b in told["missing_branches"]), end="")
    print(f"{len(files) - len(missing)} of {len(files)} files of tests were run")
    return 0


def sources_digest(root: Path) -> str:
    """What the sources of the measured folders are, in a few letters."""
    paths = [path for name in FOLDERS for path in sorted((root / "entropy_explore_env" / name).rglob("*.py"))]
    return hashlib.sha256(b"".join(path.read_bytes() for path in paths)).hexdigest()[:12]


def test_files(root: Path, folders: Sequence[str]) -> list[str]:
    """The files of tests of some folders of the library, as paths from the root."""
    found = [path for name in folders for path in sorted((root / "tests" / name).rglob("test_*.py"))]
    also = [f"tests/envs/test_{name}.py" for folder in folders for name in _ALSO.get(folder, ())]
    return [str(path.relative_to(root)) for path in found] + also


def data_of(file: str, kept: Path) -> Path:
    """Where what a file of tests took is kept; what became of its tests is beside it, as `.tests`."""
    return kept / f"{file.removesuffix('.py').replace('/', '.')}.coverage"


def measure(file: str, kept: Path, test_s: float) -> None:
    """Run a file of tests with interpreted kernels, unless what it took is kept.

    Args:
        file: From the root of the checkout.
        kept: Folder of what files of tests took.
        test_s: Seconds of the processor after which a test is ended.
    """
    data = data_of(file, kept)
    if data.exists():
        return
    kept.mkdir(parents=True, exist_ok=True)
    told = data.with_suffix(".tests")
    told.unlink(missing_ok=True)
    new = data.with_suffix(".new")
    variables = {**os.environ, "PYTHONPATH": str(ROOT), "NUMBA_DISABLE_JIT": "1"}
    variables |= {LIMIT: str(test_s), TOLD: str(told)}
    sources = ",".join(f"entropy_explore_env/{name}" for name in FOLDERS)
    plugins = ["-p", "no:cacheprovider", "-p", "benchmarks.reliability.quick_tests"]
    traced = ["-m", "coverage", "run", "--branch", f"--source={sources}", f"--data-file={new}"]
    subprocess.run(
        [sys.executable, *traced, "-m", "pytest", "-q", "-W", "ignore", *plugins, file],
        cwd=ROOT,
        env=variables,
        stdout=sys.stderr,
        check=False,  # tests that are ended fail
    )
    new.rename(data)


def report_of(data: Sequence[Path]) -> dict[str, Any]:
    """What `coverage json` says of the branches that files of tests took together."""
    if not data:
        return {"files": {}}
    with tempfile.TemporaryDirectory() as folder:
        together, report, settings = (Path(folder) / name for name in ("together", "report.json", "settings"))
        lines = "\n".join(f"    {line}" for line in _LEFT_OUT)
        settings.write_text(f"[report]\nexclude_also =\n{lines}\n", "utf-8")
        files = [f"--data-file={together}", f"--rcfile={settings}"]
        for words in (["combine", "-q", "--keep", *map(str, data)], ["json", "-q", "-o", str(report)]):
            command = [sys.executable, "-m", "coverage", words[0], *files, *words[1:]]
            subprocess.run(command, cwd=ROOT, check=True)
        return json.loads(report.read_text("utf-8"))


def rows_of(report: dict[str, Any]) -> list[dict[str, Any]]:
    """A row for each file of a report of `coverage json`; those without branches are left out."""
    return [
        {"path": path, "branches": told["num_branches"], "covered": told["covered_branches"]}
        for path, told in ((path, file["summary"]) for path, file in sorted(report["files"].items()))
        if told["num_branches"]
    ]


if __name__ == "__main__":
    raise SystemExit(run_command(main))

"""Mutation testing: small faults put into a file's functions, and whether the tests find each of them.

    python -m benchmarks.reliability.mutants entropy_explore_env/missions --sample 100

A fault is a comparison or a sum turned round, a condition denied, a number off by one, a statement left out.
Each runs in a copy of the checkout. A fault is found where a test fails or takes too long. Kernels are
interpreted, because compiling them takes most of a minute for each fault; so only the tests that pass that
way within a second or two are run, those of the file itself first. Results are kept in `results/mutants`, a
line each; what has one is not run again.
"""

from __future__ import annotations

import ast
import copy
import hashlib
import json
import os
import random
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple

from baselines.cli.arguments import Positional, parse, run_command
from benchmarks.reliability.quick_tests import LIMIT, TOLD, names_of, told_in
from entropy_explore_env.errors import SettingError

SURVIVED = 1
_COMPARISONS = {
    ast.Lt: ast.LtE,
    ast.LtE: ast.Lt,
    ast.Gt: ast.GtE,
    ast.GtE: ast.Gt,
    ast.Eq: ast.NotEq,
    ast.NotEq: ast.Eq,
    ast.Is: ast.IsNot,
    ast.IsNot: ast.Is,
}
_SUMS = {ast.Add: ast.Sub, ast.Sub: ast.Add, ast.Mult: ast.Div, ast.Div: ast.Mult, ast.FloorDiv: ast.Mult}


class Mutant(NamedTuple):
    """A file with one fault."""

    line: int
    what: str
    """The statement as it is, and as it is now."""
    source: str


@dataclass(frozen=True)
class Args:
    """Put faults into the functions of a file, or of a folder's files, and see whether the tests find them.

    Attributes:
        path: The file or the folder, from the root of the checkout.
        sample: How many faults are drawn; 0 = all.
        seed: Of the draw.
        tests: What pytest runs; nothing = the folder of tests of the package, and that of missions.
        test_s: Seconds of the processor that a test may take without a fault, to be run at all.
        limit_s: On the clock, of the tests for one fault.
        out: Folder of the results.
    """

    path: Positional[str] = "entropy_explore_env/missions/tick.py"
    sample: int = 30
    seed: int = 0
    tests: tuple[str, ...] = ()
    test_s: float = 1.5
    limit_s: float = 900.0
    out: Path = Path("results/mutants")


def mutants_of(source: str) -> list[Mutant]:
    """All faults of a file, in the order of its text; assertions of debug builds are left alone."""
    tree = ast.parse(source)
    found = []
    for function in ast.walk(tree):
        if not isinstance(function, ast.FunctionDef):
            continue
        for node in ast.walk(function):
            if not isinstance(node, ast.stmt) or node is function or _is_debugging(node):
                continue
            before = _head(node)
            for changed in _changes(node):
                found.append((node.lineno, f"{before}  ->  {_head(changed)}", node, changed))
    return [
        Mutant(line, what, _replaced(tree, node, changed))
        for line, what, node, changed in sorted(found, key=lambda f: f[:2])
    ]


def _head(statement: ast.stmt) -> str:
    """A statement in one line, without what is inside it."""
    return ast.unparse(statement).partition("\n")[0]


def _is_debugging(node: ast.stmt) -> bool:
    """Whether a statement belongs to an assertion of debug builds, or is a docstring."""
    if isinstance(node, ast.Expr) and isinstance(node.value, ast.Constant):
        return True
    return isinstance(node, ast.Raise) or "ASSERTING" in _head(node)


def _changes(statement: ast.stmt) -> Iterator[ast.stmt]:
    """A statement with one fault in its own expressions, or nothing in its place."""
    if isinstance(statement, ast.Expr | ast.AugAssign | ast.Break | ast.Continue) or _changes_an_array(
        statement
    ):
        yield ast.copy_location(ast.Pass(), statement)
    if isinstance(statement, ast.If | ast.While):
        denied = copy.deepcopy(statement)
        denied.test = ast.UnaryOp(ast.Not(), denied.test)
        yield denied
    if isinstance(statement, ast.AugAssign) and type(statement.op) in _SUMS:
        turned = copy.deepcopy(statement)
        turned.op = _SUMS[type(statement.op)]()
        yield turned
    count = sum(1 for _ in _expressions(statement))
    for place in range(count):
        changed = copy.deepcopy(statement)
        node = next(node for number, node in enumerate(_expressions(changed)) if number == place)
        if _turn(node):
            yield changed


def _changes_an_array(statement: ast.stmt) -> bool:
    """Whether it assigns to a field or a place of an array; names without a value are no faults to find."""
    return isinstance(statement, ast.Assign) and isinstance(
        statement.targets[0], ast.Attribute | ast.Subscript
    )


def _expressions(statement: ast.stmt) -> Iterator[ast.AST]:
    """The expressions of a statement itself, not of the statements inside it."""
    waiting = [child for child in ast.iter_child_nodes(statement) if not isinstance(child, ast.stmt)]
    while waiting:
        node = waiting.pop(0)
        yield node
        if not isinstance(node, ast.Subscript):  # another place of an array may hold the same
            waiting += list(ast.iter_child_nodes(node))


def _turn(node: ast.AST) -> bool:
    """Put a fault into one expression; False where it is of no kind that has one."""
    if isinstance(node, ast.Compare) and type(node.ops[0]) in _COMPARISONS:
        node.ops[0] = _COMPARISONS[type(node.ops[0])]()
    elif isinstance(node, ast.BinOp) and type(node.op) in _SUMS:
        node.op = _SUMS[type(node.op)]()
    elif isinstance(node, ast.BoolOp):
        node.op = ast.Or() if isinstance(node.op, ast.And) else ast.And()
    elif isinstance(node, ast.Constant) and isinstance(node.value, bool):
        node.value = not node.value
    elif isinstance(node, ast.Constant) and isinstance(node.value, int | float):
        node.value = node.value + 1
    elif isinstance(node, ast.Call) and isinstance(node.func, ast.Name) and node.func.id in ("min", "max"):
        node.func.id = "max" if node.func.id == "min" else "min"
    else:
        return False
    return True


def _replaced(tree: ast.Module, old: ast.stmt, new: ast.stmt) -> str:
    """The text of a tree in which one statement is another."""
    for node in ast.walk(tree):
        for name in ("body", "orelse", "finalbody"):
            body = getattr(node, name, None)
            if isinstance(body, list) and any(each is old for each in body):
                place = next(number for number, each in enumerate(body) if each is old)
                body[place] = new
                text = ast.unparse(tree)
                body[place] = old
                return text
    raise LookupError(_head(old))


class Drawn(NamedTuple):
    """A fault, and the file that it is put into."""

    path: Path
    mutant: Mutant

    @property
    def digest(self) -> str:
        """What it is known by."""
        return hashlib.sha256(f"{self.path}{self.mutant.source}".encode()).hexdigest()[:16]


def drawn_faults(root: Path, path: Path, sample: int, seed: int) -> tuple[list[Drawn], int]:
    """Faults drawn from a file or the files of a folder, and how many there are in all."""
    files = sorted((root / path).rglob("*.py")) if (root / path).is_dir() else [root / path]
    every = [
        Drawn(file.relative_to(root), mutant)
        for file in files
        for mutant in mutants_of(file.read_text("utf-8"))
    ]
    chosen = every if sample <= 0 else random.Random(seed).sample(every, min(sample, len(every)))
    return chosen, len(every)


def main(words: Sequence[str]) -> int:
    """Run the command; 1 where a fault was not found."""
    args = parse(Args, words)
    root, path = Path(__file__).parents[2], Path(args.path)
    if not (root / path).is_dir() and (not (root / path).is_file() or path.suffix != ".py"):
        raise SettingError("path", args.path, "a Python file or a folder, from the root of the checkout")
    drawn, every = drawn_faults(root, path, args.sample, args.seed)
    args.out.mkdir(parents=True, exist_ok=True)
    kept = args.out / f"{'.'.join(path.with_suffix('').parts)}.jsonl"
    lines = kept.read_text("utf-8").splitlines() if kept.exists() else []
    known = {row["digest"]: row for row in map(json.loads, lines)}
    if any(fault.digest not in known for fault in drawn):
        package = path.parts[1] if (root / path).is_dir() else path.parent.parts[1]
        tests = args.tests or tuple(dict.fromkeys((f"tests/{package}", "tests/missions")))
        with tempfile.TemporaryDirectory() as folder:
            _copy(root, Path(folder))
            quick = _quick_tests(Path(folder), tests, args.test_s)
            print(f"{len(quick)} tests are quick enough", flush=True)
            for fault in drawn:
                if fault.digest not in known:
                    row = _row(Path(folder), fault, quick, args.limit_s)
                    known[fault.digest] = row
                    with kept.open("a", encoding="utf-8") as file:
                        file.write(json.dumps(row) + "\n")
                    print(
                        f"{row['path']}:{row['line']}: {row['found'] or 'SURVIVED'}: {row['what']}",
                        flush=True,
                    )
    survivors = sum(not known[fault.digest]["found"] for fault in drawn)
    print(f"{len(drawn) - survivors} of {len(drawn)} faults were found, of {every} that there are")
    return SURVIVED if survivors else 0


def _row(folder: Path, fault: Drawn, quick: Sequence[str], limit_s: float) -> dict[str, Any]:
    """What came of a fault in a copy of the checkout."""
    file, mutant = folder / fault.path, fault.mutant
    sound = file.read_bytes()
    file.write_text(mutant.source, "utf-8")
    own = f"test_{fault.path.stem}.py"
    try:
        found = _found(folder, sorted(quick, key=lambda test: own not in test), limit_s)
    finally:
        file.write_bytes(sound)
    what = {"path": str(fault.path), "line": mutant.line, "what": mutant.what, "found": found}
    return {"digest": fault.digest, **what}


def _copy(root: Path, folder: Path) -> None:
    """Copy what git knows of the checkout."""
    listed = subprocess.run(
        ["git", "ls-files", "-z"], cwd=root, capture_output=True, check=True
    ).stdout.decode()
    for name in filter(None, listed.split("\0")):
        if (root / name).is_file():
            (folder / name).parent.mkdir(parents=True, exist_ok=True)
            shutil.copyfile(root / name, folder / name)


def _quick_tests(folder: Path, tests: Sequence[str], test_s: float) -> list[str]:
    """Names of the tests that pass with interpreted kernels within so many seconds each."""
    told = folder / "told.txt"
    _pytest(folder, tests, {LIMIT: str(test_s), TOLD: str(told)}, None)
    return names_of(told_in(told))


def _found(folder: Path, tests: Sequence[str], limit_s: float) -> str:
    """Which test failed, or "late"; empty = none did."""
    (folder / "chosen.txt").write_text("\n".join(tests), "utf-8")
    try:
        done = _pytest(folder, ["-x", "@chosen.txt"], {LIMIT: "30"}, limit_s)
    except subprocess.TimeoutExpired:
        return "late"
    if done.returncode == 0:
        return ""
    failed = [line for line in done.stdout.splitlines() if line.startswith(("FAILED", "ERROR"))]
    return failed[0].partition(" - ")[0] if failed else f"exit code {done.returncode}"


def _pytest(
    folder: Path, words: Sequence[str], variables: Mapping[str, str], limit_s: float | None
) -> subprocess.CompletedProcess[str]:
    """Run pytest in a copy of the checkout, with interpreted kernels."""
    plugins = ["-p", "no:cacheprovider", "-p", "benchmarks.reliability.quick_tests"]
    return subprocess.run(
        [sys.executable, "-m", "pytest", "-q", "-W", "ignore", *plugins, *words],
        cwd=folder,
        env={**os.environ, "PYTHONPATH": str(folder), "NUMBA_DISABLE_JIT": "1", **variables},
        capture_output=True,
        text=True,
        timeout=limit_s,
        check=False,
    )


if __name__ == "__main__":
    raise SystemExit(run_command(main))

"""The page of the proofs: how many cases, what came of them, and every failure."""

from __future__ import annotations

import json
from collections import Counter, defaultdict
from collections.abc import Callable, Iterable, Mapping, Sequence
from pathlib import Path
from types import MappingProxyType
from typing import Any, NamedTuple

from benchmarks.reliability.fault_table import fault_table, share_found
from benchmarks.reliability.file_fuzz import FILES
from benchmarks.reliability.memory import MOST_GROWTH
from benchmarks.reliability.settings_fuzz import STEPS, WATCHDOG_S
from benchmarks.reliability.soak_table import grew, memory_table, soak_table
from benchmarks.reliability.sources import HOW

Row = Mapping[str, Any]
_MUTANTS, _SHARE_FOUND, _SHARE_COVERED = 300, 0.9, 0.95


class Kept(NamedTuple):
    """What is kept of a proof."""

    rows: Sequence[Row]
    reached: int
    """What the rows come to: cases, robot-steps, kills or files."""
    asked: int
    """What a full run comes to."""


def read_rows(file: Path) -> list[dict[str, Any]]:
    """What is kept in a file, a line each."""
    return [json.loads(line) for line in file.read_text("utf-8").splitlines()] if file.exists() else []


def page(
    kept: Mapping[str, Kept],
    mutants: Mapping[str, Sequence[Row]],
    coverage: Sequence[Row],
    versions: Mapping[str, str],
    commits: Mapping[str, str] = MappingProxyType({}),
) -> str:
    """The page as Markdown.

    Args:
        kept: Of each proof.
        mutants: Of each file or folder whose faults were drawn.
        coverage: A row a source file.
        versions: Of what results depend on.
        commits: Digest of the library's sources → a commit that has it.
    """
    lines = [
        "# Reliability",
        "",
        "Made by `python -m benchmarks.reliability --page docs/results/reliability.md`, with "
        + ", ".join(f"{name} {version}" for name, version in versions.items())
        + ". What was played is kept, and the page says how much of what is asked for it comes to: "
        "`make reliability` goes on from there.",
        "",
    ]
    lines += [_overview(kept, mutants, coverage), ""]
    for name, (title, unit, summary) in _SUMMARIES.items():
        rows, reached, asked = kept[name]
        failed = [row for row in rows if "failure" in row]
        lines += [f"## {title}", "", f"{reached:,} of {asked:,} {unit}; {len(failed):,} cases failed."]
        played = [row for row in rows if "failure" not in row]
        lines += [summary(played)] if played else []
        lines += [_played_by(rows)] if rows else []
        lines += ["", *(f"- case {row['number']}: {row['failure'][:300]}" for row in failed[:20]), ""]
    lines += ["## Faults in formulas", "", fault_table(mutants), ""]
    lines += ["## Branches", "", _coverage(coverage), ""]
    lines += ["## Sources", "", _sources(kept, commits), ""]
    return "\n".join(_without_double(lines)).rstrip() + "\n"


def _without_double(lines: Iterable[str]) -> list[str]:
    """Lines without an empty one after another."""
    found: list[str] = []
    for line in lines:
        if line or not found or found[-1]:
            found.append(line)
    return found


def _overview(kept: Mapping[str, Kept], mutants: Mapping[str, Sequence[Row]], coverage: Sequence[Row]) -> str:
    """What is asked for and not reached, in one list."""
    missing = [
        f"{_SUMMARIES[name][0]}: {each.reached:,} of {each.asked:,} {_SUMMARIES[name][1]}"
        for name, each in kept.items()
        if each.reached < each.asked
    ]
    faults = {row["digest"]: row for rows in mutants.values() for row in rows}.values()
    if len(faults) < _MUTANTS:
        missing.append(f"Faults in formulas: {len(faults)} of {_MUTANTS} drawn")
    if faults and share_found(faults) < _SHARE_FOUND:
        missing.append(f"Faults in formulas: {share_found(faults):.1%} found, {_SHARE_FOUND:.0%} asked for")
    if not coverage:
        missing.append("Branches: not measured")
    elif _share_covered(coverage) < _SHARE_COVERED:
        missing.append(f"Branches: {_share_covered(coverage):.1%} covered, {_SHARE_COVERED:.0%} asked for")
    if (most := max(map(max, grew(kept["memory"].rows)), default=0.0)) >= MOST_GROWTH:
        missing.append(f"Memory: grew by {most:.1%}, less than {MOST_GROWTH:.0%} asked for")
    failed = sum("failure" in row for each in kept.values() for row in each.rows)
    said = f"Cases that failed: {failed}."
    return (
        f"{said} Asked for and not reached:\n\n" + "\n".join(f"- {m}" for m in missing) if missing else said
    )


def _played_by(rows: Sequence[Row]) -> str:
    """By how many states of the library's sources."""
    states = Counter(row["library"] for row in rows if "library" in row)
    if not states:
        return "Which state of the library's sources played them was not noted."
    if len(states) == 1:
        return f"All of them by the library whose sources have the digest {next(iter(states))}."
    latest = [row["library"] for row in rows if "library" in row][-1]
    return f"They were played by {len(states)} states of the library's sources, the latest {latest}."


def _sources(kept: Mapping[str, Kept], commits: Mapping[str, str]) -> str:
    """Which sources played how many cases, and which commits have them."""
    cases: dict[str, Counter[str]] = defaultdict(Counter)
    for name, each in kept.items():
        for row in each.rows:
            cases[row.get("library", "")][_SUMMARIES[name][0].lower()] += 1
    lines = [
        f"The digest of the library's sources is {HOW}. Where no commit is named, the sources were "
        "those of a checkout in between.",
        "",
        "| digest | commit | cases |",
        "| --- | --- | --- |",
    ]
    for digest, counts in sorted(cases.items(), key=lambda item: (item[0] not in commits, item[0])):
        told = ", ".join(f"{number:,} of {name}" for name, number in counts.items())
        lines.append(f"| {digest or 'not noted'} | {commits.get(digest, '-')} | {told} |")
    return "\n".join(lines)


def _settings(rows: Sequence[Row]) -> str:
    refused = Counter(field for row in rows for field in row["refused"])
    most = ", ".join(f"{field} ({count:,})" for field, count in refused.most_common(3))
    slowest = max(row["seconds"] for row in rows)
    return (
        f"Each is a scenario with every setting drawn, played for {STEPS} steps with the kernels' assertions "
        f"compiled in; they may take {WATCHDOG_S:g} s of the processor. The slowest took "
        f"{slowest:.1f} s; {sum(row['episodes'] for row in rows):,} episodes were begun. Before them "
        f"{sum(refused.values()):,} scenarios were refused by name, most for {most or 'nothing'}."
    )


def _states(rows: Sequence[Row]) -> str:
    refused = sum(bool(row["refused"]) for row in rows)
    return (
        f"Each is a saved state, one number changed. {refused:,} were refused by name and changed nothing; "
        f"the missions of {len(rows) - refused:,} went on within their spaces."
    )


def _determinism(rows: Sequence[Row]) -> str:
    digests, variants = defaultdict(set), defaultdict(set)
    for row in rows:
        for number, digest in enumerate(row["digests"], row["first"]):
            played = number, row.get("library")  # another state of the sources may have other states
            digests[played].add(digest)
            variants[played].add(row["variant"])
    differing = sorted({number for (number, _), found in digests.items() if len(found) > 1})
    several = sum(len(found) > 1 for found in variants.values())
    said = f"differences in drawn scenarios {differing}" if differing else "no difference"
    return (
        f"{len(digests):,} drawn scenarios, {several:,} of them in several and up to "
        f"{max(map(len, variants.values()))} processes that differ in processor level, threads, missions "
        f"beside it, hash seed and start method: {said}. A scenario that several states of the sources "
        "played counts for each, and is compared within each."
    )


def _kills(rows: Sequence[Row]) -> str:
    moments = sorted(count for row in rows for count in row["missions_kept"])
    written = sum(row["checkpoints_written"] for row in rows)
    return (
        f"As many kills of sweeps, when {moments[0]} to {moments[-1]} of their 24 missions were kept, and as "
        f"many of a trainer that wrote {written:,} checkpoints. No mission and no checkpoint was "
        "lost, and every "
        "sweep ended with the bytes of one that nobody stopped."
    )


def _files(rows: Sequence[Row]) -> str:
    table = [
        f"{FILES:,} of each loader are asked for. Each must be read or refused by a named error, in little "
        "time and memory, run nothing and read nothing outside its folder. Ended: the reading process died "
        "and was started anew, and an error was raised. Most s: of the processor, for one file. Most MiB: "
        "the most that the reading process held; of records and checkpoints, which the command reads itself, "
        "by how much it grew.",
        "",
        "| loader | files | read | refused | of these ended | most s | most MiB |",
        "| --- | ---: | ---: | ---: | ---: | ---: | ---: |",
    ]
    loaders = dict.fromkeys(row["loader"] for row in rows)
    for loader in loaders:
        own = [row for row in rows if row["loader"] == loader]
        files, loaded, killed = (sum(row[name] for row in own) for name in ("files", "loaded", "killed"))
        most_s = max(row["most_s"] for row in own)
        mib = [row[name] for row in own for name in ("held_mib", "grew_mib") if name in row]
        cells = (loader, f"{files:,}", f"{loaded:,}", f"{files - loaded:,}", f"{killed:,}", f"{most_s:.2f}")
        table.append("| " + " | ".join((*cells, f"{max(mib):.0f}" if mib else "-")) + " |")
    return "\n".join(table) + "\n"


def _training(rows: Sequence[Row]) -> str:
    lines = [
        "Runs that are killed at drawn moments, with all that they started, and resumed. All reached their "
        "end; every figure of their validations and every weight of the policies that they keep is finite.",
        "",
        "| trainer | robot-steps | kills |",
        "| --- | ---: | ---: |",
    ]
    for name in dict.fromkeys(row["trainer"] for row in rows):
        own = [row for row in rows if row["trainer"] == name]
        steps, kills = (sum(row[figure] for row in own) for figure in ("robot_steps", "kills"))
        lines.append(f"| `{name}` | {steps:,} | {kills} |")
    return "\n".join(lines) + "\n"


def _share_covered(rows: Sequence[Row]) -> float:
    return sum(row["covered"] for row in rows) / max(sum(row["branches"] for row in rows), 1)


def _coverage(rows: Sequence[Row]) -> str:
    if not rows:
        return "Not measured yet: `python -m benchmarks.reliability.coverage`."
    lines = [
        f"With kernels interpreted, {_share_covered(rows):.1%} of branches were taken by the tests of these "
        f"folders and some of the environments, each ended after {rows[-1]['test_s']:g} s of the processor "
        "and with a tenth of the drawn examples (`python -m "
        "benchmarks.reliability.coverage`); "
        f"{rows[-1]['files']} of {rows[-1]['of_files']} files of tests were run. What only assertions of "
        "debug builds and type checkers reach is left out.",
        "",
        "| folder | branches | taken |",
        "| --- | ---: | ---: |",
    ]
    for folder in dict.fromkeys(row["path"].rpartition("/")[0] for row in rows):
        own = [row for row in rows if row["path"].rpartition("/")[0] == folder]
        lines.append(f"| {folder} | {sum(row['branches'] for row in own)} | {_share_covered(own):.1%} |")
    return "\n".join(lines)


_SUMMARIES: Mapping[str, tuple[str, str, Callable[[Sequence[Row]], str]]] = {
    "settings": ("Drawn settings", "scenarios", _settings),
    "states": ("Changed states", "states", _states),
    "determinism": ("Determinism", "plays of a scenario", _determinism),
    "kills": ("Kills", "kills", _kills),
    "files": ("Changed files", "files", _files),
    "training": ("Training", "robot-steps", _training),
    "soak": ("Soak", "robot-steps", soak_table),
    "memory": ("Memory", "robot-steps", memory_table),
}

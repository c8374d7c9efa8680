"""The soak, and the memory of its kind of process, as parts of the page of the proofs."""

from __future__ import annotations

from collections import Counter, defaultdict
from collections.abc import Iterable, Mapping, Sequence
from typing import Any

from benchmarks.reliability.memory import CASE_STEPS, growth
from benchmarks.reliability.soak import CHANNELS, FLOOR, MAPS_EVERY, QUICK, ROUND, round_of

Row = Mapping[str, Any]
_SETTLED_STEPS = 1_000_000
"""Robot-steps of a process after which its memory is taken for settled."""
_LONG_STEPS = 100_000
"""Of a case, in which memory has time to settle."""


def soak_table(rows: Sequence[Row]) -> str:
    """How much of each scenario was played, and what their processes held.

    Args:
        rows: What is kept of the cases that did not fail.
    """
    ordered = sorted(rows, key=lambda row: row["number"])
    long = [row for row in ordered if row["robot_steps"] >= _LONG_STEPS] or ordered
    within = max(row["resident_mib"] / row["settled_mib"] - 1.0 for row in long)
    lines = [
        "At each step: observations in their spaces, rewards finite, time never backwards, ends said, bits "
        "gained equal to the entropy lost, every number of the state in its range, the rays of messages on "
        f"their way among them; every voxel, and all other rays, each {MAPS_EVERY} steps.",
        f"First every scenario is played over each of {len(CHANNELS)} channels for {FLOOR:,} robot-steps; "
        f"what is then left is shared, by time, among those that step quickest: {', '.join(QUICK)}. "
        f"{_pairs(ordered)}",
        f"Within a case of {_LONG_STEPS:,} robot-steps or more resident memory grew by "
        f"{max(within, 0.0):.1%} at most after its first fifth.",
        *_held(ordered),
        "",
        "Robot-steps a second are of one core's own time, with everything that is checked.",
        "",
        "| scenario | robot-steps | missions | robot-steps/s |",
        "| --- | ---: | ---: | ---: |",
    ]
    for name in dict.fromkeys(row["scenario"] for row in ordered):
        lines.append(_soaked(name, [row for row in ordered if row["scenario"] == name]))
    lines.append(_soaked("all", ordered))
    return "\n".join(lines) + "\n"


def _pairs(rows: Sequence[Row]) -> str:
    """How many pairs of a scenario and a channel were played, and for how long at least."""
    steps: Counter[tuple[str, int]] = Counter()
    for row in rows:
        steps[row["scenario"], row["channel"]] += row["robot_steps"]
    return f"So far {len(steps)} of these pairs were played, each for {min(steps.values()):,} or more."


def _soaked(name: str, rows: Sequence[Row]) -> str:
    """A line of the table of the soak."""
    steps, missions, cpu_s = (sum(row[k] for row in rows) for k in ("robot_steps", "missions", "cpu_s"))
    return f"| {name} | {steps:,} | {missions:,} | {steps / cpu_s:,.0f} |"


def _held(rows: Sequence[Row]) -> Iterable[str]:
    """What each process held, round by round of all pairs; of those of one round, from its first 10⁶ on."""
    for own in _by_process(rows):
        steps = sum(row["robot_steps"] for row in own)
        rounds = _whole_rounds(own)
        if len(rounds) > 1:
            most, means = (", ".join(f"{kind(held):.0f}" for held in rounds) for kind in (max, _mean))
            risen = _mean(rounds[-1]) / _mean(rounds[1]) - 1.0
            yield (
                f"A process of {steps:,} robot-steps held at most {most} MiB in its rounds of all "
                f"{len(ROUND)} pairs, and {means} MiB on average. The first round compiles kernels for every "
                f"channel; from the second to the last the average grew by {risen:.1%}."
            )
        elif later := _later(own):
            settled, held = later
            yield (
                f"A process of {steps:,} robot-steps held {settled:.0f} MiB after the first 10⁶, then "
                f"{max(held):.0f} MiB at most and {held[-1]:.0f} MiB at its end; scenarios take turns."
            )


def _whole_rounds(rows: Sequence[Row]) -> list[list[float]]:
    """MiB held after each pair, of the rounds that a process played as a whole."""
    rounds: dict[int, list[float]] = defaultdict(list)
    for row in rows:
        rounds[round_of(row["number"])].append(row["resident_mib"])
    return [held for number, held in sorted(rounds.items()) if number >= 0 and len(held) == len(ROUND)]


def _mean(held: Sequence[float]) -> float:
    return sum(held) / len(held)


def _later(rows: Sequence[Row]) -> tuple[float, list[float]] | None:
    """MiB that a process held after its first 10⁶ robot-steps, and after every case from there on."""
    steps, settled = 0, 0.0
    held: list[float] = []
    for row in rows:
        if steps >= _SETTLED_STEPS:
            settled = settled or row["settled_mib"]
            held.append(row["resident_mib"])
        steps += row["robot_steps"]
    return (settled, held) if held else None


def memory_table(rows: Sequence[Row]) -> str:
    """What processes held after their first million robot-steps, and later.

    Args:
        rows: What is kept of the cases that did not fail.
    """
    said = (
        f"Each {CASE_STEPS:,} robot-steps are shared evenly by all {len(ROUND)} pairs of {', '.join(QUICK)} "
        f"and the {len(CHANNELS)} channels of the soak, with its checks. A process compiles in its first "
        "million what it runs in all later ones. Resident memory is read after each million, when the "
        "allocator has given back what is free; and after each pair, as it is."
    )
    return "\n".join([said, *map(_process, _longer_ones(rows))])


def _process(rows: Sequence[Row]) -> str:
    """What one process held."""
    held, most = ([row[name] for row in rows] for name in ("resident_mib", "most_mib"))
    later, (average, line) = held[1:], growth(held)
    steps, mean = sum(row["robot_steps"] for row in rows), sum(later) / len(later)
    return (
        f"A process of {steps:,} robot-steps held {held[0]:.1f} MiB after the first million, and then "
        f"{min(later):.1f} to {max(later):.1f} MiB, {mean:.1f} MiB on average: {_more(average)} than after "
        "the first. Over the later ones the straight line that fits best "
        f"{'rises' if line >= 0.0 else 'falls'} by {abs(line):.2%}; after the last it held "
        f"{_more(held[-1] / held[0] - 1.0)} than after the first. Between pairs, with what the allocator "
        f"keeps for later, it held {most[0]:.1f} MiB at most in the first million, and {max(most[1:]):.1f} "
        "MiB in later ones."
    )


def grew(rows: Sequence[Row]) -> list[tuple[float, float]]:
    """By how much each process of more than a million robot-steps grew, as `memory.growth` says."""
    return [growth([row["resident_mib"] for row in own]) for own in _longer_ones(rows)]


def _longer_ones(rows: Sequence[Row]) -> list[list[Row]]:
    """The millions of each process that played more than one."""
    return [own for own in _by_process(rows) if len(own) > 1]


def _by_process(rows: Sequence[Row]) -> list[list[Row]]:
    """The cases of each process that did not fail, in their order."""
    found: dict[int, list[Row]] = defaultdict(list)
    for row in sorted((row for row in rows if "failure" not in row), key=lambda row: row["number"]):
        found[row["process"]].append(row)
    return list(found.values())


def _more(share: float) -> str:
    return f"{abs(share):.2%} {'more' if share >= 0.0 else 'less'}"

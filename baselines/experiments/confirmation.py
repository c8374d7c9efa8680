"""Keeps results that older code made, where samples come out the same with the code of today.

Results are kept under a digest of the code (`runner`), and most edits of code change no result. Of every
group of results that the same code made, the first is run again, and so are missions that came to no end
where most of the group did: a mend may have changed these alone. If the first comes out the same but for
its times on the clock, the others of the group count as results of the code of today; else they are run
again, too.
"""

from __future__ import annotations

import json
from collections.abc import Sequence

from baselines.experiments.outcome import Record
from baselines.experiments.runner import (
    TRACE,
    Conditions,
    Work,
    read_older_record,
    run_all,
    write_record,
)

CLOCK = "clock"
"""Key of a record under which lies what differs from run to run."""


def keep_confirmed(works: Sequence[Work], groups: Sequence[str], conditions: Conditions) -> int:
    """Run samples of what older code made, and keep the groups of those that come out the same.

    Args:
        works: In the order in which they are run.
        groups: Name of the group of each.
        conditions: For the samples.

    Returns:
        How many results are kept that were not run again.
    """
    older: dict[tuple[str, str], list[tuple[Work, Record]]] = {}
    for work, group in zip(works, groups, strict=True):
        found = read_older_record(conditions.folder, work)
        if found is not None and found[0] != work.code_digest():
            older.setdefault((group, found[0]), []).append((work, found[1]))
    samples = [group[0] for group in older.values()]
    doubtful = [pair for group in older.values() for pair in _doubtful(group)]
    again = run_all([work for work, _ in (*samples, *doubtful)], conditions)[: len(samples)]
    kept, seen = 0, {work.file for work, _ in doubtful}
    for (_, before), now, (_, *others) in zip(samples, again, older.values(), strict=True):
        if _but_for_clock(before) == _but_for_clock(now):
            for work, record in others:
                if work.file in seen:
                    continue
                write_record(conditions.folder, work, work.code_digest(), record)
                kept += 1
    return kept


def _doubtful(group: Sequence[tuple[Work, Record]]) -> list[tuple[Work, Record]]:
    """Missions after the first that came to no end, where most of the group did."""
    ended = [_ended(record) for _, record in group]
    if 2 * sum(ended) <= len(group):
        return []
    return [pair for pair, whole in zip(group[1:], ended[1:], strict=True) if not whole]


def _ended(record: Record) -> bool:
    return "failed" not in record and bool(record.get("finished", True))


def _but_for_clock(record: Record) -> str:
    """What a record says that is the same in every run, on every machine."""
    return json.dumps({k: value for k, value in record.items() if k not in (CLOCK, TRACE)}, sort_keys=True)

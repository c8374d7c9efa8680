"""The table of an experiment: one row a trial, JSON Lines, grown row by row and sorted when it is complete.

A row is appended in one write. What a kill leaves of a row is the end of the file without a line feed: it is
dropped, and that trial is run again. Any other line that is no row is an error, and the file stays as it is.
A table of the suffix .xz is compressed: it can be read and written whole, not grown.
"""

from __future__ import annotations

import contextlib
import json
import lzma
import os
from collections import Counter
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from baselines.experiments.origin import Origin
from entropy_explore_env.errors import SettingError
from entropy_explore_env.writing import write_atomically

Record = dict[str, Any]
"""What is kept of a trial; JSON. Under `clock` lies what differs from run to run."""
VERSION = 1
"""Of the table: rows of another one are refused."""


@dataclass(frozen=True)
class Row:
    """A trial that was run.

    Attributes:
        cell: Name of the point of the experiment.
        seed: Of the trial.
        world: Name of its world or file.
        settings: All that decides the record, but the code.
        origin: The code that made it.
        record: What came of it.
    """

    cell: str
    seed: int
    world: str
    settings: dict[str, Any]
    origin: Origin
    record: Record

    @property
    def key(self) -> str:
        """What tells rows apart: two with the same key are the same trial."""
        return trial_key(self.cell, self.seed, self.settings)

    def line(self) -> str:
        """Return the row as a line of a table."""
        fields = {"table": VERSION, **asdict(self)}
        origin = fields.pop("origin")
        record = fields.pop("record")
        return json.dumps({**fields, **origin, "record": record}, allow_nan=False, ensure_ascii=False)


def trial_key(cell: str, seed: int, settings: dict[str, Any]) -> str:
    """Return what tells a trial apart from others of a table."""
    return f"{cell}\t{seed:09}\t{json.dumps(settings, sort_keys=True, ensure_ascii=False)}"


def read_table(table: Path) -> list[Row]:
    """Return the rows of a table: of trials that were run twice the later, in the order of their keys.

    Args:
        table: The file, JSON Lines, or compressed with the suffix .xz; without one there are no rows.

    Raises:
        SettingError: The file cannot be read, or a line is no row, or one of another version.
    """
    try:
        content = table.read_bytes()
        text = (lzma.decompress(content) if table.suffix == ".xz" else content).decode(errors="replace")
    except (FileNotFoundError, NotADirectoryError):
        return []
    except (OSError, lzma.LZMAError) as error:
        raise SettingError("table", str(table), f"a file of rows that can be read ({error})") from None
    whole = text[: text.rfind("\n") + 1]
    lines = whole.split("\n")[:-1]
    return _sorted(_row(line, f"{table}, line {number}") for number, line in enumerate(lines, 1))


def _row(line: str, place: str) -> Row:
    """Return the row that a line holds."""
    try:
        fields = json.loads(line)
        version = fields.pop("table")
    except (ValueError, AttributeError, KeyError, TypeError):
        allowed = "one row of a table; mend or remove the line, or the file, to run its trials again"
        raise SettingError("table", place, allowed) from None
    if version != VERSION:
        allowed = f"a row of version {VERSION} of tables: this is one of version {version}"
        raise SettingError("table", place, allowed)
    try:
        origin = Origin(fields.pop("commit"), fields.pop("clean"), fields.pop("versions"))
        row = Row(**fields, origin=origin)
        kinds = (row.cell, str), (row.seed, int), (row.settings, dict), (row.record, dict)
        if not all(isinstance(value, kind) for value, kind in kinds):
            raise TypeError
        return row
    except (KeyError, TypeError):
        fields = "cell, seed, world, settings, commit, clean, versions, record"
        raise SettingError("table", place, f"a row with the fields {fields}") from None


def _sorted(rows: Iterable[Row]) -> list[Row]:
    """Return the last row of each key, in the order of keys."""
    latest = {row.key: row for row in rows}
    return [latest[key] for key in sorted(latest)]


def write_table(table: Path, rows: Iterable[Row]) -> None:
    """Write a whole table, sorted: the same bytes for the same rows. The suffix .xz compresses it."""
    content = "".join(f"{row.line()}\n" for row in _sorted(rows)).encode()
    write_atomically(table, lzma.compress(content, preset=9) if table.suffix == ".xz" else content)


class GrowingTable:
    """A table that one command at a time may grow."""

    def __init__(self, table: Path) -> None:
        """Take the path."""
        self._path = table

    @contextlib.contextmanager
    def opened(self) -> Iterator[list[Row]]:
        """Hold the table, and give the rows that are in it.

        Raises:
            SettingError: Another command holds it, or see `read_table`.
        """
        if self._path.suffix == ".xz":
            raise SettingError(
                "table", str(self._path), "a table that is not compressed, where rows are added"
            )
        self._path.parent.mkdir(parents=True, exist_ok=True)
        with self._path.with_name(f".{self._path.name}.lock").open("w") as lock:
            _hold(lock.fileno(), self._path)
            rows = read_table(self._path)
            self._drop_cut_row()
            yield rows

    def _drop_cut_row(self) -> None:
        """Remove what a kill left of a row at the end of the file."""
        if self._path.exists():
            content = self._path.read_bytes()
            whole = content.rfind(b"\n") + 1
            if whole < len(content):
                os.truncate(self._path, whole)

    def append(self, *rows: Row) -> None:
        """Add rows, in one write; where the disk is full, nothing of them stays."""
        descriptor = os.open(self._path, os.O_WRONLY | os.O_CREAT | os.O_APPEND, 0o644)
        before = os.fstat(descriptor).st_size
        try:
            rest = "".join(f"{row.line()}\n" for row in rows).encode()
            while rest:
                rest = rest[os.write(descriptor, rest) :]
            os.fsync(descriptor)
        except OSError as error:
            os.ftruncate(descriptor, before)
            raise OSError(error.errno, error.strerror, str(self._path)) from None
        finally:
            os.close(descriptor)

    def finish(self) -> None:
        """Sort the table: the same rows are the same bytes, in whatever order they came."""
        content = self._path.read_bytes() if self._path.exists() else b""
        rows = read_table(self._path)
        if content != "".join(f"{row.line()}\n" for row in rows).encode():
            write_table(self._path, rows)


def _hold(descriptor: int, table: Path) -> None:
    """Hold a table's lock until the file is closed or the process ends, where the system has such locks."""
    try:
        import fcntl
    except ImportError:
        return
    try:
        fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except OSError:
        raise SettingError("table", str(table), "a table that no other command is adding to") from None


def origins_line(rows: Sequence[Row]) -> str:
    """Return the one line of a page that says which commits its rows come from."""
    counts = Counter((row.origin.commit, row.origin.clean) for row in rows)
    parts = [
        f"`{commit or 'unknown'}`{'' if clean else ' with changes that were not committed'} ({count:,})"
        for (commit, clean), count in counts.most_common()
    ]
    return f"Rows: {len(rows):,}, of commit " + ", ".join(parts) + "."

"""Archives of kept results: one compressed file that a page of results is published with.

Who downloads it goes on where the page stopped, or sets a strategy of their own beside the missions that
others ran. A line is the content of one file of `runner`, as JSON, with its name; what is read from an
archive is checked like any kept file, so that nothing counts that other settings or other code made. Arrays
that lie beside records take no part, nor do the traces of missions that failed, which name folders.
"""

from __future__ import annotations

import json
import lzma
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from baselines.experiments.runner import Work, kept_content, kept_file, read_older_record, without_trace
from entropy_explore_env.errors import SettingError
from entropy_explore_env.writing import write_atomically

_FILE = "file"
"""Key of a line under which the name of the kept file lies."""


def write_archive(archive: Path, folder: Path, works: Sequence[Work]) -> int:
    """Put what is kept of some work into one file.

    Args:
        archive: The file, xz.
        folder: Of the kept files.
        works: Those that take part, if something is kept of them under their settings.

    Returns:
        How many results are in it.
    """
    kept = [work for work in works if read_older_record(folder, work) is not None]
    lines = [
        json.dumps({_FILE: work.file, **without_trace(kept_content(folder, work))}, allow_nan=False)
        for work in sorted(kept, key=lambda work: work.file)
    ]
    text = "".join(f"{line}\n" for line in lines)
    write_atomically(archive, lzma.compress(text.encode(), preset=9))
    return len(lines)


def read_archive(archive: Path, folder: Path, works: Sequence[Work]) -> int:
    """Keep what an archive holds of some work; what is kept already, under the same settings, stays.

    Args:
        archive: The file.
        folder: For the kept files.
        works: What the archive is asked for; the rest of it is passed over.

    Returns:
        How many results were taken from it.

    Raises:
        SettingError: The file is not there, or is no such archive; nothing was written then.
    """
    wanted = {work.file: work for work in works if read_older_record(folder, work) is None}
    lines = _lines(archive)
    taken = [line for line in lines if line[_FILE] in wanted]
    for line in taken:
        content = {name: value for name, value in line.items() if name != _FILE}
        write_atomically(kept_file(folder, line[_FILE]), json.dumps(content, allow_nan=False))
    return len(taken)


def _lines(archive: Path) -> list[dict[str, Any]]:
    """The lines of an archive."""
    lines: list[Any]
    try:
        lines = [json.loads(line) for line in lzma.decompress(archive.read_bytes()).splitlines()]
    except OSError as error:
        raise SettingError("archive", str(archive), f"a file that can be read: {error.strerror}") from None
    except (lzma.LZMAError, ValueError):
        lines = [None]
    if not all(isinstance(line, dict) and isinstance(line.get(_FILE), str) for line in lines):
        raise SettingError("archive", str(archive), "an archive of missions: missions.jsonl.xz of a page")
    return lines

"""Files of a search: lines of JSON, the first of which says what they come from.

A pair's line is written when both of its missions are over. A last line that is not whole, of a run that was
killed, is not there; whatever else is broken is a named error.
"""

from __future__ import annotations

import json
import math
from pathlib import Path
from typing import Any

from entropy_explore_env.writing import write_atomically
from training.errors import LabelsError
from training.policy_improvement.origin import Origin


def read_object(file: Path, origin: Origin) -> dict[str, Any]:
    """A file that is one JSON object, with its origin among the rest.

    Raises:
        LabelsError: It is broken, or of another origin.
    """
    found = _head_of(file, _parsed(file, _text_of(file)))
    origin.check(file, found)
    return found


def read_pairs(file: Path, origin: Origin, pairs: int) -> dict[int, tuple[float, float, int]]:
    """Of each pair in a file both mission times, and how many missions were finished.

    Raises:
        LabelsError: It is broken, or of another origin.
    """
    if not file.is_file():
        return {}
    *lines, torn = _text_of(file).split("\n")
    if not lines:
        return {}
    origin.check(file, _head_of(file, _parsed(file, lines[0])))
    if torn:
        write_atomically(file, "\n".join(lines) + "\n")
    return dict(_pair_in(file, line, pairs) for line in lines[1:])


def _pair_in(file: Path, line: str, pairs: int) -> tuple[int, tuple[float, float, int]]:
    match _parsed(file, line):
        case [int(pair), float(plus), float(minus), int(finished)]:
            if 0 <= pair < pairs and 0.0 < plus < math.inf and 0.0 < minus < math.inf:
                return pair, (plus, minus, finished)
    allowed = f"a pair's number below {pairs}, two mission times and how many were finished: remove the file"
    raise LabelsError(str(file), line[:40], allowed)


def _text_of(file: Path) -> str:
    try:
        return file.read_text("utf-8")
    except (OSError, UnicodeDecodeError):
        raise LabelsError(str(file), "not text", "lines of JSON: remove the file") from None


def _parsed(file: Path, text: str) -> Any:  # noqa: ANN401 - as JSON has it
    try:
        return json.loads(text)
    except (ValueError, RecursionError):
        raise LabelsError(str(file), text[:40], "lines of JSON: remove the file") from None


def _head_of(file: Path, parsed: Any) -> dict[str, Any]:  # noqa: ANN401 - as JSON has it
    """What a file says of itself."""
    if not isinstance(parsed, dict):
        raise LabelsError(str(file), "no head", "one that says what it comes from: remove the file")
    return parsed

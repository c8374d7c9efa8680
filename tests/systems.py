"""What tests need of the system that they run on, so that the suite runs on Linux, macOS and Windows."""

from __future__ import annotations

import os
from pathlib import Path

import pytest

needs_posix = pytest.mark.skipif(
    not hasattr(os, "fork"), reason="needs POSIX: forks, signals that end a process, links, pipes"
)


def processes_with(mark: str, title: bytes) -> list[int]:
    """Processes with this in their environment, whose titles begin so (of Linux: by /proc)."""
    found = []
    for path in Path("/proc").glob("[0-9]*/cmdline"):
        try:
            ours = mark.encode() in path.with_name("environ").read_bytes()
            if ours and path.read_bytes().startswith(title):
                found.append(int(path.parent.name))
        except OSError:
            pass
    return found

"""What tests need of the system that they run on, so that the suite runs on Linux, macOS and Windows."""

from __future__ import annotations

import os

import pytest

needs_posix = pytest.mark.skipif(
    not hasattr(os, "fork"), reason="needs POSIX: forks, signals that end a process, links, pipes"
)

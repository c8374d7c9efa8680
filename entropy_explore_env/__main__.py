"""The library's command: `python -m entropy_explore_env doctor | warm | worlds | conformance`.

Each part has its own `--help`. Exit codes: 0 done, 1 a check failed, 2 bad input, 130 interrupted.
"""

from __future__ import annotations

import importlib
import sys
from collections.abc import Sequence

from entropy_explore_env.command import UsageError, run_command
from entropy_explore_env.errors import one_of
from entropy_explore_env.version import VERSION

PARTS = {
    "doctor": ("entropy_explore_env.doctor", "versions, cache folder, what is compiled, for reports"),
    "warm": ("entropy_explore_env.warm", "compile the kernels of scenarios ahead of time"),
    "worlds": ("entropy_explore_env.worlds.commands", "list, draw and convert worlds"),
    "conformance": ("entropy_explore_env.envs.conformance", "check the contract of a scenario"),
}
"""Part of the command → the module whose `main` it is, and what it does."""


def main(words: Sequence[str]) -> int:
    """Run the part of the command that the first word names; return the exit code."""
    part, *rest = words or ["--help"]
    if part in ("-h", "--help"):
        print("usage: python -m entropy_explore_env PART [OPTIONS], where PART is\n")
        for name, (_, text) in PARTS.items():
            print(f"  {name:<12} {text}")
        print("\n  --version    print the library's version\n  --help       this help, or after PART its own")
        return 0
    if part == "--version":
        print(f"entropy_explore_env {VERSION}")
        return 0
    if part not in PARTS:
        raise UsageError(f"{part}: expected {one_of(part, PARTS)}; see --help")
    return importlib.import_module(PARTS[part][0]).main(rest)


def command() -> int:
    """Run the command as a program of its own."""
    return run_command(main)


if __name__ == "__main__":
    sys.exit(command())

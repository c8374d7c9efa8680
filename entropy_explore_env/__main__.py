"""`python -m entropy_explore_env --version`, and `… doctor`: versions, cache folder, what is compiled.

Exit codes of `doctor`: 0 no problem found, 1 a problem, 2 bad input.
"""

from __future__ import annotations

import argparse
import json
import sys
from collections.abc import Sequence

from entropy_explore_env.command import LineParser, run_command
from entropy_explore_env.doctor import findings, report
from entropy_explore_env.version import VERSION

_OTHERS = """other commands of the library:
  python -m entropy_explore_env.worlds             list, draw and convert worlds
  python -m entropy_explore_env.warm               compile ahead of time
  python -m entropy_explore_env.envs.conformance   check the contract of a scenario"""


def main(words: Sequence[str]) -> int:
    """Run the command; the exit code."""
    kind = argparse.RawDescriptionHelpFormatter
    about = "The library's version, and what is installed and compiled, for reports of problems."
    parser = LineParser("python -m entropy_explore_env", None, about, _OTHERS, formatter_class=kind)
    parser.add_argument("--version", action="version", version=f"entropy_explore_env {VERSION}")
    commands = parser.add_subparsers(dest="command", required=True)
    doctor = commands.add_parser("doctor", help="versions, cache folder, what is compiled")
    doctor.add_argument("--json", action="store_true", help="print one JSON object and nothing else")
    given = parser.parse_args(words)
    found = findings()
    print(json.dumps(found) if given.json else report(found))
    return 1 if found["problems"] else 0


def command() -> int:
    """The command as a program of its own."""
    return run_command(main)


if __name__ == "__main__":
    sys.exit(command())

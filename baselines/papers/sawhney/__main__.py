"""Sawhney 2009 reproduced: `python -m baselines.papers.sawhney [--quick] [--out DIR] [--json]`.

Explores plans and terrains by visibility per time, V/t, against V - βt, synchronous allocation, naive
visibility and other rules of frontiers; times to 95 %, to 99 % and to no frontier side by side. Missions are
kept under `--runs`: a stopped experiment goes on where it was.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from baselines.cli.arguments import parse, run_command
from baselines.experiments.cells import run_cells
from baselines.experiments.reproduction import (
    PaperArgs,
    Reproduced,
    check_counts,
    command_line,
    reproduce,
)
from baselines.papers.sawhney.claims import all_claims
from baselines.papers.sawhney.sweep import TEAMS, experiment
from baselines.papers.sawhney.terrain_model import JACKSBORO, write_model
from entropy_explore_env.errors import SettingError

_STARTS, _QUICK_STARTS = 40, 4


@dataclass
class Args(PaperArgs):
    """Reproduce Sawhney, Fast Exploration in 2D and 3D Terrains."""

    quick: bool = False
    """Fewer starts, team sizes and β."""
    out: Path = Path("results/sawhney")
    runs: Path = Path("results/sawhney-runs")
    starts: int | None = None
    """Missions a point in each plan; default: 40 (160 over the four plans), with --quick 4."""
    flights: int | None = None
    """The same over each terrain; 0 = plans only; default: 40 (120 over all three), with --quick 4."""
    dem: str | None = None
    """A height map's file to fly over as well, in voxels of 1 m; default: jacksboro, a model of the
    elevations that come with matplotlib; with --quick none."""
    maps: tuple[Path, ...] = ()
    """Plans from files, such as warehouse.yaml, to explore as well."""
    teams: tuple[int, ...] = ()
    """Team sizes, from 1 to 6; default: all, with --quick 1 and 3 in plans, 3 over terrain."""


def main(words: Sequence[str]) -> int:
    """Run the command."""
    args = parse(Args, words, description=__doc__)
    check_counts(args, starts=2)
    _check(args)
    return reproduce("Sawhney", args, lambda: _reproduced(args))


def _reproduced(args: Args) -> Reproduced:
    from baselines.papers.sawhney.report import write_report  # matplotlib: after the help

    usual = _QUICK_STARTS if args.quick else _STARTS
    flights = usual if args.flights is None else args.flights
    ground = _ground(args)
    dem = None if ground is None else write_model(args.runs) if ground == JACKSBORO else Path(ground)
    cells = experiment(args.starts or usual, flights, args.quick, dem, args.maps, args.teams)
    records = run_cells(cells, args.runs, args.workers, "Sawhney", quiet=args.json)
    claims = all_claims(records)
    return Reproduced(write_report(args.out, records, claims, command_line("sawhney", args), dem), claims)


def _ground(args: Args) -> str | None:
    """The height map to fly over besides the terrains: a file, or the model that comes with us."""
    return args.dem or (None if args.quick or args.flights == 0 else JACKSBORO)


def _check(args: Args) -> None:
    """Check the options that are no plain counts.

    Raises:
        SettingError: One has a value that is not allowed.
    """
    if args.flights is not None and (args.flights < 0 or args.flights == 1):
        raise SettingError("flights", args.flights, "0, or a whole number ≥ 2")
    for team in args.teams:
        if team not in TEAMS or args.teams.count(team) > 1:
            raise SettingError("teams", args.teams, f"different ones of {TEAMS}")
    ground = _ground(args)
    if ground is not None and ground != JACKSBORO and not Path(ground).is_file():
        raise SettingError("dem", ground, f"a height map's file, or {JACKSBORO}")
    for file in args.maps:
        if not file.is_file():
            raise SettingError("maps", str(file), "files of plans")
    if len({file.stem for file in args.maps}) < len(args.maps):
        raise SettingError("maps", " ".join(map(str, args.maps)), "files of different names")


if __name__ == "__main__":
    raise SystemExit(run_command(main))

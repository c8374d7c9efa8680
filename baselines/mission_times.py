"""How long a reference strategy takes in each named scenario: `python -m baselines.mission_times`.

Missions of the scenario's own team, or with `--robots 1` of one robot, in worlds of the training split, with
the seeds 0, 1, …. From their median the default cost of a second follows, `Reward.cost_per_s` = 0.2 / median,
so that a mission as long as the median costs a fifth of all bits. `MISSION_TIMES` in
entropy_explore_env/scenarios.py holds what this prints.
Missions are kept, a file each: an interrupted run continues where it was.
"""

from __future__ import annotations

import statistics
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from baselines.cli.arguments import make_folder, parse, print_json, run_command
from baselines.cli.worker_options import WorkerOptions
from baselines.experiments.cells import Cell, run_cells
from baselines.experiments.mission import figures_record
from baselines.experiments.outcome import Record
from baselines.experiments.tables import markdown_table
from entropy_explore_env.errors import SettingError
from entropy_explore_env.scenario import Scenario, with_settings
from entropy_explore_env.scenarios import COST_OF_A_MISSION, SCENARIOS
from entropy_explore_env.validation import check_whole

REFERENCE = "information-rate-v0"
"""The strategy whose mission times the costs refer to, for ever."""
REFERENCES = {"bhattacharya-cluttered": "per-time-visibility", "cliff": "cliff-next-best-view"}
"""Where another one's count, since that one hardly ends there: see `MISSION_TIMES`."""


@dataclass
class Args(WorkerOptions):
    """Measure mission times of the reference strategies in the named scenarios."""

    scenarios: str = "all"
    """Named scenarios, commas between."""
    seeds: int = 24
    """Missions in each."""
    robots: int | None = None
    """In a team; default: as many as the scenario has."""
    runs: Path = Path("results/mission-times")
    """Folder that keeps the missions."""
    json: bool = False
    """Print one JSON object and nothing else."""


def main(words: Sequence[str]) -> int:
    """Run the command."""
    args = parse(Args, words, description=__doc__)
    check_whole("seeds", args.seeds, 1)
    if args.robots is not None:
        check_whole("robots", args.robots, 1)
    workers = args.workers
    names = list(SCENARIOS) if args.scenarios == "all" else args.scenarios.split(",")
    for name in names:
        if name not in SCENARIOS:
            raise SettingError("scenarios", name, "all, or names out of " + ", ".join(SCENARIOS))
    make_folder("runs", args.runs)
    cells = [
        Cell(name, _trained_in(name, args.robots), reference(name), args.seeds, figures_record)
        for name in names
    ]
    records = run_cells(cells, args.runs, workers, "mission times", quiet=args.json)
    rows = [summary(name, records[name]) for name in names]
    if args.json:
        print_json({"rows": rows})
    else:
        head = ["scenario", "strategy", "robots", "finished"]
        head += ["median (s)", "cost_per_s", "return", "team's return"]
        print(markdown_table(head, [_cells(row) for row in rows]), end="")
    return 0


def _trained_in(name: str, robots: int | None) -> Scenario:
    """A named scenario in worlds of the training split, with another team size if one is given."""
    team = {} if robots is None else {"robots": robots}
    return with_settings(SCENARIOS[name], {"split": "train", **team})


def reference(scenario: str) -> str:
    """The strategy whose mission times count in a scenario."""
    return REFERENCES.get(scenario, REFERENCE)


def summary(scenario: str, records: Sequence[Record]) -> dict[str, Any]:
    """What the missions of a scenario come to.

    Returns:
        The `strategy`; `median_s` of the mission times, one that was cut off counting with its time limit;
        `cost_per_s`; `missions`, and how many are `finished`; `return_individual` and `return_team`: medians
        of the sum of rewards, as a mean over the robots, at this cost and with either kind of reward.
    """
    median_s = statistics.median(record["t_mission_s"] for record in records)
    cost_per_s = COST_OF_A_MISSION / median_s
    returns = [_returns(record, cost_per_s) for record in records]
    return {
        "scenario": scenario,
        "strategy": reference(scenario),
        "robots": records[0]["robots"],
        "missions": len(records),
        "finished": sum(record["finished"] for record in records),
        "median_s": median_s,
        "cost_per_s": cost_per_s,
        "return_individual": statistics.median(individual for individual, _ in returns),
        "return_team": statistics.median(team for _, team in returns),
    }


def _returns(record: Record, cost_per_s: float) -> tuple[float, float]:
    """A mission's sum of rewards, mean over robots: for bits gained alone, and for those heard as well."""
    to_gain = record["entropy_start_bits"] - record["entropy_threshold_bits"]
    gained = statistics.mean(robot["gained_bits"] for robot in record["per_robot"]) / to_gain
    lost = (record["entropy_start_bits"] - record["entropy_mean_bits"]) / to_gain
    cost = cost_per_s * record["t_mission_s"]
    return gained - cost, lost - cost


def _cells(row: dict[str, Any]) -> list[str]:
    return [
        row["scenario"],
        row["strategy"],
        str(row["robots"]),
        f"{row['finished']} of {row['missions']}",
        f"{row['median_s']:,.1f}",
        f"{row['cost_per_s']:.3g}",
        f"{row['return_individual']:.2f}",
        f"{row['return_team']:.2f}",
    ]


if __name__ == "__main__":
    raise SystemExit(run_command(main))

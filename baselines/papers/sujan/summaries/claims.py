"""What summaries gain over batches at equal bits a second: mission time, and errors of maps."""

from __future__ import annotations

import numpy as np

from baselines.experiments.claims import Claim
from baselines.experiments.outcome import Record
from baselines.experiments.statistics import interpolated_ratio_interval, mean_interval
from baselines.papers.sujan.summaries.sweep import BURSTS, EVERY_S, TASKS, batch_id, summary_id

Records = dict[str, list[Record]]
FIGURES = {
    "time": "maps in less time",
    "error": "robots' maps have a smaller error",
    "joint": "the joint map has a smaller error",
}
"""Of claims: what is compared, and what is claimed of it."""


def all_claims(records: Records) -> list[Claim]:
    """Every claim, from the missions' records by cell."""
    claims = []
    for task in TASKS:
        for every_s in EVERY_S:
            ours = records[summary_id(task, every_s)]
            for figure, text in FIGURES.items():
                ratio = interpolated_ratio_interval(
                    np.array([figure_of(records[batch_id(task, burst)], figure) for burst in BURSTS]),
                    np.array([figure_of(records[batch_id(task, burst)], "bits") for burst in BURSTS]),
                    figure_of(ours, figure),
                    figure_of(ours, "bits"),
                )
                claims.append(
                    Claim(
                        f"{figure}-{task}-{every_s:g}",
                        f"{task}, a summary every {every_s:g} s: {text} than batches of as many bits; "
                        f"batches over summaries",
                        "> 1",
                        *ratio,
                        ratio.low > 1.0,
                    )
                )
    return claims


def figure_of(records: list[Record], figure: str) -> np.ndarray:
    """(N,) a figure of each mission of a cell: `time`, `bits` a second, `error`, `joint`, `known` or `wrong`.

    Those of maps are at the moment that all missions reach; of a mission that ended before, at its end.
    """
    if figure == "time":
        return np.array([record["t_mission_s"] for record in records], float)
    if figure == "bits":
        return np.array([record["bits_per_s"] for record in records], float)
    name = "joint_error" if figure == "joint" else figure
    return np.array([(record["moment"] or record["end"])[name] for record in records], float)


def shown(records: list[Record], figure: str, form: str) -> str:
    """The mean of a figure, with its interval."""
    return mean_interval(figure_of(records, figure)).text(form)

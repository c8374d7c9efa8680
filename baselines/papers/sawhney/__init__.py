"""Sawhney, Krishna and Srinathan 2009, reproduced: `python -m baselines.papers sawhney`."""

from __future__ import annotations

from functools import partial
from pathlib import Path

from baselines.experiments.experiment import Experiment
from baselines.papers.sawhney import claims, figures
from baselines.papers.sawhney.sweep import experiment

EXPERIMENT = Experiment(
    name="sawhney",
    title="Sawhney",
    template=Path(__file__).with_name("page.md.j2"),
    trials=experiment,
    claims=claims.all_claims,
    groups=claims.GROUPS,
    figures={
        f"{part}-{name}": partial(draw, part=part)
        for part in claims.PARTS
        for name, draw in (
            ("times", figures.figure_times),
            ("beta", figures.figure_beta),
            ("teams", figures.figure_teams),
        )
    },
    values={"held": claims.held_of_paper},
    seeds=40,
    quick_seeds=2,
    least_seeds=2,
)

"""A page for each named scenario, written from the code as the site is built, with a picture of its world."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Callable, Iterable
from pathlib import Path
from typing import TYPE_CHECKING, Any

from baselines.strategies import recommended, resolved
from docs.extensions.attribute_docs import attribute_docs, constant_docs
from docs.extensions.scenario_times import times_table
from docs.extensions.space_numbers import Numbers, action_numbers, discrete_actions, observation_numbers
from entropy_explore_env import environment_id
from entropy_explore_env.errors import SettingError, counted
from entropy_explore_env.missions.rules import rules_of
from entropy_explore_env.settings import scenarios
from entropy_explore_env.settings.changes import with_settings
from entropy_explore_env.settings.ending import gaussian_entropy_bits
from entropy_explore_env.settings.robot_kind import RobotKind
from entropy_explore_env.settings.scenario import Scenario
from entropy_explore_env.settings.scenarios import COST_PER_S_ALONE, SCENARIOS
from entropy_explore_env.worlds.load import make_world
from entropy_explore_env.worlds.pictures import picture
from entropy_explore_env.worlds.recipes.catalogue import RECIPES, about_recipe

if TYPE_CHECKING:
    from sphinx.application import Sphinx

FOLDER = "scenarios"
"""Below `docs/`; git ignores it."""
FILMS = "films"
"""Below `docs/`: NAME.webp is shown where there is one."""


def write_cards(docs: Path) -> list[Path]:
    """Write the pages of all scenarios, and the page that lists them; those of scenarios that are gone go.

    Args:
        docs: The folder of the site's sources.
    """
    folder = docs / FOLDER
    folder.mkdir(exist_ok=True)
    texts = {name: card(scenario, docs) for name, scenario in SCENARIOS.items()}
    written = [_write(folder / f"{name}.md", text.encode()) for name, text in texts.items()]
    written += [
        _write(folder / f"{name}.png", picture(make_world(scenario, 0)))
        for name, scenario in SCENARIOS.items()
    ]
    written.append(_write(folder / "index.md", gallery().encode()))
    for stale in set(folder.iterdir()) - set(written):
        stale.unlink()
    return written


def _write(path: Path, content: bytes) -> Path:
    """Write a file unless it holds this already: Sphinx reads again what is newer."""
    if not path.exists() or path.read_bytes() != content:
        path.write_bytes(content)
    return path


_COST_OF_A_MISSION = 0.2
"""What a mission of the usual length costs, in shares of all bits."""
_WHOSE = {
    "any": "any robot's map",
    "all": "the last robot's map",
    "shared": "the map of the last robot that still works",
    "one": "the map of some robot that still works",
}
"""Ending.termination → by whose map a mission ends."""


_FIRST = ("office", "cave", "terrain")
"""Scenarios that the gallery begins with."""


def gallery() -> str:
    """Return the page that shows all scenarios."""
    names = [*_FIRST, *(name for name in SCENARIOS if name not in _FIRST)]
    rows = [
        [
            f"[![{name}]({name}.png)]({name}.md)",
            f"[{name}]({name}.md), `{environment_id(name)}`<br>{_about(name)}",
        ]
        for name in names
    ]
    pages = "\n".join(names)
    return f"""# Scenario cards

A scenario is a task: a kind of world, a team, what it may do, and when it is over. Each has an id for
`gymnasium.make`, `gymnasium.make_vec` and `pettingzoo.make`; `entropy_explore_env.parallel_env` takes its
name.
These pages are written from the code when the site is built.

{table(["a world", "scenario"], rows)}

```{{toctree}}
:hidden:

{pages}
```
"""


def card(scenario: Scenario, docs: Path) -> str:
    """Return the page of a scenario, Markdown.

    Args:
        scenario: One of SCENARIOS.
        docs: The folder of the site's sources: results and films are looked for in it.
    """
    name = scenario.name
    parts = [
        f"# {name}",
        _about(name),
        f"![A world of {name}]({name}.png)",
        _film(name, docs),
        "```python\nimport entropy_explore_env as eee\n\n"
        f'env = eee.parallel_env("{name}")\nobservations, infos = env.reset(seed=0)\n```',
        f"Ids: `{environment_id(name)}` for `gymnasium.make` (one robot, a step is a decision),\n"
        "`gymnasium.make_vec` (many missions at once), and `pettingzoo.make` with `parallel` or `aec`.",
        _mission(scenario),
        _world(scenario),
        _actions(scenario),
        _observation(scenario),
        _reward(scenario),
        _ending(scenario),
        times_table(scenario, docs / "results"),
        _settings(scenario),
        _versions(name),
    ]
    return "\n\n".join(part for part in parts if part) + "\n"


def _mission(scenario: Scenario) -> str:
    """Return the command that runs a mission, by the strategy that is recommended there."""
    name, strategy = scenario.name, recommended(scenario.name)
    called = f"`{resolved(strategy)}`" + (f" (`{strategy}`)" if resolved(strategy) != strategy else "")
    team = counted(scenario.robots, "robot")
    words = f"{name} --robots {scenario.robots} --strategy {strategy} --out results/{name}"
    return (
        f"A mission of {team} by the strategy that we recommend here, {called}:\n\n"
        f"    python -m baselines.run {words}"
    )


def _about(name: str) -> str:
    """Return what scenarios.py says below the scenario."""
    texts = constant_docs(scenarios)
    named = {getattr(scenarios, key).name: text for key, text in texts.items() if _is_scenario(key)}
    return named[name]


def _is_scenario(name: str) -> bool:
    return isinstance(getattr(scenarios, name), Scenario)


def table(head: list[str], rows: Iterable[Iterable[object]]) -> str:
    """Return a Markdown table whose cells may hold any text."""
    lines = [head, ["---"] * len(head), *([str(cell).replace("|", "\\|") for cell in row] for row in rows)]
    return "\n".join("| " + " | ".join(line) + " |" for line in lines)


def _world(scenario: Scenario) -> str:
    """Size and recipe."""
    grid, recipe = scenario.grid, RECIPES[scenario.world]
    x, y, z = grid.shape
    size = " × ".join(f"{edge:g} m" for edge in (grid.size_m if z > 1 else grid.size_m[:2]))
    voxels = f"{x} × {y} × {z} = {grid.voxels:,} of {grid.voxel_size_m:g} m" + (
        ", one layer: 2-D" if z == 1 else ""
    )
    first = about_recipe(scenario.world)
    file = f"entropy_explore_env/{recipe.__module__.partition('.')[2].replace('.', '/')}.py"
    robots = f"{scenario.robots}" + (
        f", of {len(scenario.kinds)} kinds in turn" if scenario.extra_kinds else ""
    )
    rows = [
        ["workspace", size],
        ["voxels", voxels],
        ["made by", f"recipe `{scenario.world}`: {' '.join(first.split())} [source](../../{file})"],
        [
            "worlds",
            "one for each world number; those of `split` `train`, `validation` and `test` are disjoint",
        ],
        ["robots", robots],
        *(row for kind in scenario.kinds for row in _kind_rows(kind)),
    ]
    return "## World and team\n\n" + table(["", ""], rows)


def _kind_rows(kind: RobotKind) -> list[list[str]]:
    """Return what a kind of robot is, and what it senses with."""
    robot, sensor = kind.robot, kind.sensor
    moves = "drives on the ground" if robot.motion == "planar" else "flies"
    reach = "as far as the workspace" if math.isinf(robot.reach_m) else f"up to {robot.reach_m:g} m"
    seen = "the whole workspace" if math.isinf(sensor.max_range_m) else f"{sensor.max_range_m:g} m"
    widths = " × ".join(f"{math.degrees(width):.3g}°" for width in sensor.field_of_view_rad)
    return [
        ["a robot", f"{moves} at up to {robot.max_speed_m_s:g} m/s; a decision leads {reach} away"],
        ["its sensor", f"{sensor.rays:,} rays in {widths} (yaw × pitch), range {seen}"],
    ]


def _numbers(numbers: Iterable[Numbers]) -> str:
    return table(
        ["number", "meaning", "unit", "range"], [[n.indices, n.meaning, n.unit, n.range] for n in numbers]
    )


def _actions(scenario: Scenario) -> str:
    """All kinds of actions."""
    numbers = action_numbers(scenario)
    text = (
        "## Actions\n\nAn action is a viewpoint within reach: where to go and where to look. "
        f"`continuous`, the default, is a Box of {len(numbers)} numbers.\n\n{_numbers(numbers)}\n\n"
    )
    text += (
        '`action={"kind": "candidates", "candidates": 24}` is a Discrete of 24: the number of one of the '
        "viewpoints that a planner proposes to the robot, its own choice first. The parts `candidates` and "
        "`context` of the observation say what they are worth; infos hold the mask.\n\n"
    )
    if any(math.isinf(kind.robot.reach_m) for kind in scenario.kinds):
        return text + "Discrete actions need a finite reach."
    axes = with_settings(scenario, {"action": {"kind": "discrete", "moves": "axes"}})
    moves, gazes = discrete_actions(axes)
    text += (
        '`action={"kind": "discrete", "moves": "axes"}` is a Discrete of '
        f"{moves} moves × {gazes} gazes = {moves * gazes:,}"
    )
    try:
        most, gazes = discrete_actions(with_settings(scenario, {"action": {"kind": "discrete"}}))
    except SettingError:
        return text + "; with all voxels within reach there would be too many."
    return (
        text + f", with all voxels within reach {most:,} × {gazes} = {most * gazes:,}. Infos hold the mask."
    )


def _observation(scenario: Scenario) -> str:
    """Every number of the default observation, and of the parts on request."""
    everything = dict.fromkeys(("drive", "patch", "overview", "prediction", "overlaps"), True)
    asked = with_settings(scenario, {"observation": everything, "action": {"kind": "candidates"}})
    default = observation_numbers(scenario)
    lines = [
        "## Observation",
        'A Dict of these parts, or with `observation={"flat": True}` one Box of '
        f"{sum(math.prod(part.shape) for part in default.values()):,} numbers, the parts one after the "
        "other. Only what the robot itself has measured or heard enters.",
    ]
    for name, part in observation_numbers(asked).items():
        request = "" if name in default else f', on request: `observation={{"{name}": True}}`'
        if name in ("candidates", "context", "overlaps"):
            on_request = "" if name != "overlaps" else ' and `observation={"overlaps": True}`'
            request = f', with `action={{"kind": "candidates"}}`{on_request}'
        each = "candidate" if name == "candidates" else "teammate"
        rows = f"; each of {part.rows} rows is a {each}" if part.rows > 1 or name == "team" else ""
        lines.append(f"**`{name}`**, shape {part.shape}{rows}{request}\n\n{_numbers(part.numbers)}")
    rules = rules_of(scenario)
    if "panorama" in default:
        lines.append(
            f"The {len(rules.panorama)} directions of `panorama` are yaws from 0 counter-clockwise, in the "
            "frame of the map"
            + (", all level." if scenario.planar else ", each with pitches from -π/4 (up) to π/4 (down).")
        )
    return "\n\n".join(lines)


def _reward(scenario: Scenario) -> str:
    """Return what a step is worth."""
    reward = scenario.reward
    gained = "own bits" if reward.kind == "individual" else "mean over the team of own and received bits"
    cost = f" - {reward.cost_per_s:g} × seconds" if reward.cost_per_s else ""
    text = f"## Reward\n\n`{reward.kind}`: {gained} gained in the step / (H(0) - H_th){cost}."
    if reward.cost_per_s:
        text += (
            f"\nA mission of {_COST_OF_A_MISSION / reward.cost_per_s:.3g} s returns about 0.8, one twice as "
            "long 0.6."
        )
    if scenario.name in COST_PER_S_ALONE:
        alone = COST_PER_S_ALONE[scenario.name]
        text += (
            f" With `robots=1`, as under Gymnasium, a second costs {alone:g}: there a mission of "
            f"{_COST_OF_A_MISSION / alone:.3g} s returns about 0.8."
        )
    return text


def _ending(scenario: Scenario) -> str:
    """When a mission is over."""
    ending, voxels = scenario.ending, scenario.grid.voxels
    begin, end = (voxels * gaussian_entropy_bits(sigma) for sigma in (scenario.sigma_prior, ending.sigma_end))
    rows = [
        [
            "terminates",
            f"when the entropy of {_WHOSE[ending.termination]} falls to H_th (`ending.termination`)",
        ],
        ["H(0)", f"{begin:,.0f} bits: every voxel at σ = {scenario.sigma_prior:g}"],
        [
            "H_th",
            f"{end:,.0f} bits if all voxels can be seen: σ = {ending.sigma_end:g}; "
            "hidden ones stay at the prior",
        ],
        ["truncates", f"after {ending.time_limit_s:,.0f} simulated seconds"],
    ]
    if ending.max_cycles is not None:
        rows.append(["", f"after {ending.max_cycles:,} steps"])
    return "## End\n\n" + table(["", ""], rows)


def _settings(scenario: Scenario) -> str:
    """Every field, its value here, the default of its class where that differs, and what it means."""
    lines = [
        "## Settings",
        "What the scenario sets, beside the default of each class. `parallel_env` and its kin take any of "
        f'them: `eee.parallel_env("{scenario.name}", robots=2, robot={{"reach_m": 1.0}})`.',
    ]
    own = [f for f in dataclasses.fields(scenario) if not dataclasses.is_dataclass(getattr(scenario, f.name))]
    lines.append(_fields(scenario, [f for f in own if f.name != "extra_kinds"]))
    for field in dataclasses.fields(scenario):
        part = getattr(scenario, field.name)
        if dataclasses.is_dataclass(part):
            lines.append(
                f"**`{field.name}`** ({type(part).__name__})\n\n{_fields(part, dataclasses.fields(part))}"
            )
    for number, kind in enumerate(scenario.extra_kinds, start=1):
        lines.append(f"**Kind {number} of robots**: {_changed(kind, scenario)}")
    return "\n\n".join(lines)


def _changed(kind: RobotKind, scenario: Scenario) -> str:
    """In what a further kind of robots differs from the first."""
    words = []
    for name, first in (("robot", scenario.robot), ("sensor", scenario.sensor)):
        part = getattr(kind, name)
        for field in dataclasses.fields(part):
            if getattr(part, field.name) != getattr(first, field.name):
                words.append(f"`{name}.{field.name}` = {_value(getattr(part, field.name))}")
    return ", ".join(words)


def _fields(part: Any, fields: Iterable[dataclasses.Field]) -> str:  # noqa: ANN401 - any settings
    texts = attribute_docs(type(part))
    rows = []
    for field in fields:
        value, default = getattr(part, field.name), _default(field)
        usual = "" if default is dataclasses.MISSING or default == value else _value(default)
        rows.append([f"`{field.name}`", _value(value), usual, texts.get(field.name, "")])
    return table(["setting", "here", "default", "meaning"], rows)


def _default(field: dataclasses.Field) -> object:
    factory: Callable[[], object] | Any = field.default_factory
    return field.default if factory is dataclasses.MISSING else factory()


def _value(value: object) -> str:
    """Return a setting as one types it; angles and other long numbers to six digits."""
    if isinstance(value, float):
        return f"{value:.6g}"
    if isinstance(value, tuple):
        return "(" + ", ".join(_value(v) for v in value) + ")"
    if dataclasses.is_dataclass(value):
        return f"`{_changes(value)}`"
    return f"`{value}`" if isinstance(value, str) else str(value)


def _changes(part: Any) -> str:  # noqa: ANN401 - any settings
    """Return a part of a part as one makes it, with the fields that differ from their defaults."""
    fields = [f for f in dataclasses.fields(part) if getattr(part, f.name) != _default(f)]
    words = ", ".join(f"{f.name}={getattr(part, f.name)!r}" for f in fields)
    return f"{type(part).__name__}({words})"


def _film(name: str, docs: Path) -> str:
    """Return the film of a mission, if there is one."""
    if not (docs / FILMS / f"{name}.webp").exists():
        return ""
    return f"![A mission in {name}](../{FILMS}/{name}.webp)\n"


def _versions(name: str) -> str:
    """Return the history of the id."""
    now = environment_id(name)
    rows = [
        [f"`{now}`", "0.2.0; what alters results since 0.1.0 stands in the [changelog](../changelog.md)"],
        [f"`{now.removesuffix('1')}0`", "0.1.0, the first version; a newer id takes its place"],
    ]
    return "## Versions\n\n" + table(["id", ""], rows)


def setup(app: Sphinx) -> dict[str, bool]:
    """Sphinx calls this: the pages are written before it looks for pages."""
    app.connect("config-inited", lambda sphinx, config: write_cards(Path(sphinx.srcdir)))
    return {"parallel_read_safe": True, "parallel_write_safe": True}

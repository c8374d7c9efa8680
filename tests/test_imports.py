"""Imports run one way: from what people run down to settings and errors, never up, never to the truth."""

from __future__ import annotations

import ast
import subprocess
import sys
from pathlib import Path
from typing import NamedTuple

import pytest

ROOT = Path(__file__).parents[1]
LIBRARY = "entropy_explore_env"
LAYERS = (
    ("training",),
    ("baselines",),
    ("envs",),
    ("reports",),
    ("missions",),
    ("robots",),
    ("belief",),
    ("worlds",),
    ("scenarios", "settings_json"),
    ("config", "randomness"),
    ("settings",),
    ("validation", "command"),
    ("errors", "compilation", "writing", "version"),
)
"""From the top down: a layer may import those below it."""
SIBLINGS = {
    "belief": (
        "raycast",
        "coverage_map",
        "pooling",
        "fields",
        "visibility",
        "bucket_queue",
        "lattice",
        "search_space",
        "planning",
        "straightening",
        "geodesic_cells",
    ),
    "robots": ("range_sensor", "motion", "navigator", "channel"),
    "missions": (
        "rules",
        "state",
        "reward",
        "action",
        "poses",
        "driving",
        "messages",
        "phases",
        "scoring",
        "observation",
        "tick",
        "navigation",
        "missions",
        "snapshot",
        "view",
        "view_observation",
    ),
    "worlds": ("world", "splits", "recipes", "files", "load", "given", "pictures", "__main__"),
    "worlds/recipes": (
        "plan",
        "connectivity",
        "convex",
        "fractal",
        "furniture",
        "empty",
        "furnished",
        "office",
        "corridor",
        "cluttered",
        "hybrid",
        "cave",
        "terrain",
        "occlusions",
        "lab",
        "bhattacharya_office",
        "bhattacharya_cluttered",
        "catalogue",
    ),
    "worlds/files": (
        "voxels",
        "elevation",
        "images",
        "octomap_tree",
        "map_server",
        "geotiff",
        "jacksboro",
        "point_clouds",
        "meshes",
        "archives",
        "worker",
        "process",
        "resampling",
    ),
    "envs": (
        "checks",
        "infos",
        "parallel_env",
        "single_env",
        "vector_env",
        "robot_vec_env",
        "rllib_env",
        "episodes",
        "conformance",
    ),
    "reports": (
        "metrics",
        "recording",
        "mission_record",
        "glyphs",
        "projection",
        "rendering",
        "animation",
        "painting",
        "rerun_view",
    ),
}
"""Inside a folder a file, or a folder, may import those that stand before it."""
STRATEGIES_SEE = (
    "envs",
    "missions.view",
    "missions.view_observation",
    "missions.action",
    "missions.observation",
    "belief",
    "robots.motion",
    "config",
    "settings",
    "scenarios",
    "settings_json",
    "reports",
    "errors",
    "command",
    "validation",
    "compilation",
    "writing",
    "version",
)
"""What `baselines` and `training` may import of the library; robots.motion for why a drive ended."""
OWN_SIMULATIONS = (ROOT / "baselines/papers/bhattacharya/sweep.py",)
"""A reproduction in a simulation of its own holds that simulation's truth, and may make worlds for it."""
TRUTH = ("Missions", "World", "load_octomap", "load_world", "save_world")
"""Public names that show the truth: not for strategies."""
HEAVY = ("baselines", "training", "benchmarks", "tests", "torch", "matplotlib", "stable_baselines3", "ray")


class Import(NamedTuple):
    """One imported module or name, and where."""

    file: Path
    line: int
    target: str
    at_top: bool

    def __str__(self) -> str:
        return f"{self.file.relative_to(ROOT)}:{self.line} imports {self.target}"


def imports_in(source: str, file: Path) -> list[Import]:
    """All imports in a file, also those inside functions; `a.b.name` for `from a.b import name`."""
    tree, found = ast.parse(source), []
    inside = {
        id(node)
        for function in ast.walk(tree)
        if isinstance(function, ast.FunctionDef | ast.AsyncFunctionDef | ast.Lambda)
        for node in ast.walk(function)
    }
    for node in ast.walk(tree):
        at_top = id(node) not in inside
        if isinstance(node, ast.Import):
            found += [Import(file, node.lineno, alias.name, at_top) for alias in node.names]
        elif isinstance(node, ast.ImportFrom):
            assert node.level == 0, f"{file}:{node.lineno}: a relative import"
            found += [Import(file, node.lineno, f"{node.module}.{a.name}", at_top) for a in node.names]
    return found


def files_of(folder: str) -> list[Path]:
    return sorted((ROOT / folder).rglob("*.py"))


def imports_of(folder: str) -> list[Import]:
    return [each for file in files_of(folder) for each in imports_in(file.read_text(), file)]


def home_of_public_names() -> dict[str, str]:
    """Public name of the library → the module that it comes from."""
    init = ROOT / LIBRARY / "__init__.py"
    return {each.target.split(".")[-1]: each.target for each in imports_in(init.read_text(), init)}


def module_of(target: str) -> str:
    """`belief.raycast` for entropy_explore_env.belief.raycast.cast_ray, "" for what is not a module."""
    parts = target.split(".")[1:]
    while parts:
        path = ROOT.joinpath(LIBRARY, *parts)
        if path.is_dir() or path.with_suffix(".py").exists():
            return ".".join(parts)
        parts.pop()
    return ""


def layer_of(name: str) -> int:
    return next(number for number, layer in enumerate(LAYERS) if name in layer)


def top(target: str) -> str:
    return target.split(".")[0]


LIBRARY_IMPORTS = imports_of(LIBRARY)


def test_every_folder_and_file_of_the_library_has_its_place():
    for path in (ROOT / LIBRARY).iterdir():
        if (path.suffix == ".py" and path.stem != "__init__") or (path / "__init__.py").exists():
            layer_of(path.stem)
    for folder, order in SIBLINGS.items():
        here = ROOT / LIBRARY / folder
        found = {path.stem for path in here.glob("*.py")} - {"__init__"}
        found |= {path.parent.name for path in here.glob("*/__init__.py")}
        assert found <= set(order), f"{folder} has files without a place: {found - set(order)}"
    folders = {path.parent.relative_to(ROOT / LIBRARY) for path in (ROOT / LIBRARY).glob("*/*/__init__.py")}
    assert {str(path) for path in folders} <= set(SIBLINGS)


def complaint(each: Import) -> str | None:
    """What is wrong with an import inside the library."""
    inside, module = each.file.relative_to(ROOT / LIBRARY), module_of(each.target)
    if not module:
        return f"{each}, which is no module: names are imported from where they are"
    if inside.name == "__init__.py":
        return None if len(inside.parts) == 1 else f"{each}: the __init__.py of a folder holds one sentence"
    importer, imported = inside.with_suffix("").parts[0], top(module)
    if importer != imported:
        return None if layer_of(importer) < layer_of(imported) else f"{each}, which lies above"
    return (
        None
        if stands_above(module.split("."), list(inside.with_suffix("").parts))
        else (f"{each}, which stands below it")
    )


def stands_above(imported: list[str], importer: list[str]) -> bool:
    """Whether siblings stand in their order, in the first folder in which the two paths part."""
    for depth in range(1, min(len(imported), len(importer))):
        order = SIBLINGS.get("/".join(importer[:depth]))
        if imported[depth] != importer[depth]:
            return order is None or order.index(imported[depth]) < order.index(importer[depth])
    return imported[0] not in SIBLINGS


def test_the_library_imports_only_what_lies_below():
    inside = [each for each in LIBRARY_IMPORTS if top(each.target) == LIBRARY]
    assert len(inside) > 50
    assert [wrong for each in inside if (wrong := complaint(each))] == []


@pytest.mark.parametrize(
    ("file", "target", "wrong"),
    [
        ("belief/raycast.py", "belief.coverage_map.fuse_ray", "which stands below it"),
        ("belief/raycast.py", "robots.motion.MoveEnd", "which lies above"),
        ("worlds/world.py", "belief.raycast.cast_ray", "which lies above"),
        ("worlds/world.py", "worlds.recipes.plan.Plan", "which stands below it"),
        ("worlds/recipes/plan.py", "worlds.load.make_world", "which stands below it"),
        ("worlds/recipes/plan.py", "worlds.recipes.office.office", "which stands below it"),
        ("worlds/recipes/plan.py", "worlds.recipes.plan.Plan", "which stands below it"),
        ("worlds/recipes/__init__.py", "worlds.recipes.plan", "one sentence"),
        ("worlds/recipes/office.py", "worlds.recipes.plan.Plan", None),
        ("worlds/recipes/office.py", "worlds.world.World", None),
        ("worlds/load.py", "worlds.recipes.catalogue.RECIPES", None),
        ("worlds/files/voxels.py", "worlds.files.worker.serve", "which stands below it"),
        ("worlds/files/voxels.py", "worlds.load.load_world", "which stands below it"),
        ("worlds/load.py", "worlds.files.voxels.Voxels", None),
        ("reports/metrics.py", "envs.parallel_env.env", "which lies above"),
        ("scenario.py", "scenarios.ROOM", "which lies above"),
        ("belief/__init__.py", "belief.raycast", "one sentence"),
        ("envs/infos.py", "nowhere.at_all", "which is no module"),
        ("missions/view.py", "missions.missions.Missions", None),
        ("envs/infos.py", "reports.metrics.mission_row", None),
    ],
)
def test_these_tests_complain(file, target, wrong):
    each = Import(ROOT / LIBRARY / file, 1, f"{LIBRARY}.{target}", True)
    said = complaint(each)
    assert said is None if wrong is None else wrong in str(said)


def test_only_the_adapters_import_pettingzoo():
    for each in LIBRARY_IMPORTS:
        if top(each.target) == "pettingzoo":
            inside = each.file.relative_to(ROOT / LIBRARY)
            assert inside.parts[0] in ("envs", "__init__.py"), str(each)


ADAPTERS = (ROOT / LIBRARY / "envs/robot_vec_env.py", ROOT / LIBRARY / "envs/rllib_env.py")
"""Of trainers: they import their trainer at the top, and nothing of the library imports them."""


def test_the_library_imports_nothing_heavy_and_none_of_what_stands_on_it():
    for each in LIBRARY_IMPORTS:
        assert module_of(each.target) not in [f"envs.{adapter.stem}" for adapter in ADAPTERS], str(each)
        if each.file in ADAPTERS and top(each.target) in HEAVY[4:]:
            continue
        assert top(each.target) not in HEAVY or (top(each.target) in HEAVY[4:] and not each.at_top), str(each)


def test_importing_the_library_loads_nothing_heavy():
    """Nor what only some people need."""
    script = "import sys, entropy_explore_env; print(*sys.modules)"
    done = subprocess.run(
        [sys.executable, "-c", script], cwd=ROOT, capture_output=True, text=True, check=True
    )
    loaded = {name.split(".")[0] for name in done.stdout.split()}
    unwanted = {*HEAVY, "pygame", "PIL", "av", "rerun", "octomap", "tyro", "rich", "tensorboard", "pandas"}
    assert not loaded & unwanted
    assert "pettingzoo" in loaded


@pytest.mark.parametrize("folder", ["baselines", "training"])
def test_strategies_never_import_the_truth(folder):
    homes = home_of_public_names()
    for each in imports_of(folder):
        if top(each.target) == LIBRARY:
            name = each.target.split(".")[-1]
            module = module_of(each.target) or module_of(homes.get(name, ""))
            if each.target == LIBRARY:
                continue  # its public names: see below
            assert name not in TRUTH, str(each)
            sees = (*STRATEGIES_SEE, "worlds.load") if each.file in OWN_SIMULATIONS else STRATEGIES_SEE
            assert any(module == seen or module.startswith(seen + ".") for seen in sees), str(each)


@pytest.mark.parametrize("folder", ["baselines", "training"])
def test_strategies_never_reach_the_truth_through_the_public_names(folder):
    for file in files_of(folder):
        for node in ast.walk(ast.parse(file.read_text())):
            if (
                isinstance(node, ast.Attribute)
                and isinstance(node.value, ast.Name)
                and node.value.id == LIBRARY
            ):
                assert node.attr not in (*TRUTH, "missions", "worlds"), f"{file}:{node.lineno}"


def test_baselines_never_import_training_and_neither_imports_tests():
    for each in imports_of("baselines"):
        assert top(each.target) not in ("training", "tests", "benchmarks"), str(each)
    for each in imports_of("training"):
        assert top(each.target) not in ("tests", "benchmarks"), str(each)


def test_worlds_are_read_in_a_process_that_imports_little_of_the_package():
    """What it does import is there without the package's own __init__, and is fast to import."""
    folder, seen = ROOT / LIBRARY / "worlds" / "files", {"settings", "errors", "validation"}
    for file in set(folder.glob("*.py")) - {folder / "process.py", folder / "resampling.py"}:
        for each in imports_in(file.read_text(), file):
            if top(each.target) == LIBRARY:
                module = module_of(each.target)
                assert module in seen or module.startswith("worlds.files."), str(each)
                assert module.split(".")[-1] not in ("process", "resampling"), str(each)


def test_these_tests_see_all_kinds_of_imports():
    source = """
import a.b
from c import d as e
def f():
    import g
    class h:
        from i.j import k
if True:
    import l
"""
    found = {each.target: each.at_top for each in imports_in(source, Path("x.py"))}
    assert found == {"a.b": True, "c.d": True, "g": False, "i.j.k": False, "l": True}
    assert module_of(f"{LIBRARY}.belief.raycast.cast_ray") == "belief.raycast"
    assert module_of(f"{LIBRARY}.belief.raycast") == "belief.raycast"
    assert module_of(LIBRARY) == ""
    assert home_of_public_names()["Missions"] == f"{LIBRARY}.missions.missions.Missions"
    assert layer_of("missions") < layer_of("robots") < layer_of("errors")

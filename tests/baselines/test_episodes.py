"""Missions as Parquet: what is in the rows, the same bytes whoever wrote them, and learning from them."""

from __future__ import annotations

import json
import runpy
import shutil
from pathlib import Path

import numpy as np
import pytest

from baselines.cli.arguments import run_command
from baselines.experiments.mission import mission_record, scripted_env
from baselines.strategies import make_strategy
from baselines.strategies.protocol import choose_all
from entropy_explore_env.command import BAD_INPUT
from entropy_explore_env.settings.scenarios import BOX

pq = pytest.importorskip("pyarrow.parquet", reason="pip install 'entropy_explore_env[episodes]'")

from baselines.episodes import main  # noqa: E402
from baselines.offline import shards  # noqa: E402
from baselines.offline.recorded_env import observed_scenario, recorded_env  # noqa: E402
from baselines.offline.shards import METADATA, columns  # noqa: E402

ROOT = Path(__file__).parents[2]
WORDS = (
    "box-7x11x5 --strategy gradient --robots 3 --time-limit-s 40 --missions 5 --missions-per-file 2".split()
)


@pytest.fixture(scope="module")
def written(tmp_path_factory):
    """The files of five missions, of which two processes wrote three."""
    folder = tmp_path_factory.mktemp("episodes")
    assert run_command(main, [*WORDS, "--jobs", "2", "--out", str(folder), "--json"]) == 0
    return folder


def content(folder: Path) -> dict[str, bytes]:
    return {str(path.relative_to(folder)): path.read_bytes() for path in folder.rglob("*") if path.is_file()}


def test_rows_say_what_each_robot_saw_chose_and_earned(written, capsys):
    """Beside a mission that is run here, step by step."""
    rows = pq.read_table(sorted(written.glob("*.parquet"))[1]).to_pylist()
    assert {row["mission"] for row in rows} == {2, 3}
    rows = [row for row in rows if row["mission"] == 3]
    scenario = observed_scenario(recorded_scenario(written), recorded_scenario(written).observation)
    env = recorded_env(scenario, shards.Surroundings())
    strategy, place, decided = make_strategy("gradient"), 0, 0
    observations, _ = env.reset(seed=3)
    strategy.reset(env.scenario, env.strategy_generator())
    agents, actions = list(env.agents), {}
    for step in range(10_000):
        views = {agent: env.view(agent) for agent in env.deciding_agents()}
        chosen = choose_all(strategy, list(views.values()))
        for (agent, view), viewpoint in zip(views.items(), chosen, strict=True):
            actions[agent] = view.action_for(viewpoint)
        began_s = float(env.missions.state.missions[0]["time_s"])
        now, rewards, terminations, truncations, infos = env.step(actions)
        for robot, agent in enumerate(agents):
            row, place = rows[place], place + 1
            assert (row["step"], row["robot"], row["time_s"]) == (step, robot, began_s)
            assert row["decided"] == (agent in views)
            decided += row["decided"]
            if row["decided"]:
                np.testing.assert_array_equal(np.float32(row["observation"]), observations[agent])
                np.testing.assert_array_equal(np.float32(row["action"]), actions[agent])
            else:
                assert row["observation"] is None and row["action"] is None
            assert row["reward"] == rewards[agent]
            assert row["seconds"] == infos[agent]["time_s"] - began_s
            assert (row["terminated"], row["truncated"]) == (terminations[agent], truncations[agent])
        observations = now
        if not env.agents:
            break
    assert 0 < decided < place, "no robot was ever busy, or none decided"
    for robot, row in enumerate(rows[place:]):
        assert (row["step"], row["robot"], row["decided"], row["reward"]) == (step + 1, robot, False, 0.0)
        assert row["action"] is None and (row["terminated"] or row["truncated"])
        np.testing.assert_array_equal(np.float32(row["observation"]), observations[agents[robot]])
    assert len(rows) == place + 3


def recorded_scenario(folder: Path):
    from entropy_explore_env.settings.json import scenario_of

    metadata = json.loads(pq.read_schema(next(folder.glob("*.parquet"))).metadata[METADATA])
    assert metadata["strategy"] == "gradient" and metadata["parts"]["panorama"][0] == 0
    return scenario_of(metadata["scenario"])


def test_the_missions_are_those_of_every_other_command(written):
    rows = pq.read_table(written, columns=["mission", "step", "time_s"]).to_pylist()
    env = scripted_env(BOX, robots=3, time_limit_s=40.0)
    for seed in range(5):
        ended_s = max(row["time_s"] for row in rows if row["mission"] == seed)
        assert ended_s == pytest.approx(mission_record(env, "gradient", seed)["t_mission_s"])


def test_the_bytes_are_the_same_and_what_is_missing_is_written_again(written, tmp_path):
    command = [*WORDS, "--jobs", "1", "--out", str(tmp_path), "--json"]
    assert run_command(main, command) == 0
    assert content(tmp_path) == content(written)
    files = sorted(tmp_path.glob("*.parquet"))
    assert [path.name for path in files] == [f"episodes-{first:09}.parquet" for first in (0, 2, 4)]
    files[0].unlink()
    files[1].write_bytes(b"half")
    kept = files[2].stat().st_mtime_ns
    assert run_command(main, command) == 0
    assert content(tmp_path) == content(written) and files[2].stat().st_mtime_ns == kept


def test_a_folder_with_other_missions_or_the_same_in_other_files_is_refused(written, tmp_path, capsys):
    shutil.copytree(written, tmp_path, dirs_exist_ok=True)
    before = content(tmp_path)
    for change in (["--missions-per-file", "3"], ["--missions", "2", "--strategy", "random"]):
        assert run_command(main, [*WORDS, *change, "--out", str(tmp_path)]) == BAD_INPUT
        said = capsys.readouterr().err
        assert said.startswith("error: out = ") and "a folder without episodes-000000002.parquet" in said
    assert content(tmp_path) == before
    more = [*WORDS, "--first-seed", "5", "--missions", "1", "--out", str(tmp_path)]
    assert run_command(main, more) == 0
    assert content(tmp_path).keys() - before.keys() == {"episodes-000000005.parquet"}


def test_memory_holds_one_mission(written):
    groups = [pq.ParquetFile(path).num_row_groups for path in sorted(written.glob("*.parquet"))]
    assert groups == [2, 2, 1]


def test_the_page_names_every_column(written):
    page = (ROOT / "docs/episodes.md").read_text("utf-8")
    for name, kind in columns(recorded_scenario(written)):
        said = str(kind).replace("element", "item")
        assert f"| `{name}` | {said} |" in page, f"{name} {said}"


def test_the_example_of_behaviour_cloning_learns(written, capsys, monkeypatch):
    monkeypatch.setattr("sys.argv", ["behaviour_cloning.py", str(written)])
    left = runpy.run_path(str(ROOT / "docs/examples/behaviour_cloning.py"))
    variance, loss = map(float, capsys.readouterr().out.split())
    assert loss < 0.6 * variance and len(left["actions"]) > 100

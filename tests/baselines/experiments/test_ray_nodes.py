"""A Ray cluster of two machines, of which one is lost in the middle of a sweep: nothing is lost with it."""
# pyright: reportMissingImports=false

from __future__ import annotations

import os
import sys
import threading
import time
from pathlib import Path

import pytest

from baselines.experiments.ray_cluster import RayCluster
from baselines.experiments.trials import Cell, How, run_cells
from entropy_explore_env.settings.changes import with_settings
from entropy_explore_env.settings.scenarios import BOX

ray = pytest.importorskip("ray", reason="ray is not installed: pip install 'entropy_explore_env[cluster]'")

pytestmark = [
    pytest.mark.long,  # two machines are begun
    pytest.mark.filterwarnings("ignore::DeprecationWarning"),  # Ray's own
    pytest.mark.filterwarnings("ignore::FutureWarning"),
    pytest.mark.filterwarnings("ignore::ResourceWarning"),
]
SHORT = with_settings(BOX, {"time_limit_s": 60.0})
CELLS = (Cell("walk", SHORT, "random", 12), Cell("steep", SHORT, "gradient", 8))


@pytest.fixture
def machines(monkeypatch):
    """A cluster of two machines of one processor each, this process in it, and the second of them."""
    from ray.cluster_utils import Cluster

    monkeypatch.setenv("RAY_USAGE_STATS_ENABLED", "0")
    monkeypatch.setenv("PYTHONPATH", os.pathsep.join([str(Path(__file__).parent), *sys.path]))
    own = {"num_cpus": 1, "object_store_memory": 10**8, "include_dashboard": False}
    cluster = Cluster(initialize_head=True, head_node_args=own)
    second = cluster.add_node(num_cpus=1, object_store_memory=10**8, resources={"second": 1})
    ray.init(address=cluster.address, logging_level="ERROR", log_to_driver=False)
    cluster.wait_for_nodes()
    yield cluster, second
    ray.shutdown()
    cluster.shutdown()


def alive_machines() -> int:
    """How many machines there are, once Ray has noticed that one is gone."""
    until_s = time.monotonic() + 60.0
    while (alive := sum(node["Alive"] for node in ray.nodes())) > 1 and time.monotonic() < until_s:
        time.sleep(0.1)
    return alive


def test_a_sweep_that_loses_a_machine_leaves_the_same_bytes(machines, tmp_path):
    cluster, second = machines
    table = tmp_path / "there.jsonl"
    whole = run_cells(CELLS, tmp_path / "here.jsonl", How(1))

    def lose() -> None:
        while not table.exists() or table.read_bytes().count(b"\n") < 4:
            time.sleep(0.01)
        cluster.remove_node(second, allow_graceful=False)

    loser = threading.Thread(target=lose)
    loser.start()
    assert run_cells(CELLS, table, How(RayCluster(cluster.address))) == whole
    loser.join()
    assert table.read_bytes() == (tmp_path / "here.jsonl").read_bytes()
    assert alive_machines() == 1

"""Branches that tests take: a row a file, and folders that there are not are refused."""

from __future__ import annotations

import json

import pytest

from benchmarks.reliability import coverage
from entropy_explore_env.errors import SettingError


def summary(branches, covered):
    return {"summary": {"num_branches": branches, "covered_branches": covered}}


def test_rows_of_other_folders_stay_and_files_without_branches_are_left_out(tmp_path, monkeypatch, capsys):
    report = {
        "files": {
            "entropy_explore_env/belief/b.py": summary(4, 3),
            "entropy_explore_env/belief/a.py": summary(0, 0),
        }
    }
    monkeypatch.setattr(coverage, "measured", lambda folders, test_s: coverage.rows_of(report))
    kept = tmp_path / "coverage.jsonl"
    rows = [
        {"path": f"entropy_explore_env/{name}/x.py", "branches": 2, "covered": 1}
        for name in ("belief", "robots")
    ]
    kept.write_text("".join(json.dumps(row) + "\n" for row in rows))
    assert coverage.main(["--folders", "belief", "--out", str(kept)]) == 0
    found = [json.loads(line) for line in kept.read_text().splitlines()]
    assert found == [rows[1], {"path": "entropy_explore_env/belief/b.py", "branches": 4, "covered": 3}]
    assert "belief/b.py: 3 of 4" in capsys.readouterr().out
    with pytest.raises(SettingError, match="one of belief, robots"):
        coverage.main(["--folders", "worlds"])

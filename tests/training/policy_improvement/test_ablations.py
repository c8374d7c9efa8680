"""The stages without one of them: what they share, what is compared, and the table."""

import json

import pytest

from entropy_explore_env.command import BAD_INPUT, run_command
from entropy_explore_env.errors import SettingError
from training.policy_improvement import ablations, ablations_table

SMALL = (
    "--task box-7x11x5:1 --seeds 1 --threads 1 --compared 2 --shards 1 --missions 1 --every 10 --rounds 1 "
    "--pairs 2 --ppo-steps 300"
)


def test_variants_share_the_labels_of_the_whole_and_go_on_where_they_were_stopped(tmp_path, capsys):
    words = [*SMALL.split(), "--runs", f"{tmp_path}/runs", "--out", f"{tmp_path}/out"]
    assert run_command(ablations.main, [*words, "--variants", "no-ppo,mlp"]) == 0
    labels = [tmp_path / "runs" / f"{name}-0" / "labels" for name in ("whole", "no-ppo", "mlp")]
    first, *others = [sorted((each.name, each.read_bytes()) for each in one.iterdir()) for one in labels]
    assert first and all(other == first for other in others)
    assert not (tmp_path / "runs" / "no-ppo-0" / "ppo").exists()
    written = {each.name: each.read_bytes() for each in (tmp_path / "out").iterdir()}
    assert sorted(written) == ["mlp-0.json", "no-ppo-0.json", "whole-0.json"]
    heads = [
        json.loads(next((tmp_path / "runs" / f"{name}-0" / "ppo").glob("*/policy.json")).read_text())
        for name in ("whole", "mlp")
    ]
    assert [head["attention_layers"] for head in heads] == [2, 0]
    capsys.readouterr()
    (tmp_path / "out" / "mlp-0.json").unlink()
    assert run_command(ablations.main, [*words, "--variants", "no-ppo,mlp"]) == 0
    assert {each.name: each.read_bytes() for each in (tmp_path / "out").iterdir()} == written
    for option, value in (("--ppo-steps", "301"), ("--task", "box-7x11x5:2")):
        other = [*words, "--variants", "no-ppo,mlp"]
        other[other.index(option) + 1] = value
        capsys.readouterr()
        assert run_command(ablations.main, other) == BAD_INPUT
        assert "mlp-0.json" in (said := capsys.readouterr().err) or "whole-0.json" in said
    assert {each.name: each.read_bytes() for each in (tmp_path / "out").iterdir()} == written
    table = ablations_table.shown(tmp_path / "out")
    assert "| labels, regression, PPO | box-7x11x5, 1 robot | " in table and "| 2 of 2 |" in table
    assert "states of 1 missions labelled" in table


def test_the_table_holds_a_row_for_each_variant_and_the_mean_over_its_seeds(tmp_path):
    assert ablations_table.shown(tmp_path) == "" == ablations_table.shown(tmp_path / "none")
    budget = {"shards": 2, "missions": 3, "every": 30, "rounds": 2, "pairs": 24, "ppo_steps": 8192}
    for seed, ratio in enumerate((0.9, 1.0, 1.1)):
        compared = {"mean_ratio": ratio, "finished": 12 - seed, "missions": 12}
        found = {"variant": "bits", "seed": seed, "task": "office:1", "budget": budget, "compared": compared}
        (tmp_path / f"bits-{seed}.json").write_text(json.dumps(found))
    _, _, row, _, said = ablations_table.shown(tmp_path).strip().splitlines()
    assert row.endswith("| office, 1 robot | 0.900, 1.000, 1.100 | 0.997 | 33 of 36 |")
    assert said.startswith("Of each seed: states of 6 missions labelled, one decision in 30; 8,192 steps")
    (tmp_path / "other.json").write_text("[1]")
    with pytest.raises(SettingError, match=r"other\.json"):
        ablations_table.shown(tmp_path)


@pytest.mark.parametrize("words", ["--variants none", "--seeds 0", "--task nowhere:1", "--ppo-steps 0"])
def test_bad_options_are_refused(words, capsys, tmp_path):
    assert run_command(ablations.main, [*words.split(), "--out", str(tmp_path / "none")]) == BAD_INPUT
    assert len(capsys.readouterr().err.splitlines()) == 1
    assert not (tmp_path / "none").exists()

"""`training.evaluate`: the table of a policy beside strategies."""

import json

from training.evaluate import main


def test_missions_that_were_cut_off_count_with_the_time_limit(tmp_path, capsys):
    words = ["--pretrained", "room", "--seeds", "2", "--jobs", "1", "--against", "random", "--json"]
    words += ["--ending.max-cycles", "5", "--ending.time-limit-s", "300", "--runs", str(tmp_path)]
    assert main(words) == 0
    rows = json.loads(capsys.readouterr().out)["rows"]
    assert [(row["median_s"], row["finished"]) for row in rows] == [(300.0, 0), (300.0, 0)]
    assert rows[1]["faster"] == 0

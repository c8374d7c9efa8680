"""The command of the proofs, a bounded run of each, and the page: what is kept, failed and missing."""

from __future__ import annotations

import hashlib
import json
import random
import subprocess

import pytest

from benchmarks.reliability import __main__ as command
from benchmarks.reliability import determinism, fault_table, file_fuzz, kills, memory, page, soak, sources
from benchmarks.reliability.__main__ import PROOFS, Proof, carry_on, main
from benchmarks.reliability.page import Kept, read_rows
from entropy_explore_env.errors import SettingError
from tests.systems import needs_posix

EMPTY = {name: Kept((), 0, 10) for name in PROOFS}
NO_MORE = ({}, (), {"numpy": "2"})


def kept(name, rows):
    return page.page({**EMPTY, name: Kept(rows, len(rows), 10)}, *NO_MORE)


def fails_at_three(number):
    if number == 3:
        raise ValueError("three")
    return {"square": number * number}


def test_a_run_goes_on_where_it_was(tmp_path, capsys):
    file, proof = tmp_path / "kept" / "squares.jsonl", Proof(fails_at_three, 2, 5, 60.0)
    carry_on(proof, file, 2)
    assert [row["square"] for row in read_rows(file)] == [0, 1]
    carry_on(proof, file, 5)
    rows = sorted(read_rows(file), key=lambda row: row["number"])
    assert [row.get("square") for row in rows] == [0, 1, 4, None, 16]
    assert (rows[3]["number"], rows[3]["failure"]) == (3, "ValueError: three")
    before = file.read_bytes()
    carry_on(proof, file, 5)
    assert file.read_bytes() == before
    assert "squares: 5 of 5" in capsys.readouterr().err


def test_the_page_says_what_was_played_and_what_failed(tmp_path, monkeypatch, capsys):
    monkeypatch.setattr(command, "carry_on", lambda *_: None)
    rows = [
        {"number": 0, "refused": ["Robot.reach_m"], "seconds": 1.25, "episodes": 3},
        {"number": 1, "refused": [], "seconds": 0.5, "episodes": 1},
        {"number": 2, "failure": "ran past 600 s on the clock"},
    ]
    (tmp_path / "settings.jsonl").write_text("".join(json.dumps(row) + "\n" for row in rows))
    where = [
        "--results",
        str(tmp_path),
        "--mutants",
        str(tmp_path / "none"),
        "--page",
        str(tmp_path / "page.md"),
    ]
    assert main(where) == 1
    text = (tmp_path / "page.md").read_text("utf-8")
    assert "3 of 10,000 scenarios; 1 cases failed." in text and "- case 2: ran past 600 s" in text
    assert "slowest took 1.2 s; 4 episodes" in text and "Robot.reach_m (1)" in text
    (tmp_path / "settings.jsonl").unlink()
    assert main(where) == 0
    capsys.readouterr()
    with pytest.raises(SettingError, match="one of settings, states"):
        main(["--proofs", "luck"])


def test_digests_that_differ_and_memory_that_grows_are_shown():
    told = {"variant": 0, "first": 3, "digests": ["a", "b"], "number": 0}
    same = [told, {**told, "variant": 1, "number": 1}, {**told, "first": 5, "number": 3}]
    other = [*same, {**told, "variant": 2, "digests": ["a", "c"], "number": 2}]
    assert sum(map(determinism.plays_of, [*other, {"failure": "x"}])) == 8
    for rows, said in (
        (same, "4 drawn scenarios, 2 of them in several and up to 2 processes"),
        (same, "no difference"),
        (other, "scenarios [4]"),
    ):
        assert said in kept("determinism", rows)
    runs = [{"trainer": "a", "robot_steps": 1_200_000 + n, "kills": 3, "number": n} for n in range(2)]
    assert "| `a` | 2,400,001 | 6 |" in kept("training", runs)
    case = {
        "scenario": "room",
        "channel": 1,
        "robot_steps": 600_000,
        "missions": 2,
        "cpu_s": 6.0,
        "process": 1,
    }
    rows = [{**case, "number": n, "settled_mib": 100.0 + n, "resident_mib": 101.0 + n} for n in range(5)]
    text = kept("soak", rows[::-1])
    assert "| room | 3,000,000 | 10 | 100,000 |" in text and "| all | 3,000,000 | 10 | 100,000 |" in text
    assert (
        "So far 1 of these pairs were played, each for 3,000,000 or more." in text
        and "by 1.0% at most" in text
    )
    assert "3,000,000 robot-steps held 102 MiB after the first 10⁶, then 105 MiB at most" in text


def test_memory_is_compared_from_round_to_round():
    first, pairs = len(soak.FLOOR_CASES), len(soak.ROUND)
    case = {"scenario": "room", "channel": 1, "robot_steps": 200_000, "missions": 2, "cpu_s": 6.0}
    held = [200.0] * pairs + [300.0] * (pairs - 1) + [330.0] + [303.0] * (pairs - 1) + [333.3] + [900.0]
    numbers = [first - 1, *range(first, first + len(held))]
    rows = [
        {**case, "process": 7, "number": number, "settled_mib": mib, "resident_mib": mib}
        for number, mib in zip(numbers, [10.0, *held], strict=True)
    ]
    text = kept("soak", rows)
    assert "held at most 200, 330, 333 MiB in its rounds of all 30 pairs, and 200, 301, 304 MiB" in text
    assert "from the second to the last the average grew by 1.0%" in text and "18,400,000 robot-steps" in text


def test_memory_is_compared_million_by_million():
    """200 MiB after the first; then 199, 201, 203: 1 more on average, on a line that rises by 4."""
    rows = [
        {
            "number": number,
            "robot_steps": 1_000_320,
            "process": process,
            "resident_mib": mib,
            "most_mib": mib + 50.0,
        }
        for number, (process, mib) in enumerate([(7, 200.0), (7, 199.0), (7, 201.0), (7, 203.0), (8, 100.0)])
    ]
    text = kept("memory", [*rows[::-1], {"number": 5, "failure": "x"}])
    assert "A process of 4,001,280 robot-steps held 200.0 MiB after the first million" in text
    assert "and then 199.0 to 203.0 MiB, 201.0 MiB on average: 0.50% more than after the first" in text
    assert "it held 250.0 MiB at most in the first million, and 253.0 MiB in later ones" in text
    assert "fits best rises by 2.00%; after the last it held 1.50% more" in text
    assert text.count("A process of") == 1  # one of a single million has nothing to be compared with
    assert "- Memory: grew by 2.0%, less than 1% asked for" in text
    falls = kept("memory", [{**row, "resident_mib": 300.0 - row["resident_mib"]} for row in rows[:2]])
    assert "fits best rises by 0.00%; after the last it held 1.00% more" in falls
    assert "Memory: grew by 1.0%" in falls and "Memory: grew" not in kept("memory", rows[:2])
    assert "0.50% less than after the first" in kept("memory", rows[:2])
    assert soak.robot_steps(rows[0]) == 1_000_320 and soak.robot_steps({"failure": "x"}) == 0


def test_a_piece_of_memory(monkeypatch):
    monkeypatch.setattr(memory, "CASE_STEPS", 5_000)
    monkeypatch.setattr(memory, "ROUND", soak.ROUND[:1])
    row = memory.play_number(2)
    assert 5_000 <= row["robot_steps"] < 5_000 + 64 * 2
    assert 10.0 < row["resident_mib"] and 10.0 < row["most_mib"]


def test_plays_by_other_sources_are_not_compared():
    told = {"variant": 0, "first": 3, "digests": ["a"], "number": 0, "library": "x"}
    text = kept("determinism", [told, {**told, "digests": ["b"], "library": "y"}])
    assert "2 drawn scenarios" in text and "no difference" in text


def test_the_page_says_what_is_asked_for_and_not_reached(monkeypatch):
    faults = [
        {"digest": "a", "path": "x/y.py", "line": 3, "what": "1  ->  2", "found": "test_it"},
        {"digest": "b", "path": "x/y.py", "line": 4, "what": "2  ->  3", "found": ""},
        {"digest": "c", "path": "x/y.py", "line": 5, "what": "3  ->  4", "found": "", "tests": 0},
        {"digest": "d", "path": "x/y.py", "line": 6, "what": "4  ->  5", "found": "", "late": True},
        {"digest": "e", "path": "x/y.py", "line": 7, "what": "5  ->  6", "found": "", "function": "f"},
    ]
    monkeypatch.setitem(fault_table._REASONS, ("x/y.py", "f", "5  ->  6"), "Both are odd.")
    branches = [
        {"path": "x/y.py", "branches": 8, "covered": 6, "files": 3, "of_files": 4, "test_s": 3.0},
        {"path": "x/z.py", "branches": 2, "covered": 2, "files": 3, "of_files": 4, "test_s": 3.0},
    ]
    text = page.page(EMPTY, {"x": faults}, branches, {"numpy": "2"})
    assert "- Kills: 0 of 10 kills" in text and "- Faults in formulas: 5 of 300 drawn" in text
    assert "- Faults in formulas: 25.0% found, 90% asked for" in text and "80.0% covered" in text
    assert "; 2 were not found. Of those that change something 25.0% were found." in text
    assert "- late: x/y.py:6: `4  ->  5`" in text
    assert "- without effect: x/y.py:7: `5  ->  6`: Both are odd." in text
    assert "| x/y.py | 5 | 1 | 1 | 1 |" in text and "- not found: x/y.py:4: `2  ->  3`" in text
    assert "- no test takes its line: x/y.py:5: `3  ->  4`" in text
    assert "; 3 of 4 files of tests were run" in text and "ended after 3 s of the processor" in text
    assert "| x | 10 | 80.0% |" in text and "with numpy 2." in text


def test_rows_of_other_sources_are_told_apart():
    rows = [{"number": n, "refused": [], "seconds": 0.5, "episodes": 1, "library": "ab"} for n in range(2)]
    assert "whose sources have the digest ab." in kept("settings", rows)
    assert "2 states of the library's sources" in kept("settings", [*rows, {**rows[0], "library": "cd"}])


def test_the_page_names_the_commits_whose_sources_played():
    rows = [{"number": n, "refused": "x", "library": "ab" if n else "cd"} for n in range(3)]
    told = {**EMPTY, "states": Kept([*rows, {"number": 3, "refused": "x"}], 4, 10)}
    lines = page.page(told, *NO_MORE, {"ab": "1234abc"}).splitlines()
    assert lines[lines.index("| --- | --- | --- |") + 1 :] == [
        "| ab | 1234abc | 2 of changed states |",
        "| not noted | - | 1 of changed states |",
        "| cd | - | 1 of changed states |",
    ]


def test_a_digest_is_that_of_a_commit_and_of_the_checkout_that_has_it(tmp_path, monkeypatch, capsys):
    def git(*words):
        who = ["-c", "user.name=a", "-c", "user.email=a@b"]
        subprocess.run(["git", *who, *words], cwd=tmp_path, check=True, capture_output=True)

    git("init", "-q")
    digests = []
    for content in ("1", "2"):
        for place in ("b/c.py", "b.py", "a.py", "b/c.txt"):  # "b/c.py" stands before "b.py"
            file = tmp_path / "entropy_explore_env" / place
            file.parent.mkdir(parents=True, exist_ok=True)
            file.write_text(f"{place} {content}")
        git("add", "-A")
        git("commit", "-q", "-m", content)
        digests.append(sources.digest_of_commit(tmp_path, "HEAD"))
    text = "".join(f"{place} 2" for place in ("a.py", "b/c.py", "b.py"))
    assert digests[1] == hashlib.sha256(text.encode()).hexdigest()[:12] != digests[0]
    monkeypatch.setattr(sources.entropy_explore_env, "__file__", str(file.parents[1] / "__init__.py"))
    sources.library_digest.cache_clear()
    assert sources.library_digest() == digests[1]
    assert sources.main([]) == sources.main(["HEAD"]) == 0
    assert capsys.readouterr().out.split() == [digests[1]] * 2
    sources.library_digest.cache_clear()
    found = sources.commits_of(tmp_path, [digests[0], "other"])
    assert list(found) == digests[:1] and sources.digest_of_commit(tmp_path, found[digests[0]]) == digests[0]
    assert sources.commits_of(tmp_path / "entropy_explore_env", []) == {}
    with pytest.raises(SettingError, match="a commit of this checkout"):
        sources.digest_of_commit(tmp_path, "gone")


def test_a_night_plays_cases_of_its_own(tmp_path, monkeypatch, capsys):
    counted = Proof(counts_for_seven, 10, 20, 60.0, seven)
    monkeypatch.setattr(command, "PROOFS", {"settings": counted})
    monkeypatch.setattr(command, "page", lambda *_: "")
    assert main(["--cases", "14", "--first", "300", "--results", str(tmp_path)]) == 0
    assert [row["number"] for row in read_rows(tmp_path / "settings.jsonl")] == [300, 301]
    capsys.readouterr()
    for words in (["--first", "-1"], ["--cases", "0"]):
        with pytest.raises(SettingError, match=words[0][2:]):
            main([*words, "--results", str(tmp_path)])


def test_a_proof_stops_at_what_is_asked_for_and_at_its_time(tmp_path, capsys):
    counted = Proof(counts_for_seven, 10, 20, 60.0, seven)
    carry_on(counted, tmp_path / "sevens.jsonl", 20)
    assert [row["number"] for row in read_rows(tmp_path / "sevens.jsonl")] == [0, 1, 2]
    carry_on(counted, tmp_path / "sevens.jsonl", 70, limit_s=0.0)
    assert len(read_rows(tmp_path / "sevens.jsonl")) == 3
    carry_on(counted, tmp_path / "sevens.jsonl", 70, limit_s=1e-9)
    assert len(read_rows(tmp_path / "sevens.jsonl")) == 4
    assert len({row["library"] for row in read_rows(tmp_path / "sevens.jsonl")}) == 1
    assert "sevens: 28 of 70" in capsys.readouterr().err


def test_only_the_cases_of_some_loaders_are_played(tmp_path, monkeypatch, capsys):
    few = Proof(counts_for_seven, 10, 1_000, 60.0, seven, 3 * len(file_fuzz.LOADERS))
    monkeypatch.setattr(command, "PROOFS", {"files": few})
    monkeypatch.setattr(command, "page", lambda *_: "")
    words = ["--proofs", "files", "--results", str(tmp_path), "--loaders"]
    assert main([*words, "height png", "record"]) == 0
    numbers = [row["number"] for row in read_rows(tmp_path / "files.jsonl")]
    assert [file_fuzz.LOADERS[number % len(file_fuzz.LOADERS)] for number in numbers] == [
        "record",
        "height png",
    ] * 3
    capsys.readouterr()
    with pytest.raises(SettingError, match="loaders = 'records': allowed is one of record, checkpoint"):
        main([*words, "records"])


def test_a_case_of_changed_files(monkeypatch):
    """Of worlds, by a process that stays for the next case, and of what the library saves itself."""
    monkeypatch.setattr(file_fuzz, "BATCH", 8)
    image, loaders = file_fuzz.LOADERS.index("image"), len(file_fuzz.LOADERS)
    rows = [file_fuzz.play_number(number) for number in (image, image + loaders, 0)]
    assert [row["loader"] for row in rows] == ["image", "image", "record"]
    assert all(file_fuzz.files_of(row) == 8 and "failure" not in row for row in rows)
    assert 10.0 < rows[0]["held_mib"] < 512.0 and rows[2]["grew_mib"] >= 0.0
    text = kept("files", rows)
    assert f"| image | 16 | {rows[0]['loaded'] + rows[1]['loaded']} |" in text and "| record | 8 |" in text
    reader = file_fuzz._reader_of("image")
    assert reader._process is not None and reader._process.poll() is None
    reader.close()
    file_fuzz._reader_of.cache_clear()


def counts_for_seven(number):
    return {"seven": 7}


def seven(row):
    return row["seven"]


def test_scenarios_whose_actions_are_candidates_are_played():
    """Their numbers go as far as there are candidates."""
    for number in range(40):
        drawn, draw = None, 0
        while drawn is None:
            drawn, draw = determinism._allowed(number, draw), draw + 1
        if drawn.scenario.action.kind == "candidates":
            break
    assert len({determinism.digest_of(number, 1, missions) for missions in (1, 2)}) == 1


def test_a_digest_does_not_depend_on_threads_or_company():
    digests = {determinism.digest_of(3, threads, missions) for threads in (1, 2) for missions in (1, 3)}
    assert len(digests) == 1 != len({determinism.digest_of(number, 1, 1) for number in (3, 5)})


def test_a_piece_of_soak(monkeypatch):
    monkeypatch.setattr(soak, "CASE_S", 0.2)
    monkeypatch.setattr(soak, "FLOOR", 3_000)
    box = list(soak.SCENARIOS).index("box-7x11x5")
    row = soak.play_number(box)
    assert row["resident_mib"] > 10.0 and (row["scenario"], row["channel"]) == ("box-7x11x5", 0)
    assert 3_000 <= soak.robot_steps(row) < 3_600 and soak.robot_steps({"failure": "x"}) == 0
    more = len(soak.CHANNELS) * len(soak.SCENARIOS) + len(soak.QUICK)
    row = soak.play_number(more - more % (len(soak.CHANNELS) * len(soak.QUICK)))
    assert (row["scenario"], row["channel"]) == ("box-7x11x5", 0) and row["cpu_s"] >= 0.2


@needs_posix
def test_a_few_kills_of_a_trainer(tmp_path, monkeypatch):
    monkeypatch.setattr(kills, "KILLS", 3)
    assert kills.kill_trainer(tmp_path / "run", random.Random(0)) >= 3


@needs_posix
@pytest.mark.long
def test_kills_of_a_sweep(tmp_path):
    assert len(kills.kill_sweep(tmp_path / "sweep", random.Random(0))) == kills.KILLS

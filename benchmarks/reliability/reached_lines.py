"""Which tests take a line of a source, out of what `benchmarks.reliability.coverage` keeps."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path

from benchmarks.reliability.quick_tests import SET_UP, Told, told_in


@dataclass(frozen=True)
class Reached:
    """What tests take.

    Attributes:
        lines: Path of a source → line → names of tests.
        told: Name of a test → what became of it.
    """

    lines: Mapping[str, Mapping[int, set[str]]]
    told: Mapping[str, Told]

    def tests_of(self, path: str, lines: Iterable[int], test_s: float, tests_s: float) -> list[str]:
        """Names of the tests that take one of some lines: those of the file itself first, then the quickest.

        Args:
            path: Of the source, from the root of the checkout.
            lines: Of the source.
            test_s: Seconds that a test may take.
            tests_s: Seconds of all of them together; the first is run in any case.
        """
        taken = self.lines.get(path, {})
        names = set().union(*(taken.get(line, set()) for line in lines))
        tests = [self.told[name] for name in names if name in self.told]
        stem, folder = Path(path).stem, Path(path).parent.name
        own = (f"test_{stem}.py", f"test_{folder}.py", f"test_{folder}_{stem}.py")
        tests = sorted(
            (test for test in tests if test.passed and test.seconds <= test_s),
            key=lambda test: (not _file_of(test.name).endswith(own), test.seconds, test.name),
        )
        chosen: list[str] = []
        for test in tests:
            tests_s -= test.seconds
            if tests_s >= 0.0 or not chosen:
                chosen.append(test.name)
        return chosen


def reached_lines(folder: Path) -> Reached:
    """What the tests took of which data are kept in a folder.

    What was taken while a test was set up may have been made for others of its file: they all count for it.
    """
    from coverage import CoverageData

    lines: dict[str, dict[int, set[str]]] = defaultdict(lambda: defaultdict(set))
    told: dict[str, Told] = {}
    for file in sorted(folder.glob("*.coverage")):
        own = {test.name: test for test in told_in(file.with_suffix(".tests"))}
        told |= own
        data = CoverageData(str(file))
        data.read()
        for measured in data.measured_files():
            path = measured[measured.rindex("entropy_explore_env/") :]
            for line, contexts in data.contexts_by_lineno(measured).items():
                lines[path][line] |= {context for context in contexts if context and SET_UP not in context}
                if any(SET_UP in context for context in contexts):
                    lines[path][line] |= set(own)
        data.close()
    return Reached(lines, told)


def _file_of(test: str) -> str:
    """The file of a test, from its name."""
    return test.partition("::")[0]

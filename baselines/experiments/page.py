"""Pages of results: a Jinja2 template beside an experiment holds the prose, code gives tables and figures.

A template may ask for
    {{ figure("name", "what it shows") }}   a figure, which is drawn then, into a folder beside the page
    {{ table("name") }}                     a table
    {{ value("name") }}                     a figure of the text
    {{ claims }}, {{ held }}, {{ rows }}, {{ command }}
What is not there is an error that names it.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import jinja2
import matplotlib as mpl
from matplotlib.figure import Figure

from baselines.experiments.plots import STYLE, png
from entropy_explore_env.errors import SettingError, one_of
from entropy_explore_env.writing import write_atomically


@dataclass(frozen=True)
class Page:
    """A page of results.

    Attributes:
        template: Its file.
        figures: Name → what draws it.
        tables: Name → what gives its Markdown.
        values: Name → what stands in the text.
        texts: What the template may use by name.
    """

    template: Path
    figures: Mapping[str, Callable[[], Figure]] = field(default_factory=dict)
    tables: Mapping[str, Callable[[], str]] = field(default_factory=dict)
    values: Mapping[str, Any] = field(default_factory=dict)
    texts: Mapping[str, Any] = field(default_factory=dict)

    def write(self, folder: Path, name: str) -> Path:
        """Write the page and, in a folder of its name beside it, its figures.

        Returns:
            Path of the page.

        Raises:
            SettingError: The template is not there, cannot be read, or asks for what is not there.
        """

        def figure(wanted: str, shows: str) -> str:
            with mpl.rc_context(STYLE):
                drawn = _found("figure", wanted, self.figures)()
                write_atomically(folder / name / f"{wanted}.png", png(drawn))
            return f"![{shows}]({name}/{wanted}.png)"

        def table(wanted: str) -> str:
            return _found("table", wanted, self.tables)().strip()

        def value(wanted: str) -> str:
            return str(_found("value", wanted, self.values))

        text = self._rendered(figure=figure, table=table, value=value, **self.texts)
        write_atomically(folder / f"{name}.md", text.strip() + "\n")
        return folder / f"{name}.md"

    def _rendered(self, **given: Any) -> str:  # noqa: ANN401 - whatever templates may use
        """Return the template with what is given."""
        environment = jinja2.Environment(
            undefined=jinja2.StrictUndefined, trim_blocks=True, lstrip_blocks=True, autoescape=False
        )
        try:
            template = self.template.read_text("utf-8")
        except OSError as error:
            raise SettingError("template", str(self.template), f"a file ({error.strerror})") from None
        try:
            return environment.from_string(template).render(given)
        except jinja2.TemplateSyntaxError as error:
            place = f"{self.template.name}, line {error.lineno}"
            raise SettingError("template", place, f"one of Jinja2 ({error.message})") from None
        except jinja2.UndefinedError as error:
            allowed = f"one that asks for {', '.join(given)} alone: {error.message}"
            raise SettingError("template", self.template.name, allowed) from None


def _found(kind: str, wanted: str, there: Mapping[str, Any]) -> Any:  # noqa: ANN401 - what is there
    """Return what a template asks for by name."""
    if wanted not in there:
        raise SettingError(f"{kind} of the page", wanted, one_of(wanted, there))
    return there[wanted]

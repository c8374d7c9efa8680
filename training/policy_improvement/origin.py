"""What a file of results comes from: those of another origin are not used."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import NamedTuple

from training.errors import LabelsError

_OF = {"code": "this version of the code", "settings": "these options"}


class Origin(NamedTuple):
    """What decides the results in a file.

    Attributes:
        code: Digest of the code.
        settings: Digest of all options that count.
    """

    code: str
    settings: str

    def check(self, file: Path, head: Mapping[str, object]) -> None:
        """Compare what a file says of itself.

        Raises:
            LabelsError: It is of another version of the code, or was made with other options.
        """
        for name, expected in self._asdict().items():
            found = head.get(name)
            if found != expected:
                allowed = f"{expected[:12]}…, made with {_OF[name]}; remove the folder, or name a new one"
                raise LabelsError(f"{file}: {name}", f"{str(found)[:12]}…", allowed)

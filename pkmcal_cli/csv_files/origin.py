"""Where a table comes from: told in `FILE.provenance.yaml` beside it, or, on a stream, in `#` lines before its header.

So a table that is a file opens in a spreadsheet as it is. The file beside it has the table's sha256 and is written
first: one that belongs to another content of the table is told, and does not count.
"""

from __future__ import annotations

import os
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

SUFFIX = ".provenance.yaml"
SIMULATED = "simulated: no measurements"
_KIND = "simulated"  # of a file beside a table; earlier tables begin with "# simulated by pkmcal"
_READ = 1 << 16  # bytes of a file beside a table that are looked at
_SHA256 = re.compile(r"""^sha256: *["']?([0-9a-fA-F]{64})["']?\s*$""", re.MULTILINE)
_OF_KIND = re.compile(r"""^kind: *["']?(\w+)["']?\s*$""", re.MULTILINE)


@dataclass(frozen=True)
class Origin:
    """What a written table is: kind in a word, what is to be known of it, provenance."""

    kind: str
    note: str
    head: Mapping[str, Any]

    def lines(self) -> list[str]:
        """As comment lines."""
        return [*self.note.splitlines(), *_yaml({"provenance": dict(self.head)}).splitlines()]

    def text(self, table: Path | str, sha256: str) -> str:
        """As the text of the file beside a table with this content."""
        header = {"data": Path(table).name, "sha256": sha256, "kind": self.kind, "note": self.note}
        return _yaml(header | {"provenance": dict(self.head)})


def _yaml(tree: Mapping[str, Any]) -> str:
    import yaml

    text: str = yaml.safe_dump(tree, sort_keys=False, allow_unicode=True, width=1000)
    return text


def beside(table: Path | str) -> str:
    """The name of the file that tells where a table comes from."""
    return f"{table}{SUFFIX}"


def origin_note(table: str, sha256: str, comments: Sequence[str]) -> str:
    """What is to be said of a table that was read: simulated, or a file beside it that is not its own; "" otherwise."""
    if any(line.startswith(_KIND) for line in comments[:1]):
        return SIMULATED
    name = beside(table)
    if not os.path.isfile(name):
        return ""
    short = os.path.basename(name)
    try:
        with open(name, "rb") as file:
            text = file.read(_READ).decode("utf-8", "replace")
    except OSError as error:
        return f"{short} cannot be read ({error.strerror}): ignored"
    digest = _SHA256.search(text)
    if digest is None:
        return f"{short} has no `sha256` of this table: ignored"
    if digest[1].lower() != sha256:
        return f"{short} was written for another content of this table: ignored"
    kind = _OF_KIND.search(text)
    return f"{SIMULATED} ({short})" if kind is not None and kind[1] == _KIND else ""

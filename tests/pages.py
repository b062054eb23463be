"""Pages of the documentation as tests see them: fenced blocks, files that they write, commands with shown output."""

from __future__ import annotations

import re
import shlex
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

from tests.command import ROOT, Done
from tests.computed_once import run_once

_DOCS = sorted((ROOT / "docs").rglob("*.md"))
SHOWING = (ROOT / "README.md", *(page for page in _DOCS if "```console" in page.read_text(encoding="utf-8")))
"""Pages with commands and what they print."""

_FENCE = re.compile(r"^```(\w+)\n(.*?)^```$", re.MULTILINE | re.DOTALL)
_HEAD = re.compile(r"# ([\w-]+\.yaml)(, continued)?")
OMITTED = "..."


@dataclass(frozen=True)
class Shown:
    """A command line of a page with the output that the page shows."""

    line: str
    output: tuple[str, ...]


def blocks(text: str, kind: str) -> list[str]:
    """Texts of the fenced blocks of a kind."""
    return [body for found, body in _FENCE.findall(text) if found == kind]


def commands(text: str) -> Iterator[Shown]:
    """The commands of a page, `$ pkmcal ...` in blocks of the console."""
    for body in blocks(text, "console"):
        for part in re.split(r"^\$ ", body, flags=re.MULTILINE)[1:]:
            line, *output = part.splitlines()
            yield Shown(line, tuple(each.rstrip() for each in output))


def machine_files(text: str) -> dict[str, str]:
    """The machine files that a page writes, by name; a continued block adds to its file."""
    files: dict[str, str] = {}
    for body in blocks(text, "yaml"):
        head = _HEAD.fullmatch(body.splitlines()[0])
        assert head is not None, f"begin the block with `# NAME.yaml`: {body[:60]!r}"
        name, continued = head[1], head[2] is not None
        assert continued == (name in files), f"{name}: written twice, or continued before it begins"
        files[name] = files.get(name, "") + (body.partition("\n")[2] if continued else body)
    return files


def all_files() -> dict[str, str]:
    """The machine files that all pages but the README write."""
    files: dict[str, str] = {}
    for page in SHOWING[1:]:
        files |= machine_files(page.read_text(encoding="utf-8"))
    return files


def done(line: str) -> list[Done]:
    """A command line, carried out in this process: commands with pipes between them, or one after another (&&)."""
    results: list[Done] = []
    piped, words = False, list[str]()
    for word in (*shlex.split(line), "&&"):
        if word not in ("|", "&&"):
            words.append(word)
            continue
        program, *arguments = words
        assert program == "pkmcal", line
        results.append(run_once(*arguments, stdin=results[-1].out if piped else None))
        piped, words = word == "|", []
    return results


def output(results: Sequence[Done]) -> list[str]:
    """The lines that a terminal would show."""
    text = "".join(each.err for each in results) + results[-1].out
    return [line.rstrip() for line in text.strip("\n").splitlines()]


def fits(shown: Sequence[str], real: Sequence[str]) -> bool:
    """Whether the shown lines are the real ones; "..." stands for lines that are left out, also none."""
    if not shown:
        return not real
    if shown[0] == OMITTED:
        return any(fits(shown[1:], real[k:]) for k in range(len(real) + 1))
    return bool(real) and shown[0] == real[0] and fits(shown[1:], real[1:])


def write(folder: Path, files: dict[str, str]) -> None:
    """The machine files of a page."""
    for name, text in files.items():
        (folder / name).write_text(text, encoding="utf-8")

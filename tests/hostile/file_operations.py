"""Every file operation of a writing command fails once: what is on the disk afterwards is whole, old or absent.

`python -m tests.hostile.file_operations`. Each command runs in a child process of its own; the n-th operation on the
folder of its results is killed, or ends in ENOSPC, EIO or MemoryError, for every n that there is.
"""

from __future__ import annotations

import contextlib
import errno
import io
import os
import sys
import tempfile
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from pkmcal_cli import app
from tests.command import MACHINES

_EVENTS = {"open", "os.rename", "os.link", "os.remove", "os.chmod", "os.mkdir"}
_OLD = "old\n"
TRIGLIDE = str(MACHINES / "triglide-nonredundant.yaml")
COMMANDS: dict[str, tuple[str, tuple[str, ...]]] = {
    "new": ("new rrr -o {}/m.yaml", ("m.yaml",)),
    "schema": ("schema -o {}/s.json", ("s.json",)),
    "simulate": (
        f"simulate {TRIGLIDE} --grid x=200:700:2,y=200:350:2 --seed 1 -o {{}}/t.csv",
        ("t.csv", "t.csv.provenance.yaml"),
    ),
    "draw": (f"draw {TRIGLIDE} -o {{}}/d.svg", ("d.svg",)),
}
"""Arguments, `{}` being the folder, and the files that are written."""
HOWS = ("kill", "ENOSPC", "EIO", "MemoryError")


@dataclass(frozen=True)
class Ended:
    """A command that was disturbed: exit code, 137 of one that was killed; files by name; whether it was disturbed."""

    code: int
    files: dict[str, str]
    reached: bool


def disturbed(command: str, at: int, how: str) -> Ended:
    """A command, old files replaced by force, with its operation number `at` (from 0) failing; -1: none."""
    arguments, names = COMMANDS[command]
    with tempfile.TemporaryDirectory() as folder:
        for name in names:
            (Path(folder) / name).write_text(_OLD)
        texts = [a.replace("{}", folder) for a in (*arguments.split(), "--force")]
        reached, wrote = os.pipe()
        child = os.fork()
        if not child:
            _run(texts, _breaker(folder, at, how, wrote))
        os.close(wrote)
        _, status = os.waitpid(child, 0)
        told = os.read(reached, 1)
        os.close(reached)
        files = {
            p.name: p.read_text().replace(folder, "{}") for p in Path(folder).iterdir() if not p.name.startswith(".")
        }
        code = os.waitstatus_to_exitcode(status)
        return Ended(code, files, bool(told))


def _run(texts: list[str], breaker: Callable[[str, Any], None]) -> None:
    code = 70
    try:
        sys.argv = ["pkmcal", *texts]
        with contextlib.redirect_stdout(io.StringIO()), contextlib.redirect_stderr(io.StringIO()):
            sys.addaudithook(breaker)
            fsync = os.fsync
            os.fsync = lambda file: (breaker("os.fsync", ()), fsync(file))[1]
            code = app.run(texts)
    finally:
        os._exit(code)


def _breaker(folder: str, at: int, how: str, told: int) -> Callable[[str, Any], None]:
    count = -1

    def breaks(event: str, arguments: Any) -> None:
        nonlocal count
        if event != "os.fsync" and (event not in _EVENTS or not str(arguments[0]).startswith(folder)):
            return
        count += 1
        if count != at:
            return
        os.write(told, b"x")
        if how == "kill":
            os._exit(137)
        raise MemoryError if how == "MemoryError" else OSError(getattr(errno, how), os.strerror(getattr(errno, how)))

    return breaks


def faults(command: str) -> tuple[int, list[str]]:
    """How many operations were disturbed, and what was wrong afterwards."""
    with tempfile.TemporaryDirectory() as folder, contextlib.redirect_stderr(io.StringIO()):
        app.run([a.replace("{}", folder) for a in COMMANDS[command][0].split()])  # so children need not import
    whole = disturbed(command, -1, "")
    assert whole.code == 0, command
    count, out = 0, []
    for how in HOWS:
        at = 0
        while (ended := disturbed(command, at, how)).reached:
            out += [f"{command}, operation {at}, {how}: {fault}" for fault in _judged(ended, whole, how)]
            at, count = at + 1, count + 1
    return count, out


def _judged(ended: Ended, whole: Ended, how: str) -> list[str]:
    codes = {"kill": (137,), "MemoryError": (0, 70)}.get(how, (0, 4))  # 70: told as too little memory
    out = [] if ended.code in codes else [f"exit code {ended.code}"]
    new = [name for name, text in ended.files.items() if text != _OLD]
    out += [f"{name} is torn" for name in new if name not in whole.files or not _same(ended.files[name], whole, name)]
    if how != "kill" and len(new) not in (0, len(whole.files)):
        out.append(f"only {', '.join(new)} new")
    if ended.code == 4 and new:
        out.append(f"failed, but {', '.join(new)} new")
    return out


def _same(text: str, whole: Ended, name: str) -> bool:
    """Whether a file is that of the undisturbed command, but for the time at which it was made."""
    lines, expected = text.splitlines(), whole.files[name].splitlines()
    pairs = zip(lines, expected, strict=False)
    return len(lines) == len(expected) and all(a == b or "created" in a for a, b in pairs)


def main() -> int:
    """All commands; the figures."""
    total, wrong = 0, list[str]()
    for command in COMMANDS:
        count, found = faults(command)
        total, wrong = total + count, wrong + found
        print(f"{command}: {count} operations, {len(found)} faults", flush=True)
    print(f"{total} file operations of {len(COMMANDS)} writing commands disturbed: {len(wrong)} faults")
    print("\n".join(wrong))
    return int(bool(wrong))


if __name__ == "__main__":
    raise SystemExit(main())

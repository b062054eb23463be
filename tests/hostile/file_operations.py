"""Every file operation of a writing command fails once: what is on the disk afterwards is whole, old or absent.

`python -m tests.hostile.file_operations [COMMAND ...]`. The n-th operation on the folder of the results is killed, ends
in ENOSPC, EIO or MemoryError, or finds the disk full from then on, for every n that there is.
"""

from __future__ import annotations

import re
import sys
import tempfile
from collections.abc import Sequence
from pathlib import Path

from pkmcal_cli.workflow.run_folder import RECORD, history
from tests.command import MACHINES, run
from tests.hostile.broken_disk import HOWS, Ended, contents, walked
from tests.hostile.file_commands import COMMANDS, OLD, Writing, prepare

CODES = {"kill": {137}, "MemoryError": {0, 3}, "full": {0, 4}, "ENOSPC": {0, 4}, "EIO": {0, 4}}
"""Exit codes by what went wrong; 0: the results were in place already, or can do without the operation."""
_TIME = re.compile(rb"\d{4}-\d\d-\d\d[T ]\d\d[:-]\d\d[:-]?[\d.]*(Z|[+-]\d\d:\d\d)?")
_DIGEST = re.compile(rb"\b[0-9a-f]{64}\b")


def faults(name: str, inputs: Path) -> tuple[int, list[str]]:
    """How many operations were disturbed, and what was wrong afterwards; inputs: a folder that was prepared."""
    writing = COMMANDS[name]
    with tempfile.TemporaryDirectory() as above:
        folder = Path(above).resolve() / "results"
        folder.mkdir()
        _old_files(writing, inputs, folder)
        old = contents(folder)
        arguments = _arguments(f"{writing.command} --force", inputs, folder)
        whole, ended = walked(arguments, folder, HOWS, arguments if writing.goes_on else ())
        assert whole.code == 0, f"{name}: {whole.err}"
        out = []
        for each in ended:
            wrong = [*_ended(each), *_torn(each, whole, old, writing), *_apart(each, old, writing, folder)]
            out += [f"{name}, {each.at}, {each.how}: {fault}" for fault in wrong]
    return len(ended), out


def _arguments(command: str, inputs: Path, folder: Path) -> list[str]:
    return [word.format(o=folder, i=inputs, m=MACHINES) for word in command.split()]


def _old_files(writing: Writing, inputs: Path, folder: Path) -> None:
    """What the command replaces."""
    for command in writing.before:
        done = run(*_arguments(command, inputs, folder))
        assert done.code == 0, done.err
    for name in (name for group in writing.groups for name in group if not name.endswith("/")):
        path = folder / name
        path.parent.mkdir(exist_ok=True)
        if not path.exists():
            path.write_bytes((inputs / "worn.yaml").read_bytes() if writing.before else OLD.encode())


def _ended(ended: Ended) -> list[str]:
    """What is wrong with the end of a command."""
    out = [] if ended.code in CODES[ended.how] else [f"exit code {ended.code}: {ended.err[-200:]}"]
    if "Traceback" in ended.err or "internal error" in ended.err:
        out.append(ended.err[-300:])
    if ended.code in (3, 4) and "error[" not in ended.err:
        out.append("failed without an error")
    return out


def _torn(ended: Ended, whole: Ended, old: dict[str, bytes], writing: Writing) -> list[str]:
    """Files that are neither old nor as they should be."""
    expected, before = _plain(whole.files), _plain(old)
    out = [f"{name} is gone" for name in old if name not in ended.files and name in whole.files]
    for name, content in _plain(ended.files).items():
        if content != before.get(name) and content != expected.get(name) and name not in writing.rough:
            out.append(f"{name} is torn")
    again = ended.again
    if again is not None and (again.code or _plain(_sure(again, writing)) != _plain(_sure(whole, writing))):
        out.append(f"does not go on to the same end ({again.code}: {again.err[-200:]})")
    return out


def _sure(ended: Ended, writing: Writing) -> dict[str, bytes]:
    return {name: content for name, content in ended.files.items() if name not in writing.rough}


def _apart(ended: Ended, old: dict[str, bytes], writing: Writing, folder: Path) -> list[str]:
    """Files that belong together, but only some are new; and results of a command that says that it has failed."""
    out, states = [], []
    files, before = _plain(ended.files), _plain(old)
    for group in writing.groups:
        names = [n for n in {*files, *before, *group} if n.startswith(group) and not n.endswith("/")]
        new = sorted(n for n in names if files.get(n) != before.get(n))
        states.append(len(new) == len(names) and bool(names))
        if new and not states[-1]:
            if ended.how != "kill":
                out.append(f"only {', '.join(new)} new")
            elif writing.accepted is not None and _accepted(ended, writing, folder):
                out.append(f"only {', '.join(new)} new, and accepted")
    if ended.code in (3, 4) and all(states):
        out.append("failed, but all results are there")
    return out + _runs(ended, folder)


def _accepted(ended: Ended, writing: Writing, folder: Path) -> bool:
    """Whether a command takes what was left behind."""
    assert writing.accepted is not None
    _left_behind(ended, folder)
    return writing.accepted(folder)


def _runs(ended: Ended, folder: Path) -> list[str]:
    """Kept runs that are not whole."""
    if not any(name.endswith(f"/{RECORD}") for name in ended.files):
        return []
    _left_behind(ended, folder)
    return [f"{each.folder} is not intact" for each in history(str(folder / "runs")) if not each.intact]


def _left_behind(ended: Ended, folder: Path) -> None:
    for name, content in ended.files.items():
        (folder / name).parent.mkdir(parents=True, exist_ok=True)
        (folder / name).write_bytes(content)


def _plain(files: dict[str, bytes]) -> dict[str, bytes]:
    """Without the times at which they were made, and without checksums that depend on them."""
    out = {}
    for name, content in files.items():
        plain = _TIME.sub(b"TIME", content)
        plain = _DIGEST.sub(b"DIGEST", plain) if name.endswith(RECORD) else plain
        out[_TIME.sub(b"TIME", name.encode()).decode()] = plain
    return out


def main(names: Sequence[str]) -> int:
    """All commands, or some; the figures."""
    total, wrong, chosen = 0, list[str](), names or list(COMMANDS)
    with tempfile.TemporaryDirectory() as inputs:
        prepare(Path(inputs))
        for name in chosen:
            count, found = faults(name, Path(inputs))
            total, wrong = total + count, wrong + found
            print(f"{name}: {count} operations, {len(found)} faults", *found[:10], sep="\n  ", flush=True)
    print(f"{total} file operations of {len(chosen)} writing commands disturbed: {len(wrong)} faults")
    return int(bool(wrong))


if __name__ == "__main__":
    raise SystemExit(main(sys.argv[1:]))

"""Results of tasks that are kept in a file, so that a work which is stopped goes on where it was.

The file is written anew, whole or not at all, every second while results come, and when the work is stopped. It holds
what results depend on: another machine, table or option is refused. So is a file that no longer has its checksum.
"""

from __future__ import annotations

import hashlib
import json
import os
import time
from collections.abc import Collection, Mapping
from dataclasses import dataclass, field
from typing import Any, TypeVar

from pkmcal_cli import __version__
from pkmcal_cli.base.errors import BadInput, Location, OutputError, UsageError
from pkmcal_cli.base.files import is_stream, open_input
from pkmcal_cli.base.outputs import check_target, takes_directly, write_text
from pkmcal_cli.base.tasks import KeptWork
from pkmcal_cli.base.workers import Workers
from pkmcal_cli.report.console import Reporter

Result = TypeVar("Result")
_FORMS = "pkmcal/state/"
_FORM = f"{_FORMS}1"
_EVERY = 1.0  # s
_OTHER = "name another file, or delete this one to start again"


def check_state(file: str | None, inputs: Collection[str], *outputs: str | None) -> None:
    """Before the work: the file could be written, and is no other result's. Raises UsageError and OutputError."""
    if file is None:
        return
    if is_stream(file):
        raise UsageError("--state: `-` is not a file to resume from", hint="name a file")
    check_target(file, inputs, force=True)
    if takes_directly(file):
        raise OutputError("this is a device or a pipe, which keeps nothing to resume from", file, "name a regular file")
    for other in outputs:
        if other is not None and os.path.realpath(other) == os.path.realpath(file):
            raise UsageError(f"--state: `{file}` is already used for another result", hint="choose another name")


@dataclass(frozen=True)
class State:
    """Results by number so far; where they are kept, None for nowhere; what they depend on, by name."""

    file: str | None
    asked: Mapping[str, Any]
    results: dict[int, Any] = field(default_factory=dict)

    @classmethod
    def read(cls, file: str | None, command: str, asked: Mapping[str, Any], inputs: Mapping[str, str]) -> State:
        """What is kept of a work, nothing where there is no file yet. Raises BadInput for a file of another work."""
        head = {"command": command, "version": __version__, **_versions(), "inputs": [*inputs.values()], **asked}
        asked = json.loads(json.dumps(head))
        if file is None or not os.path.exists(file):
            return cls(file, asked)
        content = _parsed(file)
        for name in (*content["asked"], *asked):
            if content["asked"].get(name) != asked.get(name):
                before, asked_now = content["asked"].get(name), asked.get(name)
                other = f"{name} was {before}, now {asked_now}" if name != "inputs" else _other_files(before, inputs)
                message = f"this state belongs to a different run: {other}"
                raise BadInput.single(message, Location(file), _OTHER, "state")
        if content.get("sha256") != _checksum(asked, content["results"]):
            raise _damaged(file)
        return cls(file, asked, {int(number): result for number, result in content["results"].items()})

    def write(self) -> None:
        """Keep what there is. Raises OutputError."""
        if self.file is not None:
            checksum = _checksum(self.asked, self.results)
            content = {"form": _FORM, "asked": self.asked, "sha256": checksum, "results": self.results}
            with write_text(self.file, (), force=True) as file:
                file.write(json.dumps(content))


def _other_files(before: Any, inputs: Mapping[str, str]) -> str:
    """How files by name differ from those whose sha256 a state holds."""
    known = before if isinstance(before, list) else []
    new = [f"`{name}`" for name, digest in inputs.items() if digest not in known]
    if new:
        words = "has changed since, or was not" if len(new) == 1 else "have changed since, or were not"
        return f"{' and '.join(new)} {words} part of it"
    if set(known) - set(inputs.values()):
        return f"it was made from {len(known)} files, not only from {' and '.join(f'`{n}`' for n in inputs)}"
    return f"its files were in another order, not {', '.join(f'`{n}`' for n in inputs)}"


def _checksum(asked: Mapping[str, Any], results: Mapping[Any, Any]) -> str:
    """Of what a state holds; the same from numbers as they were computed and as they were read."""
    return hashlib.sha256(json.dumps([asked, results]).encode()).hexdigest()


def _damaged(file: str) -> BadInput:
    message = "this state file is damaged: its results are not those that were written"
    return BadInput.single(message, Location(file), _OTHER, "state")


def _versions() -> dict[str, str]:
    import numpy
    import scipy

    return {"numpy": numpy.__version__, "scipy": scipy.__version__}


def _parsed(file: str) -> dict[str, Any]:
    """The content of a state. Raises BadInput for anything else."""
    with open_input(file) as opened:
        content = opened.read()
    message = "this is not a state file"
    try:
        record = json.loads(content)
        if record["form"] != _FORM and str(record["form"]).startswith(_FORMS):
            message = (
                f"this state file has the format `{str(record['form'])[:40]}`; this release of pkmcal reads `{_FORM}`"
            )
        numbered = all(number.isdecimal() for number, _ in record["results"].items())
        if record["form"] == _FORM and isinstance(record["asked"], dict) and numbered:
            return dict(record)
    except (ValueError, TypeError, KeyError, AttributeError, RecursionError):
        pass
    raise BadInput.single(message, Location(file), _OTHER, "state")


def all_done(
    work: KeptWork[Result], count: int, name: str, workers: Workers, state: State, to: Reporter
) -> Mapping[int, Result]:
    """Results of tasks 0 to `count` - 1, those that are kept and the others. Raises what a task raises, and BadInput.

    Stopped (Ctrl-C, SIGTERM), it keeps what there is, and raises KeyboardInterrupt.
    """
    if not all(map(work.fits, state.results.values())):
        raise _damaged(str(state.file))
    left = [number for number in range(count) if number not in state.results]
    if state.results and left:
        to.say(f"{count - len(left)} of {count} are done (`{state.file}`)")
    written = time.monotonic()
    try:
        with to.stages() as observe:
            for some in workers.done(work, left, name, observe):
                state.results.update(some)
                if time.monotonic() - written > _EVERY:
                    state.write()
                    written = time.monotonic()
    except KeyboardInterrupt:
        where = (
            f"; run the same command again to resume from `{state.file}`"
            if state.file
            else "; without `--state` no partial results are kept"
        )
        to.say(f"{len(state.results)} of {count} are done{where}")
        raise
    finally:
        if left:
            state.write()
    return state.results

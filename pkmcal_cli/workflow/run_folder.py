"""`--run DIR`: what a command read, found and wrote, as plain files in a folder of its own; the history of such runs.

    DIR/2026-05-04T10-20-30_calibrate/
      run.yaml      command line, date, versions, verdict, exit code, sha256 of inputs and results
      inputs/       copies of all inputs, which link to each other as they did, and what is told beside a table of it
      result.json   what `--json` writes
      params.yaml   and what else the command has made
"""

from __future__ import annotations

import json
import os
import secrets
import shutil
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

from pkmcal_cli.base.errors import BadInput, Location, OutputError, UsageError
from pkmcal_cli.base.files import is_stream, sha256
from pkmcal_cli.base.outputs import check_folder, make_folder, takes_directly
from pkmcal_cli.csv_files.origin import beside
from pkmcal_cli.loading.plain_files import plain_map
from pkmcal_cli.report.console import Reporter
from pkmcal_cli.report.provenance import provenance

RECORD, RESULT, PARAMETERS, INPUTS = "run.yaml", "result.json", "params.yaml", "inputs"
_PART = ".part"


@dataclass(frozen=True, kw_only=True)
class Run:
    """What a run has made: result for JSON, files by name with their text, exit code, verdict, figure in words.

    asked: options on which the result depends, by name; "measurements" and "parameters" are names of inputs.
    """

    command: str
    machine: str
    result: Mapping[str, Any]
    code: int
    verdict: str
    rms: str = ""
    files: Mapping[str, str] = field(default_factory=dict)
    asked: Mapping[str, Any] = field(default_factory=dict)


def check_run(folder: str | None, inputs: Iterable[str], results: Iterable[str | None]) -> None:
    """Find out before the work whether a run could be kept beside other results. Raises UsageError and OutputError."""
    if folder is None:
        return
    for name in inputs:
        if takes_directly(name):
            origin = "one comes from stdin" if is_stream(name) else f"`{name}` is no file"
            raise UsageError(f"--run keeps copies of its inputs, but {origin}", hint="give the inputs as files")
    if is_stream(folder):
        raise UsageError("--run: `-` is no folder", hint="name a folder")
    check_folder(folder)
    path = Path(os.path.abspath(folder))
    for result in results:
        if result is not None and path.is_relative_to(os.path.abspath(result)) and not os.path.isdir(result):
            raise UsageError(f"--run: `{result}` is another result of the command", hint="name another folder")


def keep_run(folder: str | None, inputs: Mapping[str, str], run: Run, to: Reporter) -> None:
    """Keep a run in a folder of its own, whole or not at all; inputs: sha256 by name. Raises OutputError."""
    if folder is None:
        return
    make_folder(folder)
    name = f"{datetime.now(UTC):%Y-%m-%dT%H-%M-%S}_{run.command}"
    part = Path(folder) / f".{name}.{secrets.token_hex(4)}{_PART}"
    try:
        (part / INPUTS).mkdir(parents=True)
        kept = _copied(part, inputs)
        for file, text in {RESULT: json.dumps(run.result, indent=2, ensure_ascii=False) + "\n", **run.files}.items():
            (part / file).write_text(text, encoding="utf-8", newline="\n")
        results = {file: _checksum(part / file) for file in (RESULT, *run.files)}
        (part / RECORD).write_text(_record(run, inputs, kept, results), encoding="utf-8", newline="\n")
        target = _moved(part, Path(folder), name)
    except OSError as error:
        raise OutputError(f"the run cannot be kept: {error.strerror or error}", folder) from error
    finally:
        shutil.rmtree(part, ignore_errors=True)
    to.say(f"run kept: {target}")


def _copied(part: Path, inputs: Mapping[str, str]) -> dict[str, str]:
    """Copies of the inputs, by name, lying to each other as they did. Raises OutputError for one that has changed."""
    kept = {}
    for name in inputs:
        target = part / copy_of(name, inputs)
        target.parent.mkdir(parents=True, exist_ok=True)
        shutil.copyfile(name, target)
        if _checksum(target) != inputs[name]:
            raise OutputError("this input has changed while the command ran; no run was kept", name, "run it again")
        if os.path.isfile(beside(name)):  # that a table is simulated must not be lost
            shutil.copyfile(beside(name), beside(target))
        kept[name] = str(target.relative_to(part))
    return kept


def _checksum(copy: Path) -> str:
    """Of what was just written. Raises OSError, which is an error of the output and not of an input."""
    with open(copy, "rb") as file:
        return sha256(file)


def copy_of(name: str, inputs: Iterable[str]) -> str:
    """Where the copy of an input is in the folder of a run: inputs keep their places below the folder of all."""
    paths = [os.path.dirname(os.path.abspath(n)) for n in inputs]
    return os.path.join(INPUTS, os.path.relpath(os.path.abspath(name), os.path.commonpath(paths)))


def _record(run: Run, inputs: Mapping[str, str], kept: Mapping[str, str], results: Mapping[str, str]) -> str:
    """The text of the record."""
    import yaml

    head = provenance(inputs)
    record = {
        "command": run.command,
        "machine": run.machine,
        "created": head["created"],
        "verdict": run.verdict,
        "rms": run.rms or None,
        "exit_code": run.code,
        "arguments": head["arguments"],
        "asked": dict(run.asked),
        "versions": {key: head[key] for key in ("program", "python", "numpy", "scipy")},
        "inputs": {name: {"file": kept[name], "sha256": digest} for name, digest in inputs.items()},
        "results": dict(results),
    }
    text: str = yaml.safe_dump(record, sort_keys=False, allow_unicode=True, width=1000)
    return text


def _moved(part: Path, folder: Path, name: str) -> Path:
    """The finished folder under a name that is free. Raises OSError."""
    for number in range(1, 1000):
        target = folder / (name if number == 1 else f"{name}-{number}")
        if target.exists():
            continue
        try:
            os.rename(part, target)
        except OSError:
            if target.exists():
                continue
            raise
        return target
    raise OSError("no name is free")


@dataclass(frozen=True, kw_only=True)
class KeptRun:
    """A run as its record tells it; results: names of files; `intact`: whether these are what was written."""

    folder: str
    command: str
    machine: str
    created: str
    verdict: str
    rms: str
    code: int | None
    results: tuple[str, ...]
    intact: bool

    def json(self) -> dict[str, Any]:
        """The JSON form."""
        return {
            "folder": self.folder,
            "command": self.command,
            "machine": self.machine,
            "created": self.created,
            "verdict": self.verdict,
            "rms": self.rms or None,
            "exit_code": self.code,
            "intact": self.intact,
        }


def history(folder: str) -> list[KeptRun]:
    """Runs in a folder, oldest first. Raises BadInput where there is none, or a record cannot be read."""
    try:
        names = sorted(e for e in os.listdir(folder) if not e.startswith("."))
    except OSError as error:
        raise BadInput.single(f"the folder cannot be read: {error.strerror}", Location(folder), code="file") from None
    runs = [kept_run(os.path.join(folder, n)) for n in names if os.path.isfile(os.path.join(folder, n, RECORD))]
    if not runs:
        hint = "keep runs with `--run DIR`, e.g. `pkmcal calibrate M.yaml MEAS.csv --run DIR`"
        raise BadInput.single("there is no run in this folder", Location(folder), hint, "file")
    return sorted(runs, key=lambda r: (r.created, r.folder))


def kept_run(folder: str) -> KeptRun:
    """The run in a folder. Raises BadInput."""
    path = os.path.join(folder, RECORD)
    record = plain_map(path, "the record of a run", "command:")
    results, code = record.get("results"), record.get("exit_code")
    return KeptRun(
        folder=folder,
        **{key: str(record.get(key) or "") for key in ("command", "machine", "created", "verdict", "rms")},
        code=code if isinstance(code, int) else None,
        results=tuple(map(str, results)) if isinstance(results, dict) else (),
        intact=isinstance(results, dict) and all(_same(folder, str(f), str(d)) for f, d in results.items()),
    )


def _same(folder: str, file: str, digest: str) -> bool:
    path = Path(folder) / os.path.basename(file)
    return path.is_file() and sha256(path) == digest


def _ended(run: KeptRun) -> str:
    """The verdict, and the exit code where it tells of a limit that was missed or of a negative one."""
    return run.verdict + (f" (exit code {run.code})" if run.code else "")


def show_history(to: Reporter, runs: list[KeptRun]) -> None:
    """For people."""
    rows = [
        (os.path.basename(r.folder), r.created[:16].replace("T", " "), r.command, r.machine, r.rms or "-", _ended(r))
        for r in runs
    ]
    to.table("Runs", ("run", "date", "command", "machine", "rms", "verdict"), rows, left=4, folded=("verdict",))
    for r in runs:
        if not r.intact:
            to.warn(f"warning: {r.folder}: a result is missing or has been changed since")

"""From a correction to the files of a control: what `correct --as` does."""

from __future__ import annotations

import os
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from pkmcal_cli import __version__
from pkmcal_cli.base.errors import BadInput, Location, UsageError
from pkmcal_cli.base.files import is_stream
from pkmcal_cli.base.outputs import check_target, takes_directly, write_text, write_together
from pkmcal_cli.correction.assessment import Assessment
from pkmcal_cli.correction.export_case import ExportCase, Format
from pkmcal_cli.correction.redundancy import Choice
from pkmcal_cli.csv_files.origin import Origin
from pkmcal_cli.csv_files.writer import check_table, open_with_origin
from pkmcal_cli.loading.load_machine import LoadedMachine, Start
from pkmcal_cli.loading.targets import Targets
from pkmcal_cli.model.model import Model
from pkmcal_cli.report.console import Reporter
from pkmcal_cli.report.export import ExportReport
from pkmcal_cli.report.provenance import provenance_lines


@dataclass(frozen=True, kw_only=True)
class Export:
    """What is to be written: a format, where, how."""

    format: Format
    target: str
    choice: Choice
    dwell: float
    feed: float
    force: bool

    def check(self, drives: Sequence[str], inputs: Collection[str]) -> None:
        """Whether the files could be written. Raises UsageError and OutputError."""
        if self.format.parts and not self._names_files:
            message = f"--as {self.format.keyword} writes a file for every drive"
            raise UsageError(message, hint=f"name them with `-o NAME{self.format.suffix}`")
        for name in self.files(drives).values():
            check = check_table if self.format.suffix == ".csv" else check_target
            check(name, inputs, force=self.force)

    @property
    def _names_files(self) -> bool:
        """Whether names can be made of the target: it is no stream, device or folder."""
        named = Path(self.target).name not in ("", "..") and not takes_directly(self.target)
        return named and not os.path.isdir(self.target)

    def kept_name(self, part: str) -> str:
        """Name in a kept run of the file of a drive, or of the only one."""
        return f"export{'.' * bool(part)}{part}{self.format.suffix}"

    def files(self, drives: Sequence[str]) -> dict[str, str]:
        """Names of files by part: NAME.DRIVE.SUFFIX where there is one for every drive."""
        if not self.format.parts:
            return {"": self.target}
        path = Path(self.target)
        return {name: str(path.with_name(f"{path.stem}.{name}{path.suffix or self.format.suffix}")) for name in drives}


def exported(
    export: Export, loaded: LoadedMachine, model: Model, start: Start, targets: Targets, result: Assessment
) -> ExportReport:
    """The draft of a format and what remains. Raises BadInput where the format cannot hold the machine."""
    made = result.correction
    usable_rows = targets.rows.take(made.kept)
    case = ExportCase(
        loaded=loaded, model=model, values=start.values, assessment=result, choice=export.choice, rows=usable_rows,
        names=[], covariance=start.covariance, dwell=export.dwell, feed=export.feed,
    )  # fmt: skip
    if not len(case.usable):
        message = "no target has both corrected set values and set values of the nominal machine"
        raise BadInput.single(
            message, Location(model.name), "give targets within reach of the nominal machine", "targets"
        )
    case = _named(case, targets)
    return ExportReport(case=case, format=export.format, draft=export.format.draft(case))


def _named(case: ExportCase, targets: Targets) -> ExportCase:
    numbers = [int(case.made.kept[k]) for k in case.usable]
    names = [_one_line(targets.row_origin(n).id or str(n + 1)) for n in numbers]
    return replace(case, names=names)


def _one_line(text: str) -> str:
    """A name as a remark of a program can hold it."""
    return "".join(c if c.isprintable() and c not in "()" else "_" for c in text)


def write_export(
    export: Export, report: ExportReport, inputs: Collection[str], head: Mapping[str, Any], to: Reporter
) -> tuple[list[str], dict[str, str]]:
    """Write all files, or none, and tell what remains; their names, and what of them a kept run has. Raises
    OutputError."""
    remarks = [*report.remarks(), f"written by pkmcal {__version__}", *provenance_lines(head)]
    texts = report.draft.texts(remarks)
    files = export.files(list(texts)) if export.format.parts else {"": export.target}
    if export.format.parts:
        with write_together(list(files.values()), inputs, force=export.force) as opened:
            for name, file in zip(files, opened, strict=True):
                file.write(texts[name])
    elif export.format.suffix == ".csv":
        origin = Origin("correction", "\n".join(report.remarks()), head)
        with open_with_origin(export.target, inputs, origin, force=export.force) as file:
            file.write(report.draft.texts(())[""])
    else:
        with write_text(export.target, inputs, force=export.force) as file:
            file.write(texts[""])
    names = [name for name in files.values() if not is_stream(name)]
    report.show(to, names)
    return names, {export.kept_name(part): text for part, text in texts.items()}

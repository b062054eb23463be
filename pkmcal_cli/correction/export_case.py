"""What is written for a control, and the error of the tool point that remains once it is installed."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from pkmcal_cli.base.errors import BadInput
from pkmcal_cli.base.rotation import Array
from pkmcal_cli.correction.assessment import Assessment
from pkmcal_cli.correction.commanded_machine import CommandedMachine
from pkmcal_cli.correction.commands import Correction, depends_on_sides
from pkmcal_cli.correction.redundancy import Choice
from pkmcal_cli.correction.strained_pose import LoadedTool, StrainedPose, held_drives
from pkmcal_cli.loading.covariates import with_sides
from pkmcal_cli.loading.load_machine import LoadedMachine
from pkmcal_cli.mechanism.topology import Index
from pkmcal_cli.model.model import Model
from pkmcal_cli.prediction import Rows
from pkmcal_cli.units.unit_text import Unit, parse_unit

_SMALL = 1e-3  # weight of a drive's travel beside that of the tool point
_INTERNAL = 0.3  # the same of travel that moves no tool point, but strains the structure


@dataclass(frozen=True, kw_only=True)
class ExportCase:
    """A correction that is to be written for a control.

    given (N,): circumstances of the targets as they were given, before sides of approach were derived; names (n,) of
    the usable ones; choice: what redundant drives are used for; covariance: names and matrix of the parameters, None
    where unknown; dwell: s; feed: mm/min or deg/min; part: which of the usable targets alone count, None for all.
    """

    loaded: LoadedMachine
    model: Model
    values: Array
    assessment: Assessment
    choice: Choice
    rows: Rows
    names: Sequence[str]
    covariance: tuple[tuple[str, ...], Array] | None
    dwell: float
    feed: float
    part: NDArray[np.intp] | None = None

    @property
    def made(self) -> Correction:
        """The correction itself."""
        return self.assessment.correction

    @cached_property
    def tool(self) -> LoadedTool:
        """The tool point with all loads."""
        return LoadedTool(self.model, self.made.aim.held)

    @cached_property
    def usable(self) -> Index:
        """Numbers (n,) of the rows that have corrected set values, and set values of the nominal machine."""
        made = self.made
        every = np.array([k for k in made.good if np.isfinite(made.before.tool[k]).all()], dtype=np.intp)
        return every if self.part is None else every[self.part]

    @cached_property
    def drives(self) -> Index:
        """Drives (D,) that a control commands."""
        return held_drives(self.model)

    @property
    def commanded(self) -> Array:
        """Set values (n, A) of the nominal machine."""
        return self.made.aim.rows.readings[self.usable]

    @property
    def corrected(self) -> Array:
        """Corrected set values (n, A)."""
        return self.made.rows.readings[self.usable]

    @property
    def poses(self) -> Array:
        """Wanted poses (n, 6) of the tool point."""
        return self.made.aim.poses[self.usable]

    @property
    def targets(self) -> Array:
        """Wanted coordinates (n, h)."""
        return self.made.aim.targets[self.usable]

    @property
    def circumstances(self) -> Rows:
        """Rows (n,) as they were given."""
        return self.rows.take(self.usable)

    @property
    def sided(self) -> bool:
        """Whether it matters from which side a drive is approached."""
        return depends_on_sides(self.model)

    def sides(self, set_values: Array) -> NDArray[np.int_]:
        """Sides (n, D) from which drives are approached at set values (n, A): 1, -1, 0 unknown."""
        rows = self.directed(set_values)
        columns = [rows.columns[f"dir.{self.model.actuators[a].name}"] for a in self.drives]
        return np.stack(columns, axis=1).astype(int)

    @property
    def corrected_sides(self) -> NDArray[np.int_]:
        """Sides (n, A) that the corrected set values are for: 1, -1, 0 unknown."""
        columns = [self.made.rows.columns[f"dir.{a.name}"][self.usable] for a in self.model.actuators]
        return np.stack(columns, axis=1).astype(int)

    def directed(self, set_values: Array) -> Rows:
        """Rows (n,) at set values (n, A), in the circumstances of the targets and with sides by their order."""
        rows = replace(self.circumstances, readings=set_values)
        return with_sides(rows, self.model)

    @cached_property
    def weights(self) -> Array:
        """Errors (n, h + D, D) in m by set values: of the tool point, and of travel that only strains.

        So what is fitted to corrected set values is good at the tool point, and its redundant drives hardly fight.
        """
        rows = self.made.rows.take(self.usable)
        by_tool = self.tool.at(self.values, rows, self.targets, "readings").by_tool[:, :, self.drives]
        size = np.where(self.tool.turning, self.model.length, 1.0)
        gains = self.model.gains[self.drives]
        by_travel = by_tool * size[:, None] / gains
        count = len(self.drives)
        internal = np.eye(count) - np.linalg.pinv(by_travel) @ by_travel
        kept = (_SMALL * np.eye(count) + _INTERNAL * internal) * gains
        return np.concatenate([by_tool * size[:, None], kept], axis=1)

    def slopes(self, rows: Rows, targets: Array) -> Array | None:
        """Derivatives (n, D, p) of corrected set values by the parameters of the covariance; None where unknown.

        At rows that are corrected already: what keeps the tool point there, with the least travel.
        """
        if self.covariance is None:
            return None
        by_reading = self.tool.at(self.values, rows, targets, "readings").by_tool[:, :, self.drives]
        by_parameter = self.tool.at(self.values, rows, targets, self.covariance[0]).by_tool
        gains = self.model.gains[self.drives]
        return np.asarray(-(np.linalg.pinv(by_reading / gains) @ by_parameter) / gains[:, None])

    @property
    def own_slopes(self) -> Array | None:
        """The same at the usable targets."""
        return self.slopes(self.made.rows.take(self.usable), self.targets)

    def installed(self, draft: Draft) -> StrainedPose:
        """The machine with a draft installed: a prediction from scratch, as by `simulate`."""
        return self.tool.at(draft.values, self.directed(draft.commands), self.targets)

    def unit(self, drive: int) -> Unit:
        """In which unit controls count a drive: mm, in for files in inches, deg."""
        if self.model.actuators[drive].dimension == "angle":
            return parse_unit("deg")
        return parse_unit("in" if self.loaded.machine.units.length == "in" else "mm")

    def name(self, drive: int) -> str:
        """The name of a drive."""
        return self.model.actuators[drive].name

    @property
    def positions(self) -> Array:
        """Wanted x, y, z (n, 3), m; z is 0 in the plane."""
        return np.nan_to_num(self.poses[:, :3])

    @property
    def redundant(self) -> bool:
        """Whether more drives are commanded than the tool point has coordinates."""
        return len(self.drives) > len(self.made.aim.held)

    @property
    def machine(self) -> CommandedMachine:
        """What was known before the correction."""
        return CommandedMachine(self.loaded, self.made.aim.held)

    def refuse(self, keyword: str, message: str, hint: str) -> BadInput:
        """The error of a format that cannot hold this correction."""
        return self.machine.refuse(keyword, message, hint)


@dataclass(frozen=True)
class Listing:
    """A table for people: two columns of text, then numbers."""

    title: str
    head: tuple[str, ...]
    rows: tuple[tuple[str, ...], ...]


@dataclass(frozen=True, kw_only=True)
class Draft:
    """What would be installed.

    commands (n, A): what the control then sends at the usable targets, by its own rule and the digits written;
    values (P,): of the machine's parameters then; texts: from lines of remarks to texts by part, "" where there is one
    only; notes: what is to be said of it; entries: for JSON; shown: for people, beside the files.
    elsewhere: commands at the usable targets of another case, where numbers are fitted to the targets of this one.
    """

    commands: Array
    values: Array
    texts: Callable[[Sequence[str]], Mapping[str, str]]
    notes: tuple[str, ...] = ()
    entries: Sequence[Mapping[str, object]] = ()
    shown: Listing | None = None
    elsewhere: Callable[[ExportCase], Array] | None = None


@dataclass(frozen=True, kw_only=True)
class Format:
    """A form of what a control takes.

    keyword: what `--as` says; title: what it is; sources: addresses of its public specification; suffix: of its files;
    parts: whether it writes a file for every drive; draft: makes it; check: raises BadInput for a machine that no draft
    can hold, whatever is corrected.
    """

    keyword: str
    title: str
    sources: tuple[str, ...]
    suffix: str
    draft: Callable[[ExportCase], Draft]
    parts: bool = False
    check: Callable[[CommandedMachine], None] = lambda _: None

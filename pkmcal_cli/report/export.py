"""What `correct --as` wrote: the error of the tool point that remains once a control has it, in words and for JSON."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np

from pkmcal_cli.base.plural import count
from pkmcal_cli.base.rotation import Array
from pkmcal_cli.correction.export_case import Draft, ExportCase, Format
from pkmcal_cli.correction.strained_pose import StrainedPose
from pkmcal_cli.loading.poses import RowOrigin
from pkmcal_cli.report.console import Reporter
from pkmcal_cli.report.correction_figures import NOTHING, largest, rms, shown
from pkmcal_cli.report.loads import Loads
from pkmcal_cli.report.number_format import finite, three_digits
from pkmcal_cli.units.unit_text import Unit, parse_unit

_KINDS = (("position", "um"), ("orientation", "urad"))
_NO_ENERGY = 1e-12  # J: rounding
_ROUNDING = 1e-3  # um or urad: nothing
_LEAST = 1e-9  # m or rad: by which an error has to grow to be larger
_FOLDS, _FEWEST = 5, 10  # parts of the targets; targets
_OF_A_LIMIT = 0.01  # of forces and tensions, by which digits of an export may miss what corrected set values keep to
BEFORE, EXPORT, CORRECTED = "before", "export", "corrected"


@dataclass(frozen=True, kw_only=True)
class ExportReport:
    """A draft of a format for a case."""

    case: ExportCase
    format: Format
    draft: Draft

    @cached_property
    def _installed(self) -> StrainedPose:
        return self.case.installed(self.draft)

    @cached_property
    def _errors(self) -> dict[str, Array]:
        """Errors (n, h) at the usable targets: of the nominal set values, with the export, corrected."""
        made, rows, targets = self.case.made, self.case.usable, self.case.targets
        tools = (made.before.tool[rows], self._installed.tool, made.after.tool[rows])
        return {variant: tool - targets for variant, tool in zip((BEFORE, EXPORT, CORRECTED), tools, strict=True)}

    @cached_property
    def _apart(self) -> Array | None:
        """Errors (n, h) of the export at targets that it was not fitted to, some of all in turn; None where nothing is
        fitted, or by too few targets."""
        number = len(self.case.usable)
        if self.draft.elsewhere is None or number < _FEWEST:
            return None
        out, fold = np.full(self.case.targets.shape, np.nan), np.arange(number) % _FOLDS
        for k in range(_FOLDS):
            others, here = np.nonzero(fold != k)[0], np.nonzero(fold == k)[0]
            fitted, there = self.format.draft(replace(self.case, part=others)), replace(self.case, part=here)
            assert fitted.elsewhere is not None
            placed = there.installed(replace(fitted, commands=fitted.elsewhere(there)))
            out[here] = placed.tool - there.targets
        return out

    def _apart_text(self, kind: str) -> str:
        """What is to be said of targets that the export was not fitted to; "" for nothing."""
        if self.draft.elsewhere is None:
            return ""
        if self._apart is None:
            few = count(len(self.case.usable), "target")
            return f"{kind} between the targets: unknown with {few}; give {_FEWEST} or more"
        unit = dict(self.kinds)[kind]
        root, most = (self._text(f(self._apart_sizes(kind)), unit) for f in (rms, largest))
        return f"{kind} at targets that it was not fitted to ({_FOLDS} parts in turn): {root} rms, {most} at most"

    def _apart_sizes(self, kind: str) -> Array:
        assert self._apart is not None
        return np.asarray(np.sqrt((self._apart[:, self._columns(kind)] ** 2).sum(axis=1)))

    @cached_property
    def _energies(self) -> dict[str, float]:
        """Mean strain energies, J, of the same."""
        made, rows = self.case.made, self.case.usable
        energies = (made.before.energy[rows], self._installed.energy, made.after.energy[rows])
        means = (float(e[~np.isnan(e)].mean()) if (~np.isnan(e)).any() else float("nan") for e in energies)
        return dict(zip((BEFORE, EXPORT, CORRECTED), (m if not m < _NO_ENERGY else 0.0 for m in means), strict=True))

    @cached_property
    def _loads(self) -> Loads:
        """What drives and ropes bear with the export."""
        model, rows = self.case.model, self.case.directed(self.draft.commands)
        start = self._installed.prediction.start
        return Loads.of(model, self.draft.values, rows, self._row_origin, start, _OF_A_LIMIT)

    def _row_origin(self, row: int) -> RowOrigin:
        return RowOrigin(None, row + 1, f"target {self.case.names[row]}")

    def _strain_texts(self) -> list[str]:
        """What drives and ropes may not bear with the export; which ropes hang loose."""
        loads, by = self._loads, f"with `{self.format.keyword}`"
        texts = [text.replace("warning: ", f"warning: {by}: ", 1) for text in loads.warnings]
        return texts + [f"warning: {by}: {text}" for text in loads.notes]

    def _columns(self, kind: str) -> list[int]:
        turning = self.case.tool.turning
        return [k for k, angular in enumerate(turning) if angular == (kind == "orientation")]

    def _sizes(self, variant: str, kind: str) -> Array:
        """Sizes (n,) of an error; nan where the machine finds no pose."""
        return np.asarray(np.sqrt((self._errors[variant][:, self._columns(kind)] ** 2).sum(axis=1)))

    def _uncertainty(self, kind: str) -> float:
        """Standard uncertainty of the tool point at the corrected set values, rms; nan where unknown."""
        spread = self.case.assessment.after
        if spread is None:
            return float("nan")
        std = spread.tool[self.case.usable][:, self._columns(kind)]
        return float(np.sqrt((std**2).sum(axis=1).mean()))

    @property
    def lost(self) -> int:
        """Number of targets at which the machine finds no pose with the export."""
        return int(np.isnan(self._errors[EXPORT]).any(axis=1).sum())

    @property
    def kinds(self) -> list[tuple[str, Unit]]:
        """Kinds of errors that there are."""
        return [(kind, parse_unit(unit)) for kind, unit in _KINDS if self._columns(kind)]

    def _text(self, size: float, unit: Unit) -> str:
        return shown(size, unit, _ROUNDING, self.case.loaded.machine.file_units.length)

    def remarks(self) -> list[str]:
        """What stands in every written file, beside its numbers."""
        out = [f"pkmcal correct --as {self.format.keyword}: {self.format.title}"]
        for kind, unit in self.kinds:
            roots = [self._text(rms(self._sizes(w, kind)), unit) for w in (BEFORE, EXPORT, CORRECTED)]
            most = [self._text(largest(self._sizes(w, kind)), unit) for w in (BEFORE, EXPORT, CORRECTED)]
            where, u = count(len(self.case.usable), "target"), self._uncertainty(kind)
            out.append(
                f"error of the tool point that remains, {kind}, rms (max) of {where}: {roots[0]} ({most[0]}) before, "
                f"{roots[1]} ({most[1]}) with this, {roots[2]} ({most[2]}) with corrected set values; "
                f"standard uncertainty {'unknown' if np.isnan(u) else self._text(u, unit)}"
            )
            out += [text] if (text := self._apart_text(kind)) else []
        out += [*(f"note: {note}" for note in self.draft.notes), *self._strain_texts()]
        return out + [f"specification: {source}" for source in self.format.sources]

    def show(self, to: Reporter, files: Sequence[str]) -> None:
        """The verdict, errors that remain, what was written."""
        for kind, unit in self.kinds:
            roots = {w: self._text(rms(self._sizes(w, kind)), unit) for w in (BEFORE, EXPORT, CORRECTED)}
            with_it = f"{roots[BEFORE]} -> {roots[EXPORT]} with `{self.format.keyword}`"
            to.say(f"{kind}, rms: {with_it}, {roots[CORRECTED]} with corrected set values")
            if text := self._apart_text(kind):
                to.say(text)
        if (listing := self.draft.shown) is not None:
            to.table(listing.title, listing.head, listing.rows, left=2)
        rows = []
        names = {BEFORE: "nominal set values", EXPORT: self.format.title, CORRECTED: "corrected set values"}
        for kind, unit in self.kinds:
            for variant, name in names.items():
                sizes = self._sizes(variant, kind)
                u = NOTHING if variant == BEFORE else self._text(self._uncertainty(kind), unit)
                rows.append((kind, name, self._text(rms(sizes), unit), self._text(largest(sizes), unit), u))
        title = f"Error of the tool point that remains at {count(len(self.case.usable), 'target')}"
        to.table(title, ("error", "with", "rms", "max", "u (rms)"), rows, left=2)
        if self.case.redundant:
            before, with_it, after = (three_digits(self._energies[k]) for k in (BEFORE, EXPORT, CORRECTED))
            by = f"with `{self.format.keyword}`"
            to.say(f"strain energy (mean): {before} J before, {with_it} J {by}, {after} J corrected")
        to.notes(self.draft.notes)
        if left := len(self.case.made.good) - len(self.case.usable):
            to.warn(f"warning: not counted: {count(left, 'target')} without set values of the nominal machine")
        for kind, _ in self.kinds:
            if rms(self._sizes(EXPORT, kind)) > rms(self._sizes(BEFORE, kind)) + _LEAST:
                to.warn(f"warning: with `{self.format.keyword}` the error of the {kind} is larger than before")
        for text in self._strain_texts():
            to.warn(text)
        if self.lost:
            to.warn(f"warning: no pose of the machine with `{self.format.keyword}` at {count(self.lost, 'target')}")
        if files:
            to.say(f"written: {', '.join(files)}")

    def json(self, files: Sequence[str]) -> dict[str, Any]:
        """For JSON."""
        remaining: dict[str, Any] = {}
        for kind, unit in self.kinds:
            sizes = {w: self._sizes(w, kind) / unit.scale for w in (BEFORE, EXPORT, CORRECTED)}
            remaining[kind] = {w: {"rms": finite(rms(s)), "max": finite(largest(s))} for w, s in sizes.items()}
            if self._apart is not None:
                apart = self._apart_sizes(kind) / unit.scale
                remaining[kind]["not_fitted"] = {"rms": finite(rms(apart)), "max": finite(largest(apart))}
            remaining[kind] |= {"u": finite(self._uncertainty(kind) / unit.scale), "unit": unit.text}
        return {
            "format": self.format.keyword,
            "title": self.format.title,
            "specification": list(self.format.sources),
            "files": list(files),
            "n_targets": len(self.case.usable),
            "n_lost": self.lost,
            "remaining": remaining,
            "strain_energy": {variant: finite(value) for variant, value in self._energies.items()},
            "loads": self._loads.json(),
            "notes": list(self.draft.notes),
            "entries": [dict(entry) for entry in self.draft.entries],
        }

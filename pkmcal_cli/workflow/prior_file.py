"""`calibrate --prior OLD.params.yaml`: what an earlier calibration knows, of which few rows after a repair suffice."""

from __future__ import annotations

from dataclasses import dataclass
from fnmatch import fnmatchcase

import numpy as np

from pkmcal_cli.base.errors import BadInput, Location, UsageError, did_you_mean
from pkmcal_cli.base.rotation import Array
from pkmcal_cli.calibration.prior import Prior, joined, prior_of_covariance, prior_of_ranges
from pkmcal_cli.calibration.verification import own_of
from pkmcal_cli.effects.unexplained import UNEXPLAINED
from pkmcal_cli.loading.known_parameters import KnownParameters, known_parameters
from pkmcal_cli.model.model import Model
from pkmcal_cli.units.unit_text import parse_unit


@dataclass(frozen=True, kw_only=True)
class EarlierCalibration:
    """A prior of the selected parameters; values (P,) where the fit begins; inputs: sha256 by file; notes, warnings.

    known: what the file says.
    datum: parameters that the file held as datum: what it says of the others is true only with these as they were.
    """

    selected: tuple[str, ...]
    datum: tuple[str, ...]
    prior: Prior
    values: Array
    inputs: dict[str, str]
    notes: tuple[str, ...]
    warnings: tuple[str, ...]
    known: KnownParameters


def earlier_calibration(
    model: Model, path: str, chosen: tuple[str, ...], all_known: bool, loosen: str | None, start: Array
) -> EarlierCalibration:
    """Of the parameters `chosen`, and of all that the file knows where `all_known`; start (P,): values elsewhere.

    What is named in `loosen`, what the file does not know, and what a new set-up of an instrument changes is known to
    its declared range about nominal. Raises BadInput for a file without covariance, UsageError for names of nothing.
    """
    dimensions = {p.name: parse_unit(p.unit or "1").dimension for p in model.parameters}
    known = known_parameters(path).of_dimensions(dimensions)
    if known.covariance is None:
        message = "this parameter file has no complete `correlations` with `std`, so its uncertainties are unknown"
        raise BadInput.single(message, Location(path), "write it with `pkmcal calibrate -o`", "parameters")
    free = [p for p in model.parameters if not p.fixed and p.range > 0 and p.kind != UNEXPLAINED]
    of_file = set(known.names) if all_known else set()
    loosened = _loosened(model, loosen) | set(own_of(model))
    asked = tuple(p.name for p in free if p.name in chosen or p.name in of_file)
    datum = tuple(n for n in asked if n in model.datum and n not in loosened and n in known.exact)
    selected = tuple(n for n in asked if n not in datum)
    matched = tuple(n for n in selected if n in known.names and n not in loosened)
    others = tuple(n for n in selected if n not in matched)
    if not matched:
        message = "the file knows none of the selected parameters"
        raise BadInput.single(message, Location(path), "give the parameter file of this machine", "parameters")
    values = _values(model, known, {p.name for p in free} - loosened, loosened, start)
    places = [known.names.index(n) for n in matched]
    centre = values[[model.names.index(n) for n in matched]]
    prior = prior_of_covariance(matched, known.covariance[np.ix_(places, places)], centre)
    return EarlierCalibration(
        selected=selected,
        datum=datum,
        prior=joined(prior, prior_of_ranges(model, others)) if others else prior,
        values=values,
        inputs={known.file: known.sha256},
        notes=(*_notes(model, known, selected, loosened), *_datum_notes(known, datum)),
        warnings=_foreign(model, known, loosened),
        known=known,
    )


def _foreign(model: Model, known: KnownParameters, loosened: set[str]) -> tuple[str, ...]:
    """That the file is of another machine, of which few parameters are here or have values that are not of this one."""
    if known.fingerprint is None or model.fingerprint.difference(known.fingerprint) is None:
        return ()
    nominal, ranges = model.by_name(model.nominal), model.by_name(model.ranges)
    of_machine = [n for n in known.parameters if not n.startswith("frame@")]
    partners = [n for n in of_machine if n in model.names]
    far = [
        n for n in partners
        if n not in loosened and 0.0 < ranges[n] < abs(known.parameters[n].value - nominal[n])
    ]  # fmt: skip
    if 2 * len(partners) >= len(of_machine) and not far:
        return ()
    outside = f"; further from nominal here than their range: {', '.join(far)}" if far else ""
    return (
        f"warning: prior: {known.file} is of another machine, `{known.fingerprint.of}`: here are {len(partners)} of "
        f"its {len(of_machine)} parameters{outside}; what has the same name may be something else: give the parameter "
        "file of this machine, or name what has changed in `--loosen`",
    )


def _values(model: Model, known: KnownParameters, here: set[str], loosened: set[str], start: Array) -> Array:
    """Values (P,): of the file for parameters `here`, nominal ones for `loosened`, else those of the start (P,)."""
    values, nominal, there = start.copy(), model.nominal, known.values
    for k, name in enumerate(model.names):
        if name in loosened:
            values[k] = nominal[k]
        elif name in here and name in there:
            values[k] = there[name]
    return values


def _loosened(model: Model, text: str | None) -> set[str]:
    """Parameters that patterns name, separated by commas. Raises UsageError for a pattern that names none."""
    out: set[str] = set()
    patterns = [part.strip() for part in (text or "").split(",") if part.strip()]
    if text is not None and not patterns:
        message = f"--loosen: `{text}` names no parameter"
        raise UsageError(message, hint="write e.g. `--loosen l3,strut3.*`, or leave it out")
    for pattern in patterns:
        matching = {n for n in model.names if fnmatchcase(n, pattern)}
        if not matching:
            hint = did_you_mean(pattern, model.names)
            raise UsageError(f"--loosen: the machine has no parameter `{pattern}`", hint=hint)
        out |= matching
    return out


def _notes(
    model: Model, known: KnownParameters, selected: tuple[str, ...], loosened: set[str]
) -> tuple[str, ...]:
    """What is known by which file, what is not, and what has no partner."""
    matched = sum(n in known.names and n not in loosened for n in selected)
    out = [f"prior: {matched} of {len(selected)} identified parameters known by {known.file}"]
    if loosened_names := [n for n in selected if n in loosened]:
        out.append(f"prior: known to their ranges only (loosened): {', '.join(loosened_names)}")
    others = [n for n in selected if n not in known.names and n not in loosened]
    if exact := [n for n in others if n in known.exact]:
        out.append(
            f"prior: held in {known.file}, identified here, known to their ranges: {', '.join(exact)}; "
            f"to hold them again, add `--select \"auto,{','.join(f'-{n}' for n in exact)}\"`"
        )
    if new := [n for n in others if n not in known.exact]:
        out.append(f"prior: without partner in {known.file}, known to their ranges: {', '.join(new)}")
    if gone := [n for n in known.parameters if n not in model.names]:
        out.append(f"prior: not in this machine, left out: {', '.join(gone)}")
    return tuple(out)


def _datum_notes(known: KnownParameters, datum: tuple[str, ...]) -> tuple[str, ...]:
    """What stays held, and how to free it."""
    if not datum:
        return ()
    free = "to free one, name it in `--loosen`"
    return (f"prior: datum of {known.file}, held at the values there: {', '.join(datum)}; {free}",)

"""Mean errors of repeated calibrations, with the standard uncertainties of the means."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from pkmcal_cli.base.rotation import Array
from pkmcal_cli.calibration.fitted_frames import frame_parameters
from pkmcal_cli.calibration.study import Outcome, Study
from pkmcal_cli.units.unit_text import parse_unit

TOOL = "tool point"


@dataclass(frozen=True)
class Mean:
    """A mean, SI, and its standard uncertainty; nan of too few values."""

    value: float
    std: float

    @classmethod
    def of(cls, values: Array) -> Mean:
        """Of values (n,)."""
        if len(values) < 2:
            return cls(float(values.mean()) if len(values) else float("nan"), float("nan"))
        return cls(float(values.mean()), float(values.std(ddof=1) / np.sqrt(len(values))))


@dataclass(frozen=True, kw_only=True)
class CaseFigures:
    """Of one machine and number of points: calibrations that ended well and not; mean absolute errors.

    kinds: by dimension of parameters, all and (common) those that every machine has; parameters: by name.
    """

    machine: str
    points: int
    count: int
    failed: int
    kinds: Mapping[str, Mean]
    common: Mapping[str, Mean]
    parameters: Mapping[str, Mean]
    tool: Mean


@dataclass(frozen=True, kw_only=True)
class Difference:
    """By how much larger a mean error is of a machine than of the first, by kind, of repetitions that both have."""

    machine: str
    points: int
    kinds: Mapping[str, Mean]
    tool: Mean


def kinds_of(study: Study, machine: int) -> dict[str, list[int]]:
    """Numbers of a machine's selected parameters, by their dimension; not of where instruments stand."""
    m, out = study.machines[machine], dict[str, list[int]]()
    frames = frame_parameters(m.model)
    for k, parameter in enumerate(m.index):
        if m.model.names[parameter] not in frames:
            out.setdefault(parse_unit(m.model.parameters[parameter].unit or "1").dimension.name, []).append(k)
    return out


def figures(study: Study, outcomes: Mapping[int, Sequence[Outcome]]) -> tuple[CaseFigures, ...]:
    """Of every machine and number of points."""
    return tuple(
        _case(study, machine, count, _errors(study, outcomes, machine, k))
        for machine in range(len(study.machines))
        for k, count in enumerate(study.counts)
    )


def differences(study: Study, outcomes: Mapping[int, Sequence[Outcome]]) -> tuple[Difference, ...]:
    """Of every machine but the first, by parameters that all have."""
    out = []
    for machine in range(1, len(study.machines)):
        for k, count in enumerate(study.counts):
            first, other = _errors(study, outcomes, 0, k), _errors(study, outcomes, machine, k)
            both = ~(np.isnan(first[:, -1]) | np.isnan(other[:, -1]))
            parts = [_common(study, m) for m in (0, machine)]
            kinds = {
                kind: Mean.of(other[both][:, parts[1][kind]].mean(axis=1) - first[both][:, columns].mean(axis=1))
                for kind, columns in parts[0].items()
            }
            tool = Mean.of(other[both, -1] - first[both, -1])
            out.append(Difference(machine=study.machines[machine].name, points=count, kinds=kinds, tool=tool))
    return tuple(out)


def _errors(study: Study, outcomes: Mapping[int, Sequence[Outcome]], machine: int, parameter: int) -> Array:
    """Absolute errors (n, p + 1) of parameters and tool point in all repetitions of a number of points; nan: failed."""
    width = len(study.machines[machine].selected) + 1
    numbers = range(parameter, len(outcomes), len(study.counts))
    rows = [outcomes[number][machine] or [np.nan] * width for number in numbers]
    errors: Array = np.abs(np.array(rows, dtype=float).reshape(-1, width))
    return errors


def _case(study: Study, machine: int, count: int, errors: Array) -> CaseFigures:
    good, m = errors[~np.isnan(errors[:, -1])], study.machines[machine]
    return CaseFigures(
        machine=m.name,
        points=count,
        count=len(good),
        failed=len(errors) - len(good),
        kinds={kind: Mean.of(good[:, columns].mean(axis=1)) for kind, columns in kinds_of(study, machine).items()},
        common={kind: Mean.of(good[:, columns].mean(axis=1)) for kind, columns in _common(study, machine).items()},
        parameters={name: Mean.of(good[:, k]) for k, name in enumerate(m.selected)},
        tool=Mean.of(good[:, -1]),
    )


def _common(study: Study, machine: int) -> dict[str, list[int]]:
    """As `kinds_of`, of parameters that all machines have; nothing of one machine alone."""
    if len(study.machines) == 1:
        return {}
    shared = set.intersection(*(set(m.selected) for m in study.machines))
    names = study.machines[machine].selected
    some = {kind: [k for k in columns if names[k] in shared] for kind, columns in kinds_of(study, machine).items()}
    return {kind: columns for kind, columns in some.items() if columns}

"""Command, geometry, stiffness and load stages: the coefficients of every row and their derivatives.

position = zero + gain * reading for drives that hold their position; a force for those that do not
(Ecorchard 2010, section 2).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from pkmcal_cli.base.rotation import Array
from pkmcal_cli.mechanism.topology import Index
from pkmcal_cli.model.model import Model
from pkmcal_cli.prediction.displacements import Displacements, displacements
from pkmcal_cli.prediction.rows import Request, Rows


@dataclass(frozen=True)
class BaseCoefficients:
    """Coefficients (K, S) by parameters, a line for each session of rows that has its own of these, else one."""

    lines: Array
    sessions: tuple[str, ...]

    @classmethod
    def of(cls, model: Model, values: Array, rows: Rows) -> BaseCoefficients:
        """At parameter values (P,), of some rows."""
        sessions = _sessions_apart(model, rows)
        lines = [model.topology.coefficients.values(numbers) for numbers in _by_session(model, values, sessions)]
        return cls(np.array(lines), sessions)

    def rows(self, rows: Rows) -> Array:
        """Coefficients (N, S) of rows, the row index running fastest."""
        out: Array = np.empty((len(rows), self.lines.shape[1]), order="F")
        out[:] = self.lines[0] if len(self.lines) == 1 else self.lines[rows.session_numbers(self.sessions)]
        return out

    @property
    def common(self) -> Array:
        """Coefficients (S,) of the mechanism: no session has its own of these."""
        return np.asarray(self.lines[0])


def commanded_coefficients(model: Model, given: BaseCoefficients, rows: Rows) -> Array:
    """Run the stages command, geometry, stiffness, load: coefficients (N, S) of rows from those of the parameters."""
    coefficients, base = given.rows(rows), given.common
    for a, (drive, actuator) in enumerate(zip(model.topology.drives, model.actuators, strict=True)):
        if drive.force_controlled:
            asked = rows.forces[:, a]
            force = np.where(np.isnan(asked), base[actuator.force_coefficient], asked)
            force = force + rows.columns.get(f"push.{drive.name}", 0.0)
            coefficients[:, drive.force_coefficient] += drive.force_sign * force
        else:
            coefficients[:, drive.coefficient] += base[actuator.gain_coefficient] * rows.readings[:, a]
    return coefficients


def drive_travels(model: Model, values: Array, readings: Array, rows: Rows) -> Array:
    """Compute the travel (N, A) of drives from reading zero at readings (N, A), with the effects on them, m or rad.

    Effects that need reactions are left out.
    """
    topology, table = model.topology, replace(rows, readings=np.nan_to_num(readings))
    base = topology.coefficients.values(model.by_name(values))
    gains = base[[a.gain_coefficient for a in model.actuators]]
    coefficients = np.tile(base, (len(table), 1))
    displacements(model, values, table, (), None).apply(coefficients)
    places = [drive.coefficient for drive in topology.drives]
    return np.asarray(readings * gains + coefficients[:, places] - base[places])


def _sessions_apart(model: Model, rows: Rows) -> tuple[str, ...]:
    """Sessions of rows that have coefficients of their own; what effects have for each acts on these later."""
    if not model.sessions:
        return ()
    formed = {name for _, formula in model.topology.coefficients.formulas for name in formula.names}
    apart = dict.fromkeys(p.session for p in model.parameters if p.session and p.shared_name in formed)
    return rows.sessions_among(tuple(apart))


def _by_session(model: Model, values: Array, sessions: Sequence[str]) -> tuple[Mapping[str, float], ...]:
    """Values (P,) as mappings, one for each of some sessions (one where there is none)."""
    every = dict(zip(model.names, np.asarray(values).tolist(), strict=True))
    local: dict[str, dict[str, float]] = {session: {} for session in sessions}
    for parameter in model.parameters:
        if parameter.session in local:
            local[parameter.session][parameter.shared_name] = every[parameter.name]
    return tuple({**every, **of_session} for of_session in local.values()) or (every,)


@dataclass(frozen=True)
class Chain:
    """Chain rule from coefficients to the parameters that are asked for, one line for each session of rows, else one.

    jacobian (K, U, V): of the coefficients that depend on them, by those parameters, of the P' asked for, that any
    depends on; without any where none is asked for.
    """

    model: Model
    sessions: tuple[str, ...]
    coefficients: Index  # (U,)
    parameters: Index  # (V,)
    jacobian: Array
    count: int | None  # P'; None where none is asked for

    @classmethod
    def of(cls, model: Model, values: Array, request: Request, rows: Rows) -> Chain:
        """The chain at parameter values (P,), of some rows."""
        nothing, sessions = np.zeros(0, dtype=np.intp), _sessions_apart(model, rows)
        if request.parameters is None:
            return cls(model, sessions, nothing, nothing, np.zeros((1, 0, 0)), None)
        asked = [model.shared.get(name, (name, "")) for name in request.parameters]
        names = list(dict.fromkeys(name for name, _ in asked))  # instances of one parameter share a column
        lines = _by_session(model, values, sessions)
        shared = np.stack([model.topology.coefficients.jacobian(numbers, names) for numbers in lines])  # (K, S, names)
        used, acting = np.nonzero(shared.any(axis=(0, 2)))[0], np.asarray(shared.any(axis=(0, 1)))
        column_of = {name: k for k, name in enumerate(names)}
        columns = np.array([column_of[name] for name, _ in asked], dtype=np.intp)
        parameters = np.nonzero(acting[columns])[0]
        acts = np.array([[asked[k][1] in ("", s) for k in parameters] for s in sessions or ("",)], dtype=float)
        jacobian = shared[:, used][..., columns[parameters]] * acts[:, None]
        return cls(model, sessions, used, parameters, jacobian, len(asked))

    def apply(
        self, rows: Rows, coefficients: Array, by_coefficient: Array, moved: Displacements
    ) -> tuple[Array | None, Array]:
        """Derivatives by coefficient (N, C, S) to those by parameter (N, C, P') and by drive (N, C, A).

        Effects and then the command stage add their share to `by_coefficient`.
        """
        jacobian = None if self.count is None else np.zeros((*by_coefficient.shape[:2], self.count))
        by_drive = np.zeros((*by_coefficient.shape[:2], len(self.model.actuators)))
        moved.chain(coefficients, by_coefficient, jacobian, by_drive)
        for a, (drive, actuator) in enumerate(zip(self.model.topology.drives, self.model.actuators, strict=True)):
            if drive.force_controlled:
                unstated = np.isnan(rows.forces[:, a])[:, None] * drive.force_sign  # by the machine, not by a column
                by_force = by_coefficient[..., drive.force_coefficient]
                by_drive[..., a] = drive.force_sign * by_force
                by_coefficient[..., actuator.force_coefficient] += unstated * by_force
            else:
                by_position, gain = by_coefficient[..., drive.coefficient], actuator.gain_coefficient
                by_drive[..., a] += by_position * coefficients[:, None, gain]
                by_coefficient[..., gain] += by_position * rows.readings[:, None, a]
        if jacobian is not None:
            lines = self.jacobian
            line = lines[0] if len(lines) == 1 else lines[rows.session_numbers(self.sessions)]
            jacobian[..., self.parameters] += by_coefficient[..., self.coefficients] @ line
        return jacobian, by_drive

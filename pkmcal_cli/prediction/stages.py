"""Command, geometry, stiffness and load stages: the coefficients of every row and their derivatives.

position = zero + gain * reading for drives that hold their position; a force for those that do not
(Ecorchard 2010, section 2).
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from pkmcal_cli.base.rotation import Array
from pkmcal_cli.mechanism.topology import Index
from pkmcal_cli.model.model import Model
from pkmcal_cli.prediction.displacements import Displacements, displacements
from pkmcal_cli.prediction.rows import Request, Rows


@dataclass(frozen=True)
class BaseCoefficients:
    """Coefficients (K, S) that parameters give, one line for each session that has parameters of its own, else one."""

    lines: Array
    sessions: tuple[str, ...]

    @classmethod
    def of(cls, model: Model, values: Array) -> BaseCoefficients:
        """At parameter values (P,)."""
        lines = [model.topology.coefficients.values(numbers) for numbers in model.by_session(values)]
        return cls(np.array(lines), model.sessions)

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


@dataclass(frozen=True)
class Chain:
    """Chain rule from coefficients to the parameters that are asked for."""

    model: Model
    coefficients: Index  # (U,) coefficients that depend on them
    jacobian: Array | None  # (K, U, P') d coefficients / d parameters, one per session; None where not asked for

    @classmethod
    def of(cls, model: Model, values: Array, request: Request) -> Chain:
        """The chain at parameter values (P,)."""
        if request.parameters is None:
            return cls(model, np.zeros(0, dtype=np.intp), None)
        asked = [model.shared[name] for name in request.parameters]
        parts = []
        for session, numbers in zip(model.sessions or ("",), model.by_session(values), strict=True):
            names = dict.fromkeys(name for name, _ in asked)  # instances of one parameter share a column
            column_of = {name: k for k, name in enumerate(names)}
            full = model.topology.coefficients.jacobian(numbers, list(names))[:, [column_of[name] for name, _ in asked]]
            parts.append(full * np.array([of_session in ("", session) for _, of_session in asked], dtype=float))
        every = np.stack(parts)
        used = np.nonzero(every.any(axis=(0, 2)))[0]
        return cls(model, used, every[:, used])

    def apply(
        self, rows: Rows, coefficients: Array, by_coefficient: Array, moved: Displacements
    ) -> tuple[Array | None, Array]:
        """Derivatives by coefficient (N, C, S) to those by parameter (N, C, P') and by drive reading (N, C, A).

        Effects and then the command stage add their share to `by_coefficient`.
        """
        jacobian = None if self.jacobian is None else np.zeros((*by_coefficient.shape[:2], self.jacobian.shape[2]))
        by_drive = np.zeros((*by_coefficient.shape[:2], len(self.model.actuators)))
        moved.chain(coefficients, by_coefficient, jacobian, by_drive)
        for a, (drive, actuator) in enumerate(zip(self.model.topology.drives, self.model.actuators, strict=True)):
            if drive.force_controlled:
                unstated = np.isnan(rows.forces[:, a])[:, None] * drive.force_sign  # by the machine, not by a column
                by_coefficient[..., actuator.force_coefficient] += (
                    unstated * by_coefficient[..., drive.force_coefficient]
                )
            else:
                by_position, gain = by_coefficient[..., drive.coefficient], actuator.gain_coefficient
                by_drive[..., a] += by_position * coefficients[:, None, gain]
                by_coefficient[..., gain] += by_position * rows.readings[:, None, a]
        if jacobian is not None and self.jacobian is not None:
            lines = self.jacobian
            if len(lines) == 1:
                jacobian += by_coefficient[..., self.coefficients] @ lines[0]
            else:
                jacobian += by_coefficient[..., self.coefficients] @ lines[rows.session_numbers(self.model.sessions)]
        return jacobian, by_drive

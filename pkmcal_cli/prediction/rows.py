"""Rows and requests go into a prediction; readings, derivatives and the status of rows come out.

z = f(p, q_i) of row i with parameters p and drive readings q_i, with dz/dp and dz/dq (Ecorchard 2010, eq. 20).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cache
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from pkmcal_cli.base.lean import some_rows
from pkmcal_cli.base.rotation import Array
from pkmcal_cli.equilibrium.kinematics import State
from pkmcal_cli.equilibrium.status import RowStatus, reason_of

Method = Literal["exact", "linear", "rigid"]

_SESSION = "session."  # columns of flags, by name


@dataclass(frozen=True)
class Rows:
    """Drive readings (N, A) in SI (m, rad) and forces (N, A) of force-controlled drives (nan: the machine's).

    columns (N,): covariates that effects need, by name: "time", "T", "T.PART", "dir.ACTUATOR" (-1, 0, 1), "payload",
    "spindle", "session.NAME" (1 in the rows of the session, else 0), "push.ACTUATOR" (N or N m that it pushes more than
    commanded). partner (N,): the row that a measurement joins to this one, -1 without. measured (N, C): what
    instruments read, nan where nothing: of the rotation vectors of one rotation, that nearer to it is predicted.
    unnamed: whether nobody named the session, whose name is then its file's.
    """

    readings: Array
    forces: Array
    columns: Mapping[str, Array] = field(default_factory=dict)
    partner: NDArray[np.intp] | None = None
    measured: Array | None = None
    unnamed: bool = False

    def __len__(self) -> int:
        return len(self.readings)

    def take(self, rows: slice | NDArray[np.intp]) -> Rows:
        """Some rows."""
        columns = {name: some_rows(column, rows) for name, column in self.columns.items()}
        measured = None if self.measured is None else self.measured[rows]
        forces, partners = some_rows(self.forces, rows), self._partners(rows)
        return Rows(self.readings[rows], forces, columns, partners, measured, self.unnamed)

    def _partners(self, rows: slice | NDArray[np.intp]) -> NDArray[np.intp] | None:
        """Partners among some rows, by their numbers there."""
        if self.partner is None:
            return None
        new_row = np.full(len(self) + 1, -1)  # the last entry answers for rows without partner
        new_row[np.arange(len(self))[rows]] = np.arange(len(self.readings[rows]))
        return np.asarray(new_row[self.partner[rows]])

    @property
    def session(self) -> NDArray[np.intp]:
        """Number (N,) of the session of each row, in the order of the columns; 0 without any."""
        return self.session_numbers(self.session_names)

    @property
    def session_names(self) -> tuple[str, ...]:
        """Sessions in the order of their columns."""
        return tuple(n.removeprefix(_SESSION) for n in self.columns if n.startswith(_SESSION))

    @property
    def named_sessions(self) -> tuple[str, ...]:
        """Those that a column or one of several files names: they have values of their own."""
        return () if self.unnamed else self.session_names

    def of_session(self, name: str) -> Rows:
        """The same as rows of one session."""
        columns = {**self.without_sessions().columns, f"{_SESSION}{name}": np.ones(len(self))}
        return replace(self, columns=columns, unnamed=False)

    def session_numbers(self, names: Sequence[str]) -> NDArray[np.intp]:
        """Which of some sessions each row belongs to, (N,); 0 for rows of none."""
        numbers = np.zeros(len(self), dtype=np.intp)
        for k, name in enumerate(names):
            if (flags := self.columns.get(f"{_SESSION}{name}")) is not None:
                numbers[flags > 0] = k
        return numbers

    def sessions_among(self, names: Sequence[str]) -> tuple[str, ...]:
        """Those of some sessions that rows belong to, by `session_numbers`."""
        return tuple(names[k] for k in np.unique(self.session_numbers(names)).tolist()) if names else ()

    def without_sessions(self) -> Rows:
        """The same as rows of one session without a name."""
        return replace(self, columns={n: c for n, c in self.columns.items() if not n.startswith(_SESSION)})

    def moved(self, shift: Array) -> Rows:
        """The same with the drive readings moved by `shift` (N, A)."""
        return replace(self, readings=self.readings + shift)

    @classmethod
    def at(cls, readings: Array) -> Rows:
        """Rows without force columns."""
        return cls(np.asarray(readings, dtype=float), np.full(np.shape(readings), np.nan))


def joined_rows(parts: Sequence[Rows]) -> Rows:
    """Join consecutive rows; a column that a part lacks is nan in its rows."""
    names = dict.fromkeys(name for part in parts for name in part.columns)
    starts = np.cumsum([0, *(len(part) for part in parts)])
    partners = [
        np.full(len(p), -1) if p.partner is None else np.where(p.partner < 0, -1, p.partner + start)
        for p, start in zip(parts, starts[:-1], strict=True)
    ]
    return Rows(
        np.concatenate([part.readings for part in parts]),
        np.concatenate([part.forces for part in parts]),
        {n: np.concatenate([part.columns.get(n, np.full(len(part), np.nan)) for part in parts]) for n in names},
        np.concatenate(partners) if any(p.partner is not None for p in parts) else None,
        unnamed=all(part.unnamed for part in parts),
    )


@dataclass(frozen=True)
class RopeStrains:
    """Elongations (N, R) of elastic ropes beyond the kink where they go slack, m; derivatives (N, R, P'), (N, R, A)."""

    values: Array
    jacobian: Array
    by_drive: Array


@cache
def _odd_weights(count: int) -> NDArray[np.uint64]:
    """So many odd numbers, the same each time."""
    return np.random.default_rng(0).integers(1, 2**63, count, dtype=np.uint64) * 2 + 1


@dataclass(frozen=True)
class Sought:
    """At which numbers of N rows a model was asked, and compared with its other assemblies, as `marks` (N,) of them.

    There it would answer the same, so nobody has to ask again; nor a copy of it in another process.
    """

    model: bytes  # its own mark
    marks: NDArray[np.uint64]

    @classmethod
    def at(cls, model: bytes, coefficients: Array) -> Sought:
        """Marks of coefficients (N, S): their bits, mixed and summed with odd weights modulo 2^64.

        Whatever one of them changes by shows, however small it is beside the others, and it does not matter which rows
        are asked together.
        """
        bits = np.ascontiguousarray(coefficients).view(np.uint64)
        return cls(model, ((bits ^ (bits >> np.uint64(32))) * _odd_weights(bits.shape[1])).sum(axis=1))

    def answers(self, other: Sought) -> bool:
        """Whether all rows of another one are the same."""
        return self.model == other.model and bool((self.marks == other.marks).all())


@dataclass(frozen=True)
class WarmStart:
    """States of N rows from an earlier prediction, and what became of them there.

    misfit (N,): how far the drives' positions disagreed when the pose was compared with all others, or was seen to be
    too far from singular ones for another to be near, in sizes of the machine; 0 where it was neither. slack (N,): rows
    in which a rope was slack, where that is known; sought: at which numbers, where they were compared with others.
    """

    state: State
    status: NDArray[np.int_]
    misfit: Array
    slack: NDArray[np.bool_] | None = None
    sought: Sought | None = None

    def take(self, rows: slice | NDArray[np.intp]) -> WarmStart:
        """Some rows."""
        slack = None if self.slack is None else some_rows(self.slack, rows)
        at = None if self.sought is None else replace(self.sought, marks=self.sought.marks[rows])
        return WarmStart(self.state.take(rows), some_rows(self.status, rows), some_rows(self.misfit, rows), slack, at)

    def renewed(self) -> WarmStart:
        """The same where no row is known to be out of reach: those without a solution are looked for again."""
        return replace(self, misfit=np.where(self.status == RowStatus.SOLVED, self.misfit, 0.0))

    def hopeless(self, misfit: float) -> WarmStart | None:
        """What is known of rows whose drives disagree by more, in sizes of the machine; nothing of the others.

        No values of the parameters bring such a row back, and to look for one is dear. None where there is none.
        """
        lost = (self.status != RowStatus.SOLVED) & (self.misfit > misfit)
        if not lost.any():
            return None
        status = np.where(lost, self.status, RowStatus.NOT_CONVERGED)
        return replace(self, status=status, misfit=np.where(lost, self.misfit, 0.0), sought=None)

    def put(self, rows: NDArray[np.intp], other: WarmStart) -> WarmStart:
        """These with some rows taken from `other`."""
        status, misfit = self.status.copy(), self.misfit.copy()
        status[rows], misfit[rows] = other.status, other.misfit
        return WarmStart(self.state.put(rows, other.state), status, misfit)


@dataclass(frozen=True, kw_only=True)
class Prediction:
    """Predicted readings (N, C), nan where `status` (N,) is not SOLVED.

    jacobian: (N, C, P') with respect to the asked parameters; by_drive: (N, C, A) with respect to drive readings, and
    to the forces of force-controlled drives; by_partner: (N, C, A) those of the row that is joined; forces: (N, A) of
    drives, N or N m; energy: (N,) strain energy, J; tension: (N, R) of ropes with a least tension, N; slack: names of
    slack ropes by row; misfit, sought: as in `WarmStart`.
    """

    values: Array
    status: NDArray[np.int_]
    state: State
    jacobian: Array | None
    by_drive: Array | None
    forces: Array | None
    energy: Array | None
    tension: Array | None
    slack: dict[int, tuple[str, ...]]
    misfit: Array
    steps: int
    ropes: RopeStrains | None = None
    by_partner: Array | None = None
    sought: Sought | None = None

    @property
    def start(self) -> WarmStart:
        """Where a prediction of the same rows may start."""
        slack = np.zeros(len(self.status), dtype=bool)
        slack[list(self.slack)] = True
        return WarmStart(self.state, self.status, self.misfit, slack, self.sought)

    @property
    def solved(self) -> NDArray[np.bool_]:
        """Rows with numbers."""
        return np.asarray(self.status == RowStatus.SOLVED)

    def reason(self, row: int) -> str:
        """Why a row has no numbers."""
        return reason_of(int(self.status[row]))


class RowLost(Exception):
    """A row has no prediction in which something was measured."""


@dataclass(frozen=True, kw_only=True)
class Request:
    """What a prediction should bring besides the readings."""

    method: Method = "exact"
    parameters: tuple[str, ...] | None = None  # derivatives with respect to these
    by_drive: bool = False
    forces: bool = False
    compare: bool = True  # whether poses in doubt are compared with all others; False: quick, for screening
    ropes: bool = False  # how far ropes are from going slack; only with `parameters`
    sparing: bool = False  # whether rows are of no use if one in which something was measured has no prediction

    @property
    def derivatives(self) -> bool:
        """Whether any derivative is asked for."""
        return self.parameters is not None or self.by_drive

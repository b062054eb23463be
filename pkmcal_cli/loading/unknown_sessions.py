"""Sessions of which a parameter file says nothing: zeros of drives are nominal there, and uncertain by their ranges."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Sequence
from dataclasses import dataclass

import numpy as np

from pkmcal_cli.base.plural import listed
from pkmcal_cli.base.rotation import Array
from pkmcal_cli.model.model import Model
from pkmcal_cli.model.parts import ModelParameter

Covariance = tuple[tuple[str, ...], Array]
"""Names and their covariance (p, p), SI."""
_LISTED = 6


@dataclass(frozen=True)
class UnknownSessions:
    """Zeros of drives, by name, of which a file says nothing; sessions that it knows; whether it has other values of
    them that no session is named with."""

    zeros: tuple[str, ...]
    known: tuple[str, ...]
    nameless: bool

    def warning(self, path: str, named: bool, fitted: Collection[str]) -> list[str]:
        """What is to be said where results depend on them; `named`: whether the rows name their sessions; fitted: those
        that the command determines itself."""
        zeros = [name for name in self.zeros if name not in fitted]
        if not zeros:
            return []
        names = listed(zeros, _LISTED)
        where = "" if named else ", as no session is named"
        ways = [f"name a session that it knows ({', '.join(self.known)})"] if self.known else []
        ways += ["leave out the column `session` if it is that of the file, which has no name"] * self.nameless
        ways.append("measure a few poses in this session and calibrate with them")
        return [
            f"warning: {path}: zeros of drives not known{where}: {names}: nominal, and uncertain by their ranges; "
            + ", or ".join(ways)
        ]


NOTHING_UNKNOWN = UnknownSessions((), (), nameless=False)


def unknown_sessions(model: Model, values: Collection[str], others: Sequence[str]) -> UnknownSessions:
    """What a file does not say that has some values, by name, and `others` of sessions that are not here."""
    each = [p for p in model.parameters if p.session or p.per_session]
    lacking = [p for p in each if not p.fixed and p.name not in values]
    named = (_session(n) for n in (*(p.name for p in each if p.name in values), *others))
    return UnknownSessions(
        zeros=_of_drives(model, lacking),
        known=tuple(dict.fromkeys(filter(None, named))),
        nameless=any(not _session(n) for n in others),
    )


def with_ranges(model: Model, covariance: Covariance, names: Iterable[str]) -> Covariance:
    """A covariance with further parameters that are known by half their ranges alone."""
    known, matrix = covariance
    more = tuple(n for n in names if n not in known)
    half = 0.5 * model.ranges[[model.names.index(n) for n in more]]
    out = np.zeros((len(known) + len(more),) * 2)
    out[: len(known), : len(known)] = matrix
    out[len(known) :, len(known) :] = np.diag(half**2)
    return (*known, *more), out


def _session(name: str) -> str:
    """The session in the name of a parameter, "" without one."""
    return name.partition("[")[2].removesuffix("]")


def _of_drives(model: Model, parameters: Sequence[ModelParameter]) -> tuple[str, ...]:
    """Names of those that move the positions of drives."""
    places = [d.coefficient for d in model.topology.drives if not d.force_controlled]
    shared = tuple(dict.fromkeys(p.shared_name for p in parameters))
    moves = model.topology.coefficients.jacobian(model.by_name(model.nominal), shared)[places]
    acting = {name for name, column in zip(shared, moves.T, strict=True) if column.any()}
    return tuple(p.name for p in parameters if p.shared_name in acting)

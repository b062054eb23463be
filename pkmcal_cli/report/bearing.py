"""What drives and ropes bear at corrected commands: largest forces, least tensions, ropes that are hardly taut."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pkmcal_cli.base.plural import count
from pkmcal_cli.base.rotation import Array
from pkmcal_cli.correction.assessment import Assessment
from pkmcal_cli.model.model import Model
from pkmcal_cli.model.tool_channels import ropes_of
from pkmcal_cli.report.console import Reporter
from pkmcal_cli.report.correction_figures import NOTHING, exact, largest, mean, shown
from pkmcal_cli.report.number_format import finite, handy, three_digits
from pkmcal_cli.units.unit_text import Unit, parse_unit

_NO_ENERGY = 1e-12  # J that are rounding
_HARDLY_TAUT = 0.02
"""Of the largest tension at the same command: by so much models are off, so that such a rope may as well be slack."""
_PROPOSED = 0.05
_NO_FORCE = 1e-9  # N or N m
_LISTED = 8


@dataclass(frozen=True, kw_only=True)
class Bearing:
    """Of the targets that have set values; redundant: set values of some drives are a choice."""

    model: Model
    result: Assessment
    redundant: bool

    # --- drives ----------------------------------------------------------------------------------
    @cached_property
    def _forces(self) -> dict[str, Array]:
        """Largest forces (A,) by what they are."""
        made = self.result.correction
        internal = made.internal.part(np.nan_to_num(made.after.force))
        u = np.full(internal.shape, np.nan) if self.result.after is None else self.result.after.force
        parts = {"before": made.before.force, "after": made.after.force, "load": made.after.force - internal}
        parts |= {"internal": internal, "u": u}
        return {n: np.array([largest(column) for column in np.abs(f[made.good]).T]) for n, f in parts.items()}

    @property
    def _energy(self) -> dict[str, float]:
        made = self.result.correction
        energies = {"before": made.before.energy, "after": made.after.energy}
        return {n: mean(e[made.good]) for n, e in energies.items()}

    def _unit(self, actuator: int) -> Unit:
        length = self.model.topology.moves_length(self.model.topology.drives[actuator])
        return parse_unit("N" if length else "N m")

    # --- ropes -----------------------------------------------------------------------------------
    @cached_property
    def _names(self) -> list[str]:
        return [name for _, _, name in ropes_of(self.model)]

    @cached_property
    def _stated(self) -> Array:
        """`t_min` of every cable (R,), N; nan without one."""
        least = [
            [t.tension / t.weight for t in self.model.least_tensions if t.member == (g, e)]
            for g, e, _ in ropes_of(self.model)
        ]
        return np.array([max(some, default=np.nan) for some in least])

    @cached_property
    def _tensions(self) -> tuple[Array, Array]:
        """Before and after (n, R)."""
        made = self.result.correction
        return made.before.tension[made.good], made.after.tension[made.good]

    @cached_property
    def _hardly_taut(self) -> NDArray[np.bool_]:
        """Which ropes (n, R) without `t_min` have hardly a tension, where drives could give them one."""
        after = self._tensions[1]
        most = after.max(axis=1, initial=0.0, keepdims=True)
        slack = (after <= _HARDLY_TAUT * most) | ~self._strained[:, None]
        return np.asarray(slack & np.isnan(self._stated) & self.redundant)

    @property
    def _strained(self) -> NDArray[np.bool_]:
        """At which targets (n,) tensions are more than rounding."""
        made = self.result.correction
        return np.asarray(made.after.energy[made.good] > _NO_ENERGY)

    # --- texts -----------------------------------------------------------------------------------
    def show(self, to: Reporter) -> None:
        """Tables of forces and tensions, and the strain energy; nothing where no drive bears anything, nor could."""
        most = max(float(np.nanmax(self._forces[n], initial=0.0)) for n in ("before", "after"))
        if not self.redundant and not self._names and most < _NO_FORCE:
            return
        rows = []
        for a, actuator in enumerate(self.model.actuators):
            unit = self._unit(a)
            limit = shown(actuator.force_limit, unit) if np.isfinite(actuator.force_limit) else NOTHING
            rows.append((actuator.name, *(shown(f[a], unit) for f in self._forces.values()), limit))
        head = ("drive", *self._forces, "limit")
        to.table("Largest forces of the drives; after = load + internal", head, rows)
        if self._names:
            newton, (before, after) = parse_unit("N"), self._tensions
            columns = (_least(before), _least(after), self._stated)
            tensions = [(name, *(shown(c[k], newton) for c in columns)) for k, name in enumerate(self._names)]
            to.table("Least tensions of the ropes", ("rope", "before", "after", "t_min"), tensions)
        energy = {n: 0.0 if e < _NO_ENERGY else e for n, e in self._energy.items()}
        to.say(f"strain energy (mean): {', '.join(f'{three_digits(e)} J {n}' for n, e in energy.items())}")

    def warn(self, to: Reporter) -> None:
        """Ropes that are slack, or nearly so, at commands."""
        rows = int(self._hardly_taut.any(axis=1).sum())
        if rows:
            named = [(int(n), name) for n, name in zip(self._hardly_taut.sum(axis=0), self._names, strict=True) if n]
            names = ", ".join(f"{name} {n}" for n, name in named[:_LISTED])
            names += f" and {len(named) - _LISTED} more" if len(named) > _LISTED else ""
            most = self._tensions[1][self._strained].max(initial=0.0)
            least = handy(float(f"{_PROPOSED * most:.1g}"), parse_unit("N")) if most else "10 N"
            bounds = f"slack, or tension below {100 * _HARDLY_TAUT:g} % of the largest"
            remedy = f"state what they need in the machine file, e.g. `ropes: {{{named[0][1]}: {{t_min: {least}}}}}`"
            keeping = "`--redundant min-force` and `min-energy` keep it"
            total = count(len(self._hardly_taut), "target")
            to.warn(f"warning: ropes hardly taut: {rows} of {total} ({bounds}): {names}; {remedy}; {keeping}")

    # --- JSON ------------------------------------------------------------------------------------
    @staticmethod
    def json_of(bearing: Bearing | None) -> dict[str, Any]:
        """The same for JSON; forces in N or N m; None: of no target."""
        if bearing is None:
            return {"drives": [], "ropes": [], "hardly_taut": 0, "strain_energy": None}
        return {
            "drives": bearing._drives_json(),
            "ropes": bearing._ropes_json(),
            "hardly_taut": int(bearing._hardly_taut.any(axis=1).sum()),
            "strain_energy": {n: exact(e, _NO_ENERGY) for n, e in bearing._energy.items()},
        }

    def _drives_json(self) -> list[dict[str, Any]]:
        return [
            {"name": actuator.name}
            | {n: exact(float(f[a])) for n, f in self._forces.items()}
            | {"limit": finite(actuator.force_limit), "unit": self._unit(a).text}
            for a, actuator in enumerate(self.model.actuators)
        ]

    def _ropes_json(self) -> list[dict[str, Any]]:
        before, after = (_least(t) for t in self._tensions)
        return [
            {"name": name, "before": exact(before[k]), "after": exact(after[k]), "t_min": finite(self._stated[k])}
            | {"hardly_taut": int(self._hardly_taut[:, k].sum())}
            for k, name in enumerate(self._names)
        ]


def _least(tensions: Array) -> Array:
    """Least (R,) of tensions (n, R) that are numbers."""
    return np.array([-largest(-column) for column in tensions.T])

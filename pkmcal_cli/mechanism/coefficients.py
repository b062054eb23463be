"""Coefficients c: the flat vector of everything that a parameter or an effect can set in the engine, one line a row.

Every length, offset, guide angle, stiffness, force ... of the compiled machine is one coefficient (SI units), a formula
c = c(xi) of the parameters; a stage of the prediction may give each row its own value. The engine differentiates with
respect to c only, and dz/dxi = dz/dc dc/dxi: a new kind of parameter or effect needs no derivative of its own.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from pkmcal_cli.base.rotation import Array

_STEP = 1e-40  # imaginary step; formulas are analytic, so the derivative is exact at any small step


@dataclass(frozen=True)
class Formula:
    """A coefficient's value as a function of parameters (SI in, SI out), safe for complex arguments."""

    names: tuple[str, ...]
    function: Callable[[Mapping[str, complex]], complex]


@dataclass(frozen=True)
class _Shifted:
    """A constant that a parameter shifts, with a factor."""

    constant: float
    factor: float
    name: str

    def __call__(self, parameters: Mapping[str, complex]) -> complex:
        return self.constant + self.factor * parameters[self.name]


@dataclass(frozen=True)
class CoefficientTable:
    """All coefficients of a model: constants, and formulas for those that depend on parameters."""

    constants: Array  # (S,) value of each coefficient at nominal parameters
    formulas: tuple[tuple[int, Formula], ...]
    labels: tuple[str, ...]  # (S,) what each coefficient is, for messages

    def values(self, parameters: Mapping[str, float]) -> Array:
        """Coefficient values (S,) at the given parameters."""
        out = self.constants.copy()
        for index, formula in self.formulas:
            out[index] = np.real(formula.function(parameters))
        return out

    def jacobian(self, parameters: Mapping[str, float], names: Sequence[str]) -> Array:
        """d coefficients / d parameters, (S, len(names)), by complex step through the formulas."""
        out = np.zeros((len(self.constants), len(names)))
        column, stepped = {name: j for j, name in enumerate(names)}, dict[str, complex](parameters)
        for index, formula in self.formulas:
            for name in formula.names:
                if name in column:
                    stepped[name] = parameters[name] + 1j * _STEP
                    out[index, column[name]] = np.imag(formula.function(stepped)) / _STEP
                    stepped[name] = parameters[name]
        return out

    def shifted(self, name: str, shifts: Sequence[tuple[int, float]]) -> CoefficientTable:
        """The table in which a parameter shifts constants: their numbers, with factors."""
        more = [(k, Formula((name,), _Shifted(float(self.constants[k]), factor, name))) for k, factor in shifts]
        return replace(self, formulas=(*self.formulas, *more))

"""The 27 nonlinear regressions of NIST StRD: their formulas, and a reader of their files in `tests/data/nist/`."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy import arctan, cos, exp, sin

from pkmcal_cli.base.rotation import Array

FOLDER = Path(__file__).resolve().parents[1] / "data" / "nist"
Formula = Callable[[Array, Array], Array]
"""Parameters (p,), perhaps complex, and predictors (N,) or (k, N) to responses (N,)."""


def _rational(b: Array, x: Array, top: int) -> Array:
    """Polynomials: `top` coefficients above, 1 and the others below."""
    above = sum(b[k] * x**k for k in range(top))
    below = 1.0 + sum(b[top + k] * x ** (k + 1) for k in range(len(b) - top))
    return np.asarray(above / below)


def _gauss(b: Array, x: Array) -> Array:
    peaks = (b[k] * exp(-((x - b[k + 1]) ** 2) / b[k + 2] ** 2) for k in (2, 5))
    return np.asarray(b[0] * exp(-b[1] * x) + sum(peaks))


def _enso(b: Array, x: Array) -> Array:
    out = b[0] + b[1] * cos(2 * np.pi * x / 12) + b[2] * sin(2 * np.pi * x / 12)
    for k in (3, 6):
        out = out + b[k + 1] * cos(2 * np.pi * x / b[k]) + b[k + 2] * sin(2 * np.pi * x / b[k])
    return np.asarray(out)


def _lanczos(b: Array, x: Array) -> Array:
    return np.asarray(sum(b[k] * exp(-b[k + 1] * x) for k in (0, 2, 4)))


def _chwirut(b: Array, x: Array) -> Array:
    return np.asarray(exp(-b[0] * x) / (b[1] + b[2] * x))


FORMULAS: dict[str, Formula] = {
    "Bennett5": lambda b, x: b[0] * (b[1] + x) ** (-1 / b[2]),
    "BoxBOD": lambda b, x: b[0] * (1 - exp(-b[1] * x)),
    "Chwirut1": _chwirut,
    "Chwirut2": _chwirut,
    "DanWood": lambda b, x: b[0] * x ** b[1],
    "ENSO": _enso,
    "Eckerle4": lambda b, x: b[0] / b[1] * exp(-0.5 * ((x - b[2]) / b[1]) ** 2),
    "Gauss1": _gauss,
    "Gauss2": _gauss,
    "Gauss3": _gauss,
    "Hahn1": lambda b, x: _rational(b, x, 4),
    "Kirby2": lambda b, x: _rational(b, x, 3),
    "Lanczos1": _lanczos,
    "Lanczos2": _lanczos,
    "Lanczos3": _lanczos,
    "MGH09": lambda b, x: b[0] * (x**2 + b[1] * x) / (x**2 + b[2] * x + b[3]),
    "MGH10": lambda b, x: b[0] * exp(b[1] / (x + b[2])),
    "MGH17": lambda b, x: b[0] + b[1] * exp(-b[3] * x) + b[2] * exp(-b[4] * x),
    "Misra1a": lambda b, x: b[0] * (1 - exp(-b[1] * x)),
    "Misra1b": lambda b, x: b[0] * (1 - (1 + b[1] * x / 2) ** -2),
    "Misra1c": lambda b, x: b[0] * (1 - (1 + 2 * b[1] * x) ** -0.5),
    "Misra1d": lambda b, x: b[0] * b[1] * x / (1 + b[1] * x),
    "Nelson": lambda b, x: b[0] - b[1] * x[0] * exp(-b[2] * x[1]),  # of the response's logarithm
    "Rat42": lambda b, x: b[0] / (1 + exp(b[1] - b[2] * x)),
    "Rat43": lambda b, x: b[0] / (1 + exp(b[1] - b[2] * x)) ** (1 / b[3]),
    "Roszman1": lambda b, x: b[0] - b[1] * x - arctan(b[2] / (x - b[3])) / np.pi,
    "Thurber": lambda b, x: _rational(b, x, 4),
}


@dataclass(frozen=True, kw_only=True)
class DataSet:
    """Predictors (N,) or (k, N), responses (N,), two starts (2, p), certified values and their uncertainties (p,)."""

    name: str
    x: Array
    y: Array
    starts: Array
    certified: Array
    uncertainty: Array
    squares: float
    deviation: float

    @classmethod
    def read(cls, name: str) -> DataSet:
        """From its file: values stand in lines `b1 = ...` from line 41 on, data from line 61 on."""
        lines = (FOLDER / f"{name}.dat").read_text(encoding="ascii").splitlines()
        rows = [line.partition("=")[2].split() for line in lines[40:60] if line.strip().startswith("b")]
        values = np.array(rows, dtype=float)  # start 1, start 2, certified, its uncertainty
        numbers = {k.strip(): v for k, _, v in (line.partition(":") for line in lines[40:60])}
        data = np.array([line.split() for line in lines[60:] if line.strip()], dtype=float)
        y, x = data[:, 0], data[:, 1:].T
        return cls(
            name=name,
            x=x if len(x) > 1 else x[0],
            y=np.log(y) if name == "Nelson" else y,
            starts=values[:, :2].T,
            certified=values[:, 2],
            uncertainty=values[:, 3],
            squares=float(numbers["Residual Sum of Squares"]),
            deviation=float(numbers["Residual Standard Deviation"]),
        )

    def predicted(self, b: Array) -> tuple[Array, Array]:
        """Responses (N,) and exact derivatives (N, p) by a complex step."""
        step = 1e-30 * np.maximum(np.abs(b), 1e-30)
        formula = FORMULAS[self.name]
        with np.errstate(all="ignore"):
            columns = [formula(b + 1j * h * np.eye(len(b))[k], self.x).imag / h for k, h in enumerate(step)]
            return np.asarray(formula(b, self.x)), np.stack(columns, axis=1)

    def digits(self, b: Array) -> float:
        """Digits that agree with the certified values, of the parameter that agrees least; at most 11."""
        off = np.abs(b - self.certified) / np.abs(self.certified)
        return float(np.clip(-np.log10(np.maximum(off, 1e-11)), 0.0, 11.0).min())

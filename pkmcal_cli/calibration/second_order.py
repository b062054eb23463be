"""What second derivatives add to a fit's linear problem, where that promises too much: by secants along its steps.

Where residuals are large beside what a parameter does (a time constant that the data hardly show), Gauss-Newton steps
overshoot and oscillate. The secant update of NL2SOL (Dennis, Gay and Welsch 1981) estimates the second-order part S of
the Hessian J^T J + S from Jacobians that are known anyway. Only its positive part is used, which shortens steps, and
not after steps whose gain the linear problem has foretold clearly better.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from pkmcal_cli.base.rotation import Array

_LEAST = 1e-6  # of an eigenvalue, beside the largest
_KEPT = 1.5  # times worse that it may foretell a gain before the linear problem does alone again (NL2SOL)


@dataclass(frozen=True)
class SecondOrder:
    """S (p, p) in ranges, None as long as no step asked for it; `positive` (k, p): rows R, R^T R its positive part.

    used: whether it foretells gains hardly worse than the linear problem alone; last: step (p,) that was taken, with
    whitened Jacobian (m, p) and residual (m,) before it.
    """

    matrix: Array | None = None
    positive: Array | None = None
    used: bool = True
    last: tuple[Array, Array, Array] | None = None

    def at(self, jacobian: Array, residual: Array) -> SecondOrder:
        """Where the last step has led to."""
        if self.last is None:
            return self
        step, before, residual_before = self.last
        if before.shape != jacobian.shape:  # rows were lost or came back
            return replace(self, last=None)
        changed = before.T @ residual - jacobian.T @ residual  # S times the step
        gradient = before.T @ residual_before - jacobian.T @ residual
        curved = float(step @ gradient)
        if curved <= 0.0:
            return replace(self, last=None)
        matrix = np.zeros((len(step), len(step))) if self.matrix is None else _sized(self.matrix, step, changed)
        off = changed - matrix @ step
        matrix = matrix + (np.outer(off, gradient) + np.outer(gradient, off)) / curved
        matrix -= float(off @ step) * np.outer(gradient, gradient) / curved**2
        return SecondOrder(matrix, _positive(matrix), self.used)

    def after(self, step: Array, jacobian: Array, residual: Array, gained: float, linear: float) -> SecondOrder:
        """After a step (p,) from where whitened Jacobian (m, p) and residual (m,) are these; `linear`: the gain in
        chi-square that the linear problem promised."""
        added = 0.0 if self.positive is None else _squared(self.positive, step)
        used = self.positive is None or abs(gained - linear + added) < _KEPT * abs(gained - linear)
        return replace(self, used=used, last=(step, jacobian, residual))

    @property
    def rows(self) -> Array | None:
        """Further equations (k, p), of right side 0, of the linear problem; None where there are none."""
        return self.positive if self.used else None

    def added(self, step: Array) -> float:
        """What these add to chi-square along a step (p,) in ranges."""
        return 0.0 if self.rows is None else _squared(self.rows, step)


def _squared(rows: Array, step: Array) -> float:
    return float(np.square(rows @ step).sum())


def _sized(matrix: Array, step: Array, changed: Array) -> Array:
    """The matrix (p, p), smaller where it says more than the last step (p,) shows."""
    said = abs(float(step @ matrix @ step))
    return matrix * min(1.0, abs(float(step @ changed)) / said) if said > 0.0 else matrix


def _positive(matrix: Array) -> Array:
    """Rows (k, p) whose squares are the positive part of a symmetric matrix (p, p)."""
    values, vectors = np.linalg.eigh(matrix)
    kept = values > _LEAST * np.abs(values).max(initial=0.0)
    return np.asarray((vectors[:, kept] * np.sqrt(values[kept])).T)

"""What the rows of a calibration say of all parameters, without ranges, datum and selection: part of parameter files.

Chi-square of the rows is |root z - right|^2 + left, z being offsets from the identified values in `scale` (data
equations of a square-root information filter; Bierman 1977): it depends on nothing that was held, chosen or known.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from pkmcal_cli.base.rotation import Array

DATA = "data"
"""Section of a parameter file."""
_KEYS = ("names", "scale", "root", "right", "left", "count", "worth")


@dataclass(frozen=True, kw_only=True)
class DataInformation:
    """root (k, q) and right (k,) by q parameters `names` in `scale` (q,), SI: half ranges as they turned out.

    left: least chi-square with all of them free; count: number of measured values; worth: degrees of freedom that the
    stated sigma is worth, inf where it is exact.
    """

    names: tuple[str, ...]
    scale: Array
    root: Array
    right: Array
    left: float
    count: int
    worth: float

    def lines(self, units: Sequence[float]) -> list[str]:
        """As a section of a parameter file; units (q,): of the parameters, SI."""
        from pkmcal_cli.loading.parameter_text import scalar

        shown = [f"{v:.12g}" for v in self.scale / np.asarray(units)]
        out = [f"{DATA}: # of the rows alone: chi-square = |root z - right|^2 + left, z = (true - value) / scale"]
        out.append(f"  names: [{', '.join(scalar(n) for n in self.names)}]")
        out.append(f"  scale: [{', '.join(_real(v) for v in shown)}]")
        out.append("  root: # upper triangle, each row from its diagonal on")
        out += [f"    - [{', '.join(_real(f'{v:.12g}') for v in row[k:])}]" for k, row in enumerate(self.root)]
        out.append(f"  right: [{', '.join(_real(f'{v:.12g}') for v in self.right)}]")
        worth = "null" if np.isinf(self.worth) else _real(f"{self.worth:.12g}")
        return [*out, f"  left: {_real(f'{self.left:.12g}')}", f"  count: {self.count}", f"  worth: {worth}"]


def _real(text: str) -> str:
    """A number that every YAML reader takes for one."""
    return text.replace("e", ".0e") if "e" in text and "." not in text else text


def read_data(plain: object, units: dict[str, float]) -> DataInformation | None:
    """The section of a parameter file as plain data; units: of parameters, SI, by name. None where it is not whole."""
    if not isinstance(plain, dict) or not set(_KEYS) <= plain.keys():
        return None
    try:
        names = tuple(str(n) for n in plain["names"])
        scale = np.array(plain["scale"], dtype=float) * [units[n] for n in names]
        root = np.zeros((len(plain["root"]), len(names)))
        for k, row in enumerate(plain["root"]):
            root[k, k:] = np.array(row, dtype=float)
        right = np.array(plain["right"], dtype=float)
        left, count = float(plain["left"]), int(plain["count"])
        worth = np.inf if plain["worth"] is None else float(plain["worth"])
    except (KeyError, TypeError, ValueError, IndexError):
        return None
    good = np.isfinite(root).all() and np.isfinite(right).all() and np.isfinite(left) and left >= 0 and worth > 0
    if not good or scale.shape != (len(names),) or not (np.isfinite(scale) & (scale > 0)).all():
        return None
    if right.shape != (len(root),) or len(set(names)) < len(names) or count < 0:
        return None
    return DataInformation(names=names, scale=scale, root=root, right=right, left=left, count=count, worth=worth)

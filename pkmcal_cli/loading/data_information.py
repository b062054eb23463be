"""What the rows of a calibration say of all parameters, without ranges, datum and selection: part of parameter files.

Chi-square of the rows is |root z - right|^2 + left, z being offsets from the identified values in `scale` (data
equations of a square-root information filter; Bierman 1977): it depends on nothing that was held, chosen or known.
A check over its numbers, the identified values and their units tells whether these still belong together.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from pkmcal_cli.base.rotation import Array

DATA = "data"
"""Section of a parameter file."""
_KEYS = ("names", "scale", "root", "right", "left", "count", "worth")
_CHECK, _DIGITS = "check", 16  # of a SHA-256
Values = Mapping[str, tuple[Any, str]]
"""Number and unit of each parameter, as a parameter file has them."""


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

    def lines(self, units: Sequence[float], values: Values) -> list[str]:
        """As a section of a parameter file; units (q,): of the parameters, SI; values: as the file has them."""
        from pkmcal_cli.loading.parameter_text import scalar

        plain = self._plain(units)
        out = [f"{DATA}: # of the rows alone: chi-square = |root z - right|^2 + left, z = (true - value) / scale"]
        out.append(f"  names: [{', '.join(scalar(n) for n in self.names)}]")
        out.append(f"  scale: {_listed(plain['scale'])}")
        out.append("  root: # upper triangle, each row from its diagonal on")
        out += [f"    - {_listed(row)}" for row in plain["root"]]
        out.append(f"  right: {_listed(plain['right'])}")
        worth = "null" if plain["worth"] is None else _real(plain["worth"])
        out += [f"  left: {_real(plain['left'])}", f"  count: {self.count}", f"  worth: {worth}"]
        check = _check(plain, values)  # in quotes: digits with an `e` would be a number
        return [*out, f'  {_CHECK}: "{check}" # of the numbers above and the values of these parameters']

    def _plain(self, units: Sequence[float]) -> dict[str, Any]:
        """The section as plain data with the digits that are written."""
        return {
            "names": list(self.names),
            "scale": _rounded(self.scale / np.asarray(units)),
            "root": [_rounded(row[k:]) for k, row in enumerate(self.root)],
            "right": _rounded(self.right),
            "left": _rounded([self.left])[0],
            "count": self.count,
            "worth": None if np.isinf(self.worth) else _rounded([self.worth])[0],
        }


def _check(plain: Mapping[str, Any], values: Values) -> str:
    """Of a section and of values, from numbers as they are written and read, however they are formatted."""

    def numbers(part: Any) -> Any:
        return [numbers(p) for p in part] if isinstance(part, list | tuple) else None if part is None else float(part)

    names = [str(n) for n in plain["names"]]
    content = [names, *(numbers(plain[k]) for k in _KEYS[1:]), [(float(values[n][0]), values[n][1]) for n in names]]
    return hashlib.sha256(json.dumps(content).encode()).hexdigest()[:_DIGITS]


def _rounded(numbers: Sequence[float] | Array) -> list[float]:
    return [float(f"{v:.12g}") for v in numbers]


def _listed(numbers: Sequence[float]) -> str:
    return f"[{', '.join(map(_real, numbers))}]"


def _real(value: float) -> str:
    """A number that every YAML reader takes for one."""
    text = f"{value:.12g}"
    return text.replace("e", ".0e") if "e" in text and "." not in text else text


def read_data(plain: object, units: Mapping[str, float], values: Values) -> DataInformation | None:
    """The section of a parameter file as plain data; units: of parameters, SI; values: as the file has them.

    None where it is not whole, or is not what was written with these values.
    """
    if not isinstance(plain, dict) or not set(_KEYS) <= plain.keys():
        return None
    try:
        unchanged = plain.get(_CHECK) == _check(plain, values)
        names = tuple(str(n) for n in plain["names"])
        scale = np.array(plain["scale"], dtype=float) * [units[n] for n in names]
        root = np.zeros((len(plain["root"]), len(names)))
        for k, row in enumerate(plain["root"]):
            root[k, k:] = np.array(row, dtype=float)
        right = np.array(plain["right"], dtype=float)
        left, count = float(plain["left"]), int(plain["count"])
        worth = np.inf if plain["worth"] is None else float(plain["worth"])
    except (KeyError, TypeError, ValueError, IndexError, OverflowError):
        return None
    good = np.isfinite(root).all() and np.isfinite(right).all() and np.isfinite(left) and left >= 0 and worth > 0
    if not (unchanged and good) or scale.shape != (len(names),) or not (np.isfinite(scale) & (scale > 0)).all():
        return None
    if right.shape != (len(root),) or len(set(names)) < len(names) or count < 0:
        return None
    return DataInformation(names=names, scale=scale, root=root, right=right, left=left, count=count, worth=worth)

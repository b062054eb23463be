"""What engineers, spreadsheets and instruments do to a table, as changes of a sheet. Lengths in mm, as in the file."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from tests.hostile.campaigns.sheet import Array, Sheet

Change = Callable[[Sheet], Sheet]
_SEED = 7


def _draw() -> np.random.Generator:
    return np.random.default_rng(_SEED)


def half(sheet: Sheet) -> slice:
    """The second half of the rows."""
    return slice(len(sheet.values) // 2, None)


def constant(name: str) -> Change:
    """The instrument repeats its first value."""
    return lambda s: s.changed(name, lambda v: np.full_like(v, v[0]))


def stuck(name: str) -> Change:
    """A column keeps its value from the middle on."""
    return lambda s: s.changed(name, lambda v: np.full_like(v, v[0]), half(s))


def times(name: str, factor: float, late: bool = False) -> Change:
    """A wrong unit, sign or scale; `late`: from the middle on."""
    return lambda s: s.changed(name, lambda v: factor * v, half(s) if late else slice(None))


def all_times(factor: float) -> Change:
    """All lengths that are read have a wrong scale."""

    def change(s: Sheet) -> Sheet:
        for k in s.readings:
            if s.units[k] == "mm":
                s = s.changed(s.names[k], lambda v: factor * v)
        return s

    return change


def plus(name: str, by: float, late: bool = False) -> Change:
    """An offset; `late`: from the middle on."""
    return lambda s: s.changed(name, lambda v: v + by, half(s) if late else slice(None))


def unsigned(name: str) -> Change:
    """Minus signs are lost."""
    return lambda s: s.changed(name, np.abs)


def swapped(a: str, b: str, late: bool = False) -> Change:
    """Two columns exchanged; `late`: from the middle on."""

    def change(s: Sheet) -> Sheet:
        values, rows = s.values.copy(), half(s) if late else slice(None)
        values[rows, s.at(a)], values[rows, s.at(b)] = s.values[rows, s.at(b)], s.values[rows, s.at(a)]
        return s.having(values)

    return change


def copied_column(source: str, target: str) -> Change:
    """A drive is wired to the column of another."""

    def change(s: Sheet) -> Sheet:
        values = s.values.copy()
        values[:, s.at(target)] = values[:, s.at(source)]
        return s.having(values)

    return change


def rotated_drives(s: Sheet) -> Sheet:
    """Columns of drives moved on by one."""
    values = s.values.copy()
    values[:, : s.drives] = np.roll(values[:, : s.drives], 1, axis=1)
    return s.having(values)


def _moved(order: Callable[[int], Array]) -> Change:
    def change(s: Sheet) -> Sheet:
        values = s.values.copy()
        values[:, s.readings] = s.values[order(len(s.values)).astype(int)][:, s.readings]
        return s.having(values)

    return change


def shuffled() -> Change:
    """Readings belong to other rows."""
    return _moved(lambda n: _draw().permutation(n).astype(float))


def late(rows: int) -> Change:
    """Readings stand some rows too low."""
    return _moved(lambda n: np.roll(np.arange(float(n)), rows))


def late_from_the_middle(s: Sheet) -> Sheet:
    """A reading was entered twice in the middle, the last one is lost."""
    return _moved(lambda n: np.arange(float(n)) - (np.arange(n) >= n // 2))(s)


def reversed_rows() -> Change:
    """Readings were noted from the last row to the first."""
    return _moved(lambda n: np.arange(float(n))[::-1])


def exchanged_rows(a: int, b: int) -> Change:
    """Readings of two rows are exchanged."""

    def order(n: int) -> Array:
        rows = np.arange(float(n))
        rows[[a, b]] = rows[[b, a]]
        return rows

    return _moved(order)


def sorted_column(name: str) -> Change:
    """A spreadsheet sorted one column by itself."""
    return lambda s: s.changed(name, np.sort)


def pushed_column(name: str) -> Change:
    """A cell was deleted in the middle, and the cells below moved up."""
    return lambda s: s.changed(name, lambda v: np.append(v[1:], np.nan), half(s))


def block_copied(rows: int) -> Change:
    """Readings of some rows were pasted over those of the next ones."""
    return _moved(
        lambda n: np.where((np.arange(n) >= rows) & (np.arange(n) < 2 * rows), np.arange(n) - rows, np.arange(n))
    )


def filled_down(every: int) -> Change:
    """Only each so many-th pose was measured; the spreadsheet filled the cells between with the value above."""
    return _moved(lambda n: np.arange(n) // every * float(every))


def interpolated(every: int) -> Change:
    """Only each so many-th pose was measured; the cells between are on straight lines."""

    def change(s: Sheet) -> Sheet:
        values, rows = s.values.copy(), np.arange(len(s.values))
        for k in s.readings:
            values[:, k] = np.interp(rows, rows[::every], values[::every, k])
        return s.having(values)

    return change


def gross(name: str, share: float, size: float) -> Change:
    """Some cells are off by so much."""

    def change(s: Sheet) -> Sheet:
        rows = _draw().choice(len(s.values), max(1, round(share * len(s.values))), replace=False)
        values = s.values.copy()
        values[rows, s.at(name)] += size * _draw().choice([-1.0, 1.0], len(rows))
        return s.having(values)

    return change


def some_cells(name: str, share: float, change: Callable[[Array], Array]) -> Change:
    """Some cells of a column are damaged alike."""

    def changed(s: Sheet) -> Sheet:
        rows = _draw().choice(len(s.values), max(1, round(share * len(s.values))), replace=False)
        values = s.values.copy()
        values[rows, s.at(name)] = change(values[rows, s.at(name)])
        return s.having(values)

    return changed


def rounded(step: float) -> Change:
    """Readings were noted to so much only."""

    def change(s: Sheet) -> Sheet:
        values = s.values.copy()
        values[:, s.readings] = np.round(values[:, s.readings] / step) * step
        return s.having(values)

    return change


def cut(s: Sheet) -> Sheet:
    """What follows the decimal comma is lost."""
    values = s.values.copy()
    values[:, s.readings] = np.trunc(values[:, s.readings])
    return s.having(values)


def turned(degrees: float, a: str = "x", b: str = "y", late: bool = False) -> Change:
    """The instrument's axes are turned against those of the machine."""

    def change(s: Sheet) -> Sheet:
        values, rows = s.values.copy(), half(s) if late else slice(None)
        cos, sin = np.cos(np.radians(degrees)), np.sin(np.radians(degrees))
        u, v = s.values[rows, s.at(a)], s.values[rows, s.at(b)]
        values[rows, s.at(a)], values[rows, s.at(b)] = cos * u + sin * v, cos * v - sin * u
        return s.having(values)

    return change


def drifting(name: str, by: float) -> Change:
    """The instrument drifts by so much from the first row to the last."""
    return lambda s: s.changed(name, lambda v: v + np.linspace(0.0, by, len(v)))


def sheared(a: str, b: str, by: float) -> Change:
    """Axis `a` of the instrument is not square to `b`."""
    return lambda s: s.having(s.values + np.outer(s.values[:, s.at(b)] * by, np.arange(len(s.names)) == s.at(a)))


def computed(places: Array, noise: float = 0.0) -> Change:
    """Not measured at all: the column has the places (N, k) that were commanded, with made-up noise."""

    def change(s: Sheet) -> Sheet:
        values = s.values.copy()
        columns = s.readings[: places.shape[1]]
        values[:, columns] = places + noise * _draw().normal(size=places.shape)
        return s.having(values)

    return change


def with_sigma(name: str, sigma: float) -> Change:
    """A column of stated noise, in the wrong unit."""

    def change(s: Sheet) -> Sheet:
        column = np.full((len(s.values), 1), sigma)
        names, units = (*s.names, f"sigma.{name}"), (*s.units, "mm")
        return Sheet(names, units, np.hstack([s.values, column]), s.drives)

    return change

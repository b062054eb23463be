"""What a search has computed already, so that no later step computes it again.

The same solution is linearised for scores, exchanges, alternatives, findings: each solution costs a prediction with
the derivatives by all numbers of the catalogue, which is most of a diagnosis.
"""

from __future__ import annotations

from collections.abc import Callable, Hashable, Sequence
from dataclasses import dataclass, field
from typing import TypeVar, cast

from pkmcal_cli.base.rotation import Array
from pkmcal_cli.calibration.problem import Problem
from pkmcal_cli.diagnosis.linear import Linear

_BYTES = 1 << 27  # of columns that results hold; the oldest go
T = TypeVar("T")


@dataclass(frozen=True)
class _Result:
    """One result of objects that are held, as their identity must not pass to others; `key`: what it is of else."""

    of: tuple[object, ...]
    key: tuple[Hashable, ...]
    result: object
    nbytes: int

    @property
    def identity(self) -> tuple[int, ...]:
        """Of the objects."""
        return tuple(map(id, self.of))


@dataclass
class KnownResults:
    """Results of one search; objects that they depend on are compared by identity, not by content."""

    _results: list[_Result] = field(default_factory=list)
    _by_identity: dict[tuple[int, ...], list[_Result]] = field(default_factory=dict)  # the same, by their objects

    def linearised(
        self, problem: Problem, values: Array, names: tuple[str, ...], projected: tuple[str, ...],
        compute: Callable[[], Linear],
    ) -> Linear:  # fmt: skip
        """The problem linearised at values (P,) by parameters `names`, or by more, of which `projected` are."""
        of, key = (problem,), ("linear", values.tobytes())
        near = [r.result for r in self._of(of) if r.key == key and isinstance(r.result, Linear)]
        near = [x for x in near if set(names) <= set(x.names)]
        same = next((x for x in near if x.names == names and x.projected == projected), None)
        if same is not None:
            return same
        linear = near[0].only(names, projected) if near else compute()
        self._add(_Result(of, key, linear, linear.columns.nbytes))
        return linear

    def once(
        self, of: tuple[object, ...], key: tuple[Hashable, ...], compute: Callable[[], T], nbytes: int = 0
    ) -> T:
        """A result that depends on objects `of` and a key; nbytes: about what it holds."""
        for r in self._of(of):
            if r.key == key:
                return cast(T, r.result)
        result = compute()
        self._add(_Result(of, key, result, nbytes))
        return result

    def each(
        self,
        of: tuple[object, ...],
        keys: Sequence[Hashable],
        compute: Callable[[list[int]], Sequence[T]],
        nbytes: Callable[[T], int] = lambda _: 0,
    ) -> list[T]:
        """Results that depend on objects `of` and one key each; `compute` those with some numbers, all at once."""
        known = {r.key: r.result for r in self._of(of)}
        results = {k: known[(key,)] for k, key in enumerate(keys) if (key,) in known}
        missing = [k for k in range(len(keys)) if k not in results]
        for k, result in zip(missing, compute(missing) if missing else (), strict=True):
            results[k] = result
            self._add(_Result(of, (keys[k],), result, nbytes(result)))
        return [cast(T, results[k]) for k in range(len(keys))]

    def _of(self, of: tuple[object, ...]) -> Sequence[_Result]:
        return self._by_identity.get(tuple(map(id, of)), ())

    def _add(self, result: _Result) -> None:
        self._results.append(result)
        self._by_identity.setdefault(result.identity, []).append(result)
        total = sum(r.nbytes for r in self._results)
        while total > _BYTES and len(self._results) > 1:
            oldest = self._results.pop(0)
            self._by_identity[oldest.identity].pop(0)
            total -= oldest.nbytes

    def __reduce__(self) -> tuple[type[KnownResults], tuple[()]]:
        """Another process begins without."""
        return KnownResults, ()

"""Many short texts without an object for each: one string and where each of them ends."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from typing import Any, overload

import numpy as np
from numpy.typing import NDArray


class StoredTexts(Sequence[str]):
    """N texts; equal to any sequence of the same texts."""

    def __init__(self, texts: Iterable[str]) -> None:
        kept = list(texts)
        self._keep("".join(kept), np.array([len(text) for text in kept], dtype=np.int64))

    @classmethod
    def of_parts(cls, parts: Sequence[StoredTexts]) -> StoredTexts:
        """All texts of several, one after the other."""
        out = cls(())
        lengths = [np.diff(part._ends, prepend=0) for part in parts]
        out._keep("".join(part._joined for part in parts), np.concatenate(lengths))
        return out

    def _keep(self, joined: str, lengths: NDArray[Any]) -> None:
        self._joined = joined
        self._ends = np.cumsum(lengths, dtype=np.int64).astype(np.min_scalar_type(len(joined)))

    def __len__(self) -> int:
        return len(self._ends)

    @overload
    def __getitem__(self, place: int) -> str: ...
    @overload
    def __getitem__(self, place: slice) -> tuple[str, ...]: ...
    def __getitem__(self, place: int | slice) -> str | tuple[str, ...]:
        if isinstance(place, slice):
            return tuple(self[k] for k in range(*place.indices(len(self))))
        end = int(self._ends[place])
        place = int(place) % len(self)
        return self._joined[int(self._ends[place - 1]) if place else 0 : end]

    def __iter__(self) -> Iterator[str]:
        start = 0
        for end in self._ends:
            yield self._joined[start : int(end)]
            start = int(end)

    def __eq__(self, other: object) -> bool:
        return isinstance(other, (tuple, list, StoredTexts)) and tuple(self) == tuple(other)

    __hash__ = None  # type: ignore[assignment]

    def __repr__(self) -> str:
        return f"StoredTexts({list(self)!r})"

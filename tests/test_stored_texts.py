"""Texts of a column, stored as one string: they are what a tuple of the same texts is, in a fraction of its memory."""

from __future__ import annotations

import sys
import tracemalloc

import pytest

from pkmcal_cli.base.stored_texts import StoredTexts

TEXTS = ("", "p1", "Größe", "", "點 7", "x" * 300, "p1")


def test_texts_are_those_of_a_tuple() -> None:
    stored = StoredTexts(TEXTS)
    assert list(stored) == list(TEXTS)
    assert [stored[k] for k in range(-len(TEXTS), len(TEXTS))] == [*TEXTS, *TEXTS]
    assert stored[1:4] == TEXTS[1:4]
    assert stored[::-2] == TEXTS[::-2]
    assert stored == TEXTS and stored == list(TEXTS) and stored == StoredTexts(TEXTS)
    assert stored != TEXTS[:-1] and stored != StoredTexts((*TEXTS[:-1], "p2")) and stored != 3
    assert "p1" in stored and "p2" not in stored
    assert repr(StoredTexts(("a", ""))) == "StoredTexts(['a', ''])"


@pytest.mark.parametrize("place", [7, -8])
def test_a_place_beyond_the_end_is_an_error(place: int) -> None:
    with pytest.raises(IndexError):
        StoredTexts(TEXTS)[place]


def test_no_texts() -> None:
    assert list(StoredTexts(())) == [] and StoredTexts(()) == ()


def test_parts_come_one_after_the_other() -> None:
    long = StoredTexts(str(k) for k in range(300))  # ends of other sizes than those of the short ones
    joined = StoredTexts.of_parts([StoredTexts(TEXTS), StoredTexts(()), long, StoredTexts(TEXTS)])
    assert joined == (*TEXTS, *map(str, range(300)), *TEXTS)


def test_memory_is_that_of_the_characters() -> None:
    """A text object takes over 50 bytes."""
    tracemalloc.start()
    before = tracemalloc.get_traced_memory()[0]
    stored = StoredTexts(f"p{k}" for k in range(10_000))
    used = tracemalloc.get_traced_memory()[0] - before
    tracemalloc.stop()
    assert len(stored) == 10_000
    assert used < 10_000 * 12 < 10_000 * sys.getsizeof("p1000") / 4

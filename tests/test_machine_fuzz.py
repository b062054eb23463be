"""Damaged machine files: read, or refused with places; never anything else."""

from __future__ import annotations

import json
import math
import random
from pathlib import Path

from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from pkmcal_cli.base.errors import BadInput
from pkmcal_cli.language.machine import Machine
from tests.machine_texts import SPOOLS, TRIGLIDE, read

FUZZ = settings(max_examples=150, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])


@given(st.data())
@FUZZ
def test_damaged_machines_are_read_or_refused(tmp_path: Path, data: st.DataObject) -> None:
    base = data.draw(st.sampled_from([TRIGLIDE, SPOOLS]))
    rng = random.Random(data.draw(st.integers(0, 2**32)))
    text = base
    for _ in range(rng.randint(1, 4)):
        at = rng.randrange(len(text))
        cut = rng.choice([0, 1, 1, 5])
        text = (
            text[:at] + rng.choice(["", "x", "{", "]", ": ", ",", "-", "9", "\n", "'", "null", "*"]) + text[at + cut :]
        )
    try:
        machine = read(tmp_path, text)
    except BadInput as error:
        assert error.faults and error.text()
    else:
        assert all(math.isfinite(value) for value in machine.nominal_values().values())


_JUNK = st.recursive(
    st.one_of(st.none(), st.booleans(), st.integers(-9, 9), st.sampled_from(["x", "tcp", "l1", "1 mm", "{i}", ""])),
    lambda inner: st.one_of(
        st.lists(inner, max_size=3),
        st.dictionaries(st.sampled_from(["at", "each", "i", "k", "x"]), inner, max_size=3),
    ),
    max_leaves=6,
)


@given(st.sampled_from(list(Machine.model_fields)), _JUNK, st.sampled_from(["planar", "spatial"]))
@FUZZ
def test_junk_in_any_section_is_refused_or_read(tmp_path: Path, section: str, junk: object, space: str) -> None:
    for value in (junk, {"a": junk}, {"a{i}": {"each": {"i": [1]}, "at": junk, "between": junk}}):
        text = json.dumps({"space": space, section: value})
        try:
            read(tmp_path, text)
        except BadInput as error:
            assert error.text()

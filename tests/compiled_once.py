"""Machines that several tests load: compiled once in a process, as long as their files say the same."""

from __future__ import annotations

import pickle
from collections import OrderedDict
from collections.abc import Iterator
from contextlib import contextmanager

import pytest

import pkmcal_cli.loading.load_machine
from pkmcal_cli.compiler import Compiled, compile_machine
from pkmcal_cli.language.machine import Machine

_KEPT: OrderedDict[bytes, Compiled] = OrderedDict()
_MOST = 40


def compiled(machine: Machine, receptive: bool = False) -> Compiled:
    """The compiled machine, that of an earlier call where the machine is the same in every value and place."""
    key = pickle.dumps((machine, receptive))
    if key not in _KEPT:
        _KEPT[key] = compile_machine(machine, receptive)
    _KEPT.move_to_end(key)
    while len(_KEPT) > _MOST:
        _KEPT.popitem(last=False)
    return _KEPT[key]


@contextmanager
def compiling_once() -> Iterator[None]:
    """Commands within compile no machine twice; a test that has a compiler of its own keeps it."""
    with pytest.MonkeyPatch.context() as patch:
        if pkmcal_cli.loading.load_machine.compile_machine is compile_machine:
            patch.setattr(pkmcal_cli.loading.load_machine, "compile_machine", compiled)
        yield

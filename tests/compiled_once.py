"""Machines that several tests load: compiled once in a process, as long as their files say the same."""

from __future__ import annotations

import pickle
from collections import OrderedDict
from collections.abc import Iterator
from contextlib import contextmanager
from typing import TypeVar

import pytest

import pkmcal_cli.loading.load_machine
import pkmcal_cli.workflow.check
from pkmcal_cli.compiler import Compiled, compile_machine
from pkmcal_cli.language.machine import Machine
from pkmcal_cli.model.model import Model
from pkmcal_cli.model.singular_drives import SingularDrives, singular_drives

Key, Kept = TypeVar("Key"), TypeVar("Kept")
_KEPT: OrderedDict[bytes, Compiled] = OrderedDict()
_SINGULAR: OrderedDict[int, tuple[Model, SingularDrives | None]] = OrderedDict()
_MOST = 40


def compiled(machine: Machine, receptive: bool = False) -> Compiled:
    """The compiled machine, that of an earlier call where the machine is the same in every value and place."""
    key = pickle.dumps((machine, receptive))
    if key not in _KEPT:
        _KEPT[key] = compile_machine(machine, receptive)
    return _used(_KEPT, key)


def _singular(model: Model) -> SingularDrives | None:
    """What `singular_drives` says of a model: of the very object, as long as it is kept."""
    if id(model) not in _SINGULAR:
        _SINGULAR[id(model)] = (model, singular_drives(model))
    return _used(_SINGULAR, id(model))[1]


def _used(kept: OrderedDict[Key, Kept], key: Key) -> Kept:
    """What is kept, now the last to be forgotten."""
    kept.move_to_end(key)
    while len(kept) > _MOST:
        kept.popitem(last=False)
    return kept[key]


@contextmanager
def compiling_once() -> Iterator[None]:
    """Commands within compile no machine twice; a test that has a compiler of its own keeps it."""
    with pytest.MonkeyPatch.context() as patch:
        if pkmcal_cli.loading.load_machine.compile_machine is compile_machine:
            patch.setattr(pkmcal_cli.loading.load_machine, "compile_machine", compiled)
        if pkmcal_cli.workflow.check.singular_drives is singular_drives:
            patch.setattr(pkmcal_cli.workflow.check, "singular_drives", _singular)
        yield

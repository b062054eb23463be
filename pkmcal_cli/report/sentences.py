"""Sentences about effects, and which command goes on from there."""

from __future__ import annotations

import re
from collections.abc import Iterable, Sequence

from pkmcal_cli.base.plural import count
from pkmcal_cli.calibration.fit import ABANDONED
from pkmcal_cli.effects import Effect
from pkmcal_cli.effects.effect import Entry
from pkmcal_cli.model.effect_sites import ALL, EACH, place_and_session

STANDS_ANYWHERE = (
    "Errors are those of poses to each other: the instrument stands anywhere (`frame: fitted`), so where the "
    "machine as a whole is cannot be judged."
)

PARTLY = "{points} measured only in a part of the coordinates: judged by these alone."

_UNLIKELY = 0.01  # chance of the residuals at which a calibration is incomplete: nothing may say then that they agree
_NOUNS: dict[Entry, str] = {
    "command": "drive",
    "drive_force": "drive",
    "length": "member",
    "guide": "guide",
    "carriage": "carriage",
    "base": "part of the base",
    "stiffness": "elastic part",
}


def cause_effect_action(effect: Effect, at: str, size: str, numbers: Sequence[str] = ()) -> tuple[str, str, str]:
    """The effect's three sentences; at `all` places, or `each`, they speak of every drive, member, guide ...

    numbers: names of its parameters that were found.
    """
    place, session = place_and_session(at) if effect.by_session else (at, "")
    place = ALL if place == EACH else place.removeprefix(f"{EACH}:")
    within = " in every session" if session == EACH else f" in session {session}" if session else ""
    often = effect.repeats(numbers)
    cause, result, action = (
        _placed(text, effect.enters, place, within).format(at=place + within, size=size, repeats=often)
        for text in (effect.cause, effect.result, effect.action)
    )
    return cause, result, action


def _placed(text: str, enters: Entry, place: str, within: str) -> str:
    """A template for this place: "The guide {at} is" becomes "Every guide is" at all places; within: of a session."""
    if place != ALL:
        return text
    noun = _NOUNS.get(enters, "instrument")
    text = re.sub(rf"\b(the )?{noun} {{at}}", f"every {noun}{within}", text, flags=re.IGNORECASE)
    text = text.replace("{at}", f"every {noun}{within}")
    return text[0].upper() + text[1:]


def grouped(not_testable: Iterable[tuple[str, str]]) -> list[str]:
    """What could not be tested, one line for each thing that is needed."""
    by_need: dict[str, list[str]] = {}
    for name, needs in not_testable:
        by_need.setdefault(needs, []).append(name)
    return [f"not testable: {', '.join(names)}: needs {needs}" for needs, names in by_need.items()]


def command(*words: str) -> str:
    """A command line of ours; words with spaces or brackets are quoted."""
    return " ".join(["pkmcal", *(f'"{w}"' if " " in w or "[" in w else w for w in words)])


def listed(names: Sequence[str], most: int) -> str:
    """The first names, and how many more there are."""
    unlisted = len(names) - most
    return ", ".join(names[:most]) + (f" and {unlisted} more" if unlisted > 0 else "")


def tested_alone(names: Sequence[str] | None) -> str:
    """That only some effects were tested, to be appended; "" where all were (None)."""
    if names is None:
        return ""
    return f"; only {listed(names, 3)} {'was' if len(names) == 1 else 'were'} tested"


_MOVED = (
    "Something was moved or homed again there, of the instrument or of the machine. Give the rows from there on another"
    " session (column `session`)."
)


_ALONG = re.compile(r"oscillation along (\w+),")


def unknown_sentence(size: str, depends_on: str, hint: str, warm: bool, step: bool = False) -> str:
    """Something that no effect explains; `warm`: temperatures were logged; `step`: all readings shift at some time."""
    advice = _MOVED if step else {
        "time": f"Log temperatures{' of more parts' if warm else ''} and repeat a datum pose.",
        "temperature": "Log temperatures of more parts.",
        "direction": "Measure every pose from both sides.",
        "load": "Measure with several payloads.",
    }.get(depends_on, "Do not compensate outside the measured region.")
    if (named := _ALONG.match(hint)) is not None:
        drive = named[1]
        advice = (
            f"If the screw, gear or encoder of {drive} comes round as often, state its `period` in the machine file "
            f"(`actuators: {{{drive}: {{period: ...}}}}`): then it is tested by name. {advice}"
        )
    label = f"Unknown effect of {size.strip()}" if size else "Unknown effect"
    detail = f" ({hint})" if hint else ""
    return f"{label}: depends on {depends_on}, matches no effect of the catalogue{detail}. {advice}"


def ending_text(status: str, stopped: str, steps: int) -> str:
    """How a fit ended, and why; status "accepted": implausible, but that was accepted."""
    if stopped == ABANDONED:
        return "NOT FITTED: readings look wrong, and no fit soon explains them; start values are kept\n" + (
            "(correct the table as the warning says, or fit it as it is with `--accept`)"
        )
    in_steps = count(steps, "step") + _STOPPED[stopped]
    return {
        "converged": f"converged in {in_steps}",
        "incomplete": f"INCOMPLETE, though converged in {in_steps}: residuals exceed the noise (next: `diagnose`)",
        "implausible": f"IMPLAUSIBLE, though converged in {in_steps}: do not use these parameters",
        "accepted": f"IMPLAUSIBLE, but accepted (`--accept`), and converged in {in_steps}",
        "not_converged": f"NOT CONVERGED in {in_steps}: do not use these parameters",
        "nothing_identifiable": "NOTHING IDENTIFIABLE: these data determine none of the selected parameters",
    }[status]


_STOPPED = {
    "gradient": " (stopped by gradient)",
    "step": " (stopped by step length)",
    "rounding": " (stopped by rounding)",
    "noise": " (stopped as steps gain less than noise)",
    "budget": " (stopped by the budget of steps)",
    "no_descent": " (no step lowers chi-square)",
    "nothing": "",
}


def no_cause(chance: float) -> str:
    """What is said of residuals in which nothing was found, by the chance of noise that is as large."""
    if chance < _UNLIKELY:
        return "no effect found; the residuals are larger than the stated noise, but not beyond doubt"
    return "the residuals agree with the stated noise"

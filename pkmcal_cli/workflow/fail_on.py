"""Which results end a command with exit code 1."""

from __future__ import annotations

from collections.abc import Sequence

from pkmcal_cli.base.errors import UsageError, did_you_mean

NEVER = "none"


def failing(text: str | None, known: Sequence[str]) -> frozenset[str]:
    """Results named by `--fail-on`, comma-separated: all that are known without it, none for `none`.

    Raises UsageError.
    """
    if text is None:
        return frozenset(known)
    names = [name.strip() for name in text.split(",")]
    if names == [NEVER]:
        return frozenset()
    if NEVER in names:
        hint = f"use `--fail-on {NEVER}`, or leave it out"
        raise UsageError(f"--fail-on: `{NEVER}` stands alone, without other results", hint=hint)
    wrong = [name for name in names if name not in known]
    if wrong:
        every = f"use some of {', '.join(known)}, separated by commas, or {NEVER}"
        raise UsageError(
            f"--fail-on: `{wrong[0]}` is not a result", hint=did_you_mean(wrong[0], (*known, NEVER), every)
        )
    return frozenset(names)

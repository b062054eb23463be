"""The false-alarm rate that is asked for."""

from __future__ import annotations

from pkmcal_cli.base.errors import UsageError

MOST_ALPHA = 0.2


def check_alpha(alpha: float) -> None:
    """Raises UsageError for what is no false-alarm rate."""
    if not 0 < alpha <= MOST_ALPHA:
        raise UsageError(
            f"--alpha: {alpha:g} is not a false-alarm rate", hint=f"give a value above 0, at most {MOST_ALPHA}"
        )

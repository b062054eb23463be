"""What the command line does around every computation: numbers that fail are told in our own words."""

from __future__ import annotations

import warnings
from collections.abc import Iterator
from contextlib import contextmanager

from pkmcal_cli.base.errors import numbers_fail


@contextmanager
def computing() -> Iterator[None]:
    """Warnings of libraries about rows without a solution are silent: results tell them. Raises BadInput."""
    import numpy as np

    try:
        with warnings.catch_warnings(), np.errstate(all="ignore"):
            warnings.simplefilter("ignore")
            yield
    except np.linalg.LinAlgError:
        raise numbers_fail() from None

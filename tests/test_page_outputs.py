"""A page's outputs, written anew: shown lines follow what is printed, left-out lines stay left out."""

from __future__ import annotations

from tests.page_outputs import renewed
from tests.pages import OMITTED

PRINTED = ["fit", "a 1.0 mm", "b 2.0 mm", "c 3.0 mm", "rms 4 um"]


def test_lines_that_still_hold_stay() -> None:
    """Nothing is written where the page is right, with lines left out or without."""
    assert renewed(PRINTED, PRINTED) == PRINTED
    assert renewed(["fit", OMITTED, "rms 4 um"], PRINTED) == ["fit", OMITTED, "rms 4 um"]


def test_a_whole_output_is_replaced() -> None:
    """Without left-out lines the page shows all that is printed."""
    assert renewed(["fit", "rms 5 um"], PRINTED) == PRINTED


def test_runs_between_left_out_lines_find_their_new_text() -> None:
    """Each run goes where it is most like the print: first and last at the ends, others in their order."""
    shown = ["fits", OMITTED, "b 9.0 mm", OMITTED, "rms 5 um"]
    assert renewed(shown, PRINTED) == ["fit", OMITTED, "b 2.0 mm", OMITTED, "rms 4 um"]
    assert renewed(["fits", OMITTED, "c 9.0 mm", "rms 5 um"], PRINTED) == ["fit", OMITTED, "c 3.0 mm", "rms 4 um"]

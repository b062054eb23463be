"""A tripod on rails, and two campaigns by a simulator in closed form: 46 rows each, with noise of 6 um.

Its legs grow at once by 11.5 um/(m K), over some 3 K: that shows no more of a lag than that it is below some minutes.
"""

from __future__ import annotations

from pathlib import Path

_DATA = Path(__file__).parent / "data"
TRIPOD, LATE, AT_ONCE = (_DATA / name for name in ("tripod.yaml", "tripod-late.csv", "tripod-at-once.csv"))

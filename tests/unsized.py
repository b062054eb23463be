"""Diagnoses without the sizes that each effect would need to be seen, which take longer to simulate than the search.

For tests of causes, which look at no such size; what a diagnosis has computed and keeps is left as it is.
"""

from __future__ import annotations

from unittest.mock import patch

from pkmcal_cli.diagnosis.run_diagnosis import Diagnosis

UNSIZED = patch.object(Diagnosis, "detectable", property(lambda _: ()))

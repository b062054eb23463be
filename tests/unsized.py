"""Diagnoses without the sizes that each effect would need to be seen, which take longer to simulate than the search.

For tests of causes, which look at no such size: `pytestmark = pytest.mark.usefixtures("unsized")`.
"""

from __future__ import annotations

from unittest.mock import patch

from pkmcal_cli.diagnosis.run_diagnosis import Diagnosis

UNSIZED = patch.object(Diagnosis, "detectable", property(lambda _: ()))

"""Where a result comes from: versions, inputs with their sha256, arguments, seed."""

from __future__ import annotations

import platform
import sys
from datetime import UTC, datetime
from typing import Any

from .. import __version__


def provenance(inputs: dict[str, str], **more: Any) -> dict[str, Any]:
    """Head of a written result; `inputs`: sha256 by file."""
    import numpy
    import scipy

    return {
        "program": f"pkmcal {__version__}",
        "python": platform.python_version(),
        "numpy": numpy.__version__,
        "scipy": scipy.__version__,
        "created": datetime.now(UTC).isoformat(timespec="seconds"),
        "arguments": sys.argv[1:],
        "inputs": inputs,
        **more,
    }

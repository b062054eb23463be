"""Where a result comes from: versions, inputs with their sha256, arguments, seed, status."""

from __future__ import annotations

import platform
import sys
from collections.abc import Mapping
from datetime import UTC, datetime
from typing import Any

from pkmcal_cli import __version__
from pkmcal_cli.base.files import readable


def provenance(inputs: Mapping[str, str], **more: Any) -> dict[str, Any]:
    """Head of a written result; `inputs`: sha256 by file."""
    import numpy
    import scipy

    return {
        "program": f"pkmcal {__version__}",
        "python": platform.python_version(),
        "numpy": numpy.__version__,
        "scipy": scipy.__version__,
        "created": datetime.now(UTC).isoformat(timespec="seconds"),
        "arguments": [readable(argument) for argument in sys.argv[1:]],
        "inputs": {readable(name): digest for name, digest in inputs.items()},
        **more,
    }


def provenance_lines(head: Mapping[str, Any]) -> list[str]:
    """The head as comment lines of a table."""
    import yaml

    text = yaml.safe_dump({"provenance": dict(head)}, sort_keys=False, allow_unicode=True, width=1000)
    return str(text).splitlines()

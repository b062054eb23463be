"""Commands as on a terminal of a given width: a pseudo-terminal takes what they tell, one process runs several."""

from __future__ import annotations

import fcntl
import json
import os
import pty
import re
import struct
import subprocess
import sys
import termios
from collections.abc import Sequence

from tests.command import ROOT, environment

_STYLES = re.compile(r"\x1b\[[0-9;?]*[A-Za-z]")
_DRIVER = """
import json, sys
from pkmcal_cli import app
for arguments in json.loads(sys.argv[1]):
    sys.argv = ["pkmcal", *arguments]
    code = app.run(arguments)
    print(f"\\n@@@ {code}", file=sys.stderr, flush=True)
"""


def on_terminal(width: int, *commands: Sequence[str], **more: str) -> list[tuple[int, str]]:
    """Exit code and what stands on the terminal, styles included, of commands run one after the other."""
    mine, theirs = pty.openpty()
    fcntl.ioctl(theirs, termios.TIOCSWINSZ, struct.pack("HHHH", 50, width, 0, 0))
    process = subprocess.Popen(
        [sys.executable, "-c", _DRIVER, json.dumps([list(c) for c in commands])],
        stdin=subprocess.DEVNULL, stdout=subprocess.DEVNULL, stderr=theirs, cwd=ROOT,
        env=_unsized(environment(TERM="xterm") | more), close_fds=True,
    )  # fmt: skip
    os.close(theirs)
    shown = b""
    while part := _read(mine):
        shown += part
    os.close(mine)
    process.wait(timeout=60)
    parts = re.split(r"\r?\n@@@ (\d+)\r?\n", shown.decode("utf-8").replace("\r\n", "\n"))
    return [(int(code), text) for text, code in zip(parts[::2], parts[1::2], strict=False)]


def _unsized(variables: dict[str, str]) -> dict[str, str]:
    """Without what would say how large the terminal is."""
    return {name: value for name, value in variables.items() if name not in ("COLUMNS", "LINES")}


def plain(text: str) -> str:
    """Without styles."""
    return _STYLES.sub("", text)


def _read(descriptor: int) -> bytes:
    try:
        return os.read(descriptor, 1 << 16)
    except OSError:  # the other end has gone
        return b""

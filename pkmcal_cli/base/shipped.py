"""The shipped machines, their tables and the schemas: in a checkout its folder `machines`, else the package's own."""

from __future__ import annotations

import contextlib
import os
from importlib.resources import files
from pathlib import Path

from pkmcal_cli.base.errors import BadInput, Location, did_you_mean, nearest

PACKAGE = "pkmcal_machines"
_MARK = "machine.schema.json"  # tells the folder from others of its name
_YAML = (".yaml", ".yml")


def shipped_folder() -> Path:
    """Where they are. Raises BadInput where the installation has none."""
    beside = Path(__file__).resolve().parents[2] / "machines"
    if (beside / _MARK).is_file():  # a checkout: its machines go with its code
        return beside
    try:
        folder = Path(str(files(PACKAGE).joinpath(_MARK))).parent
    except ModuleNotFoundError:
        folder = beside
    if not (folder / _MARK).is_file():
        raise BadInput.single("the shipped machines are not installed", hint="install pkmcal again", code="file")
    return folder


def shipped_machines() -> tuple[str, ...]:
    """Names of the shipped machines."""
    files = (f for f in shipped_folder().glob("*.yaml") if not f.name.endswith(".provenance.yaml"))
    return tuple(sorted(f.stem for f in files))


def shipped_file(name: str) -> Path:
    """A shipped file by its name, e.g. `triglide.csv`. Raises BadInput for a name of none."""
    folder = shipped_folder()
    names = [f.name for f in folder.iterdir() if f.is_file()]
    if name not in names:
        raise BadInput.single(f"no shipped file `{name}`", Location(name), did_you_mean(name, names), "file")
    return folder / name


def machine_file(text: str) -> str:
    """The file of a shipped machine that is called by its name alone, `scissors`; any other text as it is."""
    bare = Path(text).suffix not in _YAML and Path(text).name == text
    if not bare or os.path.exists(text) or text not in shipped_machines():
        return text
    return str(shipped_file(f"{text}.yaml"))


def missing_hint(name: str) -> str | None:
    """Which file may be meant by one that is not there.

    A shipped one, as `machines/NAME` in the documentation; one of its kind that lies beside it; a shipped machine.
    """
    path = Path(name)
    with contextlib.suppress(BadInput):
        if os.path.isfile(file := shipped_folder() / path.name):
            return f"pkmcal brings one of this name: `{file}`"
    with contextlib.suppress(OSError, ValueError):
        alike = [p.name for p in path.parent.iterdir() if path.suffix in ("", p.suffix)]
        if (near_name := nearest(path.name, alike)) is not None:
            return f"did you mean `{near_name}`?"
    with contextlib.suppress(BadInput):
        if name and not path.suffix and (near_name := nearest(name, shipped_machines())) is not None:
            return f"did you mean `{near_name}`, which is shipped?"
    return None

"""Labels of rows that are likely not meant as they are written."""

from __future__ import annotations

from pkmcal_cli.tables.measurement_set import Measurements


def label_notes(measurements: Measurements) -> list[str]:
    """Sessions that are told apart by case or blanks only, and an `id` that all rows have."""
    alike: dict[str, list[str]] = {}
    for name in measurements.sessions:
        alike.setdefault("".join(name.casefold().split()), []).append(name)
    notes = [
        f"sessions {' and '.join(f'`{name}`' for name in names)} differ only in case or blanks; each is one of its own"
        for names in alike.values()
        if len(names) > 1
    ]
    ids = set(measurements.ids)
    if len(measurements) > 1 and len(ids) == 1 and (name := ids.pop()):
        notes.append(f"all {len(measurements)} rows have the same `id`, `{name}`")
    return notes

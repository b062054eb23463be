"""Where two `--json` outputs differ by more than rounding.

Estimates are compared in their standard uncertainties, null and weak directions as subspaces, rankings by name.
Left out is what rounding decides: the sign and the words of a direction, what an invisible effect is confused with.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterator, Mapping
from typing import Any

import numpy as np

RELATIVE = 1e-9  # of ordinary numbers
ESTIMATE = 1e-6  # of estimates, in standard uncertainties; of sizes that are multiples of one
ROUNDING = 1e-12  # what lies below, as a share of the largest number of its kind in the output
_ESTIMATES = ("value", "interval", "nominal", "size", "estimate")
_IN_STD = ("spread", "std_in_ranges", "by_std", "deviation")
_SMALL = ("O2", "O3", "O4", "O5", "condition_number", "condition_number_whitened")
_SIZES = ("mdb", "msb", "p_value", "effective_tests", "cosine", "std", "std_by_data", "std_by_held", "factors")
"""Of these rounding is worth more: multiples of a standard uncertainty, columns of effects at kinks (the sign of a
force that is nearly none), standard uncertainties of weak parameters, and what is estimated from them."""
_FORCES, _LEAST_FORCE = ("before", "after", "internal"), 1e-4
"""Of drives, N or N m: equilibria of members of MN have such forces by rounding."""
_ROUNDED_FORCE = 1e-9
_LEAST_ERRORS = {
    "errors": ("position", 1e-8),
    "not_held": ("not_held", 1e-9),
    **dict.fromkeys(("before", "after", "heldout"), ("force", _ROUNDED_FORCE)),
    **{part: (part, _ROUNDED_FORCE) for part in ("channels_before", "channels_after")},
}
"""In the outputs' units: what a search for set values leaves of a position, 1e-15 rad of rotations (in urad), and the
rounding of forces of kN."""
_DRAWN = 0.05  # of sizes by 500 drawn campaigns, whose draws follow rounding where machines have many directions
_OF_THE_SMALLEST = 1e-8  # of those: the smallest singular value has the rounding of the largest
_BY_RANK = ("mdb", "msb", "rival", "cosine", "parameter", "absorbed_by", "remark", "detected", "numbers", "worst")
"""Of an invisible effect: sizes beyond all bounds, and the one of many that happens to come first."""
_OF_A_DIFFERENCE, _ROOT = "std_by_held", 1e-15
"""The root of a difference of squares, which has the rounding of the squares: a share of that of `std`."""
_NEVER = 10.0  # times what is plausible: a size at which an effect is invisible
_NAMES = ("name", "effect", "at", "file", "line", "kind", "row", "id", "channel")

Path = tuple[str, ...]


def differences(expected: Any, found: Any) -> list[str]:
    """Where the second output differs, one line each."""
    a, b = dict(_leaves(_comparable(expected))), dict(_leaves(_comparable(found)))
    out = [f"{'.'.join(p)}: is missing" for p in _only_in(a, b)] + [f"{'.'.join(p)}: is new" for p in _only_in(b, a)]
    largest: dict[Path, float] = defaultdict(float)
    for path, value in [*a.items(), *b.items()]:
        if _is_number(value):
            largest[_kind(path)] = max(largest[_kind(path)], abs(value))
    for path in a.keys() & b.keys():
        if not _same(path, a[path], b[path], a, largest[_kind(path)]):
            out.append(f"{'.'.join(path)}: {a[path]!r} became {b[path]!r}")
    return sorted(out)


def _only_in(one: Mapping[Path, Any], other: Mapping[Path, Any]) -> set[Path]:
    """The topmost paths of branches that one output has and the other has not."""
    there = {p[:k] for p in other for k in range(len(p) + 1)}
    return {next((p[:k] for k in range(len(p) + 1) if p[:k] not in there), p) for p in one.keys() - other.keys()}


def _same(path: Path, one: Any, other: Any, output: Mapping[Path, Any], largest: float) -> bool:
    if not (_is_number(one) and _is_number(other)):
        return bool(one == other)
    if isinstance(one, int) and isinstance(other, int):
        return one == other
    key = next(k for k in reversed(path) if not k.startswith("#"))
    shares = {**dict.fromkeys(_SMALL, _OF_THE_SMALLEST), **dict.fromkeys(_SIZES, ESTIMATE), "detected": _DRAWN}
    share = _DRAWN if "selection" in path else max((shares.get(k, RELATIVE) for k in path), default=RELATIVE)
    off = share * max(abs(one), abs(other)) + ROUNDING * largest
    off += _LEAST_FORCE if path[0] == "drives" and key in _FORCES else 0.0
    quantity, least = _LEAST_ERRORS.get(path[0], ("", 0.0))
    off += least if quantity in path else 0.0
    if key in _ESTIMATES:
        owner = path[: len(path) - 1 - path[::-1].index(key)]
        std = output.get((*owner, "std"))
        off += ESTIMATE * std if _is_number(std) else 0.0
    elif key in _IN_STD:
        off += ESTIMATE
    elif key == _OF_A_DIFFERENCE and one and other:
        std = output.get((*path[:-1], "std"))
        off += _ROOT * std**2 / max(abs(one), abs(other)) if _is_number(std) else 0.0
    return abs(one - other) <= off


def _comparable(value: Any) -> Any:
    """Lists of things with names by name, directions as what they span, nothing that rounding decides."""
    if isinstance(value, dict):
        if _invisible(value) and ("effect" in value or "detected" not in value):
            value = {k: v for k, v in value.items() if k not in _BY_RANK}
        elif "detected" in value and "effect" not in value:  # one number, or the worst direction
            value = _along(value)
        elif "cosine" in value:  # which is compared; of several rivals that are alike any may be named
            value = {k: v for k, v in value.items() if k != "rival" and not (k == "msb" and _never(value, k))}
        return {k: _projector(v) if k == "undetermined" else _comparable(v) for k, v in value.items()}
    if not isinstance(value, list):
        return value
    if value and all(isinstance(v, dict) and "sigma" in v and isinstance(v.get("std"), list) for v in value):
        return _bench(value)
    names = [_name(v) for v in value]
    if all(names) and len(set(names)) == len(names):
        return {f"#{name}": _comparable(v) for name, v in zip(names, value, strict=True)}
    return {f"#{k}": _comparable(v) for k, v in enumerate(value)}


def _along(value: dict[str, Any]) -> dict[str, Any]:
    """Sizes along a direction, without it; of one that nothing shows no more than that."""
    if value["detected"] is None or value["mdb"] is None:
        return {"never": True}
    return {k: v for k, v in value.items() if k not in ("direction", "absorbed_by")}


def _invisible(value: dict[str, Any]) -> bool:
    return value.get("status") == "invisible" or ("mdb" in value and _never(value, "mdb"))


def _never(value: dict[str, Any], size: str) -> bool:
    """Whether a smallest size is beyond all bounds."""
    return value[size] is None or (bool(value.get("plausible")) and value[size] > _NEVER * value["plausible"])


def _name(value: Any) -> str:
    return "/".join(str(value[k]) for k in _NAMES if k in value) if isinstance(value, dict) else ""


def _bench(measures: list[dict[str, Any]]) -> dict[str, Any]:
    """What bench measurements gain, without names: of two that gain alike either may come first."""
    return {
        f"#{k}": {"sigma": m["sigma"], "after": _comparable(sorted(s["after"] for s in m["std"]))}
        for k, m in enumerate(measures)
    }


def _projector(directions: Any) -> Any:
    """Of null and of weak directions, each set by what it spans; what determines a parameter stays."""
    if not isinstance(directions, list) or not all("parameters" in d for d in directions):
        return _comparable(directions)
    out: dict[str, Any] = {"determined": _comparable([n for d in directions for n in d["determined"]])}
    for kind in sorted({d["kind"] for d in directions}):
        vectors = [d["parameters"] for d in directions if d["kind"] == kind]
        names = sorted({n for v in vectors for n in v})
        spanned = np.linalg.qr(np.array([[v.get(n, 0.0) for n in names] for v in vectors]).T)[0]
        projector = spanned @ spanned.T
        out[kind] = {f"#{n}": {f"#{m}": projector[i, j] for j, m in enumerate(names)} for i, n in enumerate(names)}
        out[f"{kind}_spread"] = {
            f"#{k}": s for k, s in enumerate(sorted(d["std_in_ranges"] or 0.0 for d in directions))
        }
    return out


def _leaves(value: Any, path: Path = ()) -> Iterator[tuple[Path, Any]]:
    if isinstance(value, dict):
        for key, inner in value.items():
            yield from _leaves(inner, (*path, key))
        if not value:
            yield path, "nothing"
    else:
        yield path, value


def _kind(path: Path) -> Path:
    return tuple("#" if k.startswith("#") else k for k in path)


def _is_number(value: Any) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool)

"""Units as a second, plain reader knows them: written from the definitions, without the program's own table."""

from __future__ import annotations

import math
import re

BASE: dict[str, tuple[float, str]] = {
    "1": (1.0, ""), "%": (1e-2, ""), "ppm": (1e-6, ""),
    "m": (1.0, "L"), "cm": (1e-2, "L"), "mm": (1e-3, "L"), "um": (1e-6, "L"), "µm": (1e-6, "L"), "μm": (1e-6, "L"),
    "nm": (1e-9, "L"), "km": (1e3, "L"), "in": (0.0254, "L"), "inch": (0.0254, "L"),
    "rad": (1.0, "A"), "mrad": (1e-3, "A"), "urad": (1e-6, "A"), "µrad": (1e-6, "A"), "μrad": (1e-6, "A"),
    "deg": (math.pi / 180, "A"), "°": (math.pi / 180, "A"), "arcmin": (math.pi / 10800, "A"),
    "arcsec": (math.pi / 648000, "A"), "rev": (2 * math.pi, "A"),
    "N": (1.0, "F"), "mN": (1e-3, "F"), "kN": (1e3, "F"), "MN": (1e6, "F"), "lbf": (4.4482216152605, "F"),
    "Nm": (1.0, "FL"), "Nmm": (1e-3, "FL"), "kNm": (1e3, "FL"), "kg": (1.0, "M"), "g": (1e-3, "M"), "t": (1e3, "M"),
    "s": (1.0, "T"), "ms": (1e-3, "T"), "min": (60.0, "T"), "h": (3600.0, "T"), "K": (1.0, "K"), "degC": (1.0, "K"),
    "°C": (1.0, "K"), "Pa": (1.0, "F/LL"), "kPa": (1e3, "F/LL"), "MPa": (1e6, "F/LL"), "GPa": (1e9, "F/LL"),
}  # fmt: skip
"""Factor to SI, and what it measures: letters above and below a stroke; F is M L / T T."""

ZERO_CELSIUS = 273.15
_PART = re.compile(r"(?P<sign>[*/ ·]?)\s*(?P<name>[A-Za-zµμ°%]+|1)(?:(?:\^|\*\*)(?P<power>-?\d)|(?P<square>[²³]))?\s*")

Powers = tuple[int, int, int, int, int]
"""Of length, mass, time, angle, temperature."""


def powers(letters: str) -> Powers:
    """The powers that letters stand for."""
    above, _, below = letters.replace("F", "MLG").partition("/")
    if "F" in letters.partition("/")[2]:
        raise ValueError(letters)
    out = dict.fromkeys("LMTAK", 0)
    for text, sign in ((above, 1), (below, -1)):
        for letter in text:
            if letter == "G":
                out["T"] -= 2 * sign
            else:
                out[letter] += sign
    return (out["L"], out["M"], out["T"], out["A"], out["K"])


def unit(text: str) -> tuple[float, Powers] | None:
    """Factor and powers of a unit such as "kN/mm"; None where a plain reader does not know it (brackets)."""
    text = text.strip()
    if text.startswith("(") and text.find(")") == len(text) - 1:
        text = text[1:-1].strip()
    factor, total, at = 1.0, (0, 0, 0, 0, 0), 0
    while at < len(text):
        match = _PART.match(text, at)
        if match is None or match["name"] not in BASE or (at == 0 and match["sign"]):
            return None
        power = int(match["power"] or {"²": 2, "³": 3}.get(match["square"] or "", 1))
        power = -power if match["sign"] == "/" else power
        scale, letters = BASE[match["name"]]
        factor *= scale**power
        total = tuple(a + power * b for a, b in zip(total, powers(letters), strict=True))  # type: ignore[assignment]
        at = match.end()
    return (factor, total) if text else None

"""Readable numbers: few significant digits, units, and never a false zero."""

from __future__ import annotations

import math
from typing import Optional

MISSING = "–"


def known(value: Optional[float]) -> bool:
    """Returns True for a finite number; False for None, NaN and infinities."""
    return value is not None and not isinstance(value, str) and math.isfinite(value)


def significant(value: Optional[float], digits: int = 3) -> str:
    """Formats `value` with this many significant digits; an exact 0 is "0", and no other value is."""
    if value is None or not known(value):
        return MISSING
    if value == 0:
        return "0"
    exponent = math.floor(math.log10(abs(value)))
    if exponent < -4 or exponent >= 7:
        return scientific(value, digits)
    rounded = round(value, digits - 1 - exponent)
    decimals = max(digits - 1 - math.floor(math.log10(abs(rounded))), 0)
    return f"{rounded:,.{decimals}f}".replace(",", "\u202f")


def scientific(value: float, digits: int = 2) -> str:
    """Formats `value` as 1.2×10⁻⁷."""
    mantissa, exponent = f"{value:.{digits - 1}e}".split("e")
    superscript = str(int(exponent)).translate(str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹"))
    return f"{mantissa}×10{superscript}"


def tick(value: float) -> str:
    """Formats a number for an axis, without redundant zeros."""
    if value == 0 or 1e-4 <= abs(value) < 1e6:
        plain = f"{value:,.4f}".rstrip("0").rstrip(".") if abs(value) < 1e3 else f"{value:,.0f}"
        return plain.replace(",", "\u202f")
    return scientific(value, 2).replace(".0×", "×").removeprefix("1×")


def percent_tick(value: float) -> str:
    """Formats a share for an axis, as a percentage."""
    return tick(float(f"{value * 100:.6g}")) + ("" if value == 0 else "\u2009%")


def ordinal(number: int) -> str:
    """Formats `3rd`, `10th`."""
    if number % 100 in (11, 12, 13):
        return f"{number}th"
    return f"{number}" + {1: "st", 2: "nd", 3: "rd"}.get(number % 10, "th")


def milliseconds(value: Optional[float]) -> str:
    """Formats a time in ms, without the unit, for columns that name it."""
    return significant(value, 3)


def count(value: Optional[float]) -> str:
    """Formats a whole number with thin spaces between thousands."""
    if value is None or not known(value):
        return MISSING
    return f"{int(value):,}".replace(",", "\u202f")


def size(value: Optional[float]) -> str:
    """Formats a number of primitives as 16k or 1.2M."""
    if value is None or not known(value):
        return MISSING
    if value >= 999_500:
        return f"{significant(value / 1e6, 3 if value >= 1e8 else 2)}M"
    if value >= 9_950:
        return f"{value / 1e3:.0f}k"
    if value >= 1_000:
        return f"{value / 1e3:.1f}".rstrip("0").rstrip(".") + "k"
    return f"{value:.0f}"


def memory(value: Optional[float]) -> str:
    """Formats bytes as B, kB or MB (powers of ten)."""
    if value is None or not known(value):
        return MISSING
    for unit, scale in (("GB", 1e9), ("MB", 1e6), ("kB", 1e3)):
        if value >= scale:
            return f"{significant(value / scale)}\u00a0{unit}"
    return f"{value:.0f}\u00a0B"


def memory_tick(value: float) -> str:
    """Formats bytes for an axis, without redundant zeros."""
    number, unit = memory(value).split("\u00a0")
    return f"{float(number.replace(chr(0x202F), '')):g}\u00a0{unit}"


def percent(value: Optional[float]) -> str:
    """Formats a share (0.012) as 1.2 %."""
    if value is None or not known(value):
        return MISSING
    return f"{significant(value * 100, 2)}\u00a0%"


def factor(value: Optional[float]) -> str:
    """Formats a ratio: two decimals around 1, three digits elsewhere."""
    if value is not None and known(value) and 0.1 <= value < 1:
        return f"{value:.2f}"
    return significant(value, 3 if value is None or value >= 1 else 2)


def plural(number: int, singular: str, many: Optional[str] = None) -> str:
    """Formats `1 frame`, `3 frames`."""
    word = singular if number == 1 else (many or singular + "s")
    return f"{count(number)} {word}"


def listing(words: list[str]) -> str:
    """Formats `a, b and c`."""
    if len(words) < 2:
        return "".join(words)
    return ", ".join(words[:-1]) + " and " + words[-1]

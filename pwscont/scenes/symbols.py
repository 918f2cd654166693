"""Names and numbers in the notation of matplotlib."""

from __future__ import annotations

import re

GREEK = {"alpha": "α", "phi": "φ"}


def symbol(name: str) -> str:
    """Return a name such as ``u_t,1``, ``alpha`` or ``u_t [mm]`` in matplotlib's notation."""
    if found := re.fullmatch(r"(.+?)(\s*\[[^\]]*\])", name):
        return f"{symbol(found[1])}{found[2]}"  # a unit stays upright
    name = GREEK.get(name, name)
    if found := re.fullmatch(r"([^\W_]+?)_(.+)", name):
        return f"${found[1]}_{{{found[2]}}}$"
    return f"${name}$" if len(name) == 1 else name


def number_of(value: float) -> str:
    """Return a number with four digits and a true minus sign."""
    return f"{value:.4g}".replace("-", "\N{MINUS SIGN}")

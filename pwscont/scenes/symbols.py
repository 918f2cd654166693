"""Names and numbers in the notation of matplotlib."""

from __future__ import annotations

import re

from pwscont.basics.quantities import spelled

#: Greek letters by their words.
GREEK = {spelled(letter): letter for letter in "αβγδεζηθικλμνξοπρστυφχψωΓΔΘΛΞΠΣΦΨΩ"}


def in_letters(words: str) -> str:
    """Return a text with Greek letters for their words, such as ``δ = 0.9`` or ``θ1``."""
    return re.sub(r"(?<![^\W_])[A-Za-z]+(?![a-z])", lambda m: GREEK.get(m[0], m[0]), words)


def in_notation(words: str) -> str:
    """Return a text with its names such as ``z_1`` in matplotlib's notation."""
    return re.sub(r"(?<!\w)[^\W_]+_\w+", lambda name: symbol(name[0]), in_letters(words))


def symbol(name: str) -> str:
    """Return a name such as ``u_t,1``, ``alpha`` or ``u_t [mm]`` in matplotlib's notation."""
    if found := re.fullmatch(r"(.+?)(\s*\[[^\]]*\])", name):
        return f"{symbol(found[1])}{found[2]}"  # a unit stays upright
    name = in_letters(name)
    if found := re.fullmatch(r"([^\W_]+?)_(.+)", name):
        return f"${found[1]}_{{{found[2]}}}$"
    return f"${name}$" if len(name) == 1 else name


def number_of(value: float) -> str:
    """Return a number with four digits and a true minus sign."""
    return f"{value:.4g}".replace("-", "\N{MINUS SIGN}")

"""Colours, widths, line styles, and names in the notation of matplotlib."""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping
from typing import Any

from pwscont.extending import number, spelled

#: The Greek letter for each word.
GREEK = {spelled(letter): letter for letter in "αβγδεζηθικλμνξοπρστυφχψωΓΔΘΛΞΠΣΦΨΩ"}


def in_letters(words: str) -> str:
    """Return a text with Greek letters in place of words, such as ``δ = 0.9`` or ``θ1``."""
    return re.sub(r"(?<![^\W_])[A-Za-z]+(?![a-z])", lambda m: GREEK.get(m[0], m[0]), words)


def in_notation(words: str) -> str:
    """Return a text with names such as ``z_1`` in matplotlib's notation."""
    return re.sub(r"(?<!\w)[^\W_]+_\w+", lambda name: symbol(name[0]), in_letters(words))


def symbol(name: str) -> str:
    """Return a name such as ``u_t,1``, ``alpha`` or ``u_t [mm]`` in matplotlib's notation."""
    if found := re.fullmatch(r"(.+?)(\s*\[[^\]]*\])", name):
        return f"{symbol(found[1])}{found[2]}"  # a unit stays upright
    name = in_letters(name)
    if found := re.fullmatch(r"([^\W_]+?)_(.+)", name):
        return f"${found[1]}_{{{found[2]}}}$"
    return f"${name}$" if len(name) == 1 else name


def number_of(value: float, interval: tuple[float, float] = (0.0, 1.0)) -> str:
    """Return a number with four digits, more far from zero, and a true minus sign."""
    return number(value, interval, 4).replace("-", "\N{MINUS SIGN}")


#: Colours that colour-blind readers tell apart (Okabe and Ito 2008), without the yellow; then dark
#: and muted colours for more branches (Tol 2021).
COLORS = (
    "#0072B2",
    "#D55E00",
    "#009E73",
    "#CC79A7",
    "#E69F00",
    "#56B4E9",
    "#000000",
    "#882255",
    "#999933",
    "#888888",
    "#332288",
    "#BBCC33",
)
#: Widths of lines in points; pieces on which the determinant is negative are thin.
WIDTH, THIN = 2.0, 0.9
#: Line styles that can be told apart; where there are more modes, all lines are solid.
LINE_STYLES: tuple[Any, ...] = (
    "-",
    "--",
    "-.",
    ":",
    (0, (9, 2)),
    (0, (5, 1.5, 1, 1.5, 1, 1.5)),
    (0, (1, 3)),
    (0, (6, 1.5, 6, 1.5, 1, 1.5)),
)


def styles_of(words: Iterable[str], wanted: Mapping[str, Any]) -> dict[str, Any]:
    """Return a line style for every mode: the wanted style, else the next free style."""
    modes = list(dict.fromkeys(words))
    chosen = {word: wanted[word] for word in modes if word in wanted}
    free = [style for style in LINE_STYLES if style not in chosen.values()]
    others = [word for word in modes if word not in chosen]
    if len(others) > len(free):
        free = ["-"] * len(others)
    named = chosen | dict(zip(others, free, strict=False))
    return {word: named[word] for word in modes}


def color_of(branch: int) -> str:
    """Return the colour of a branch."""
    return COLORS[branch % len(COLORS)]


def are_told_apart(styles: Mapping[str, Any]) -> bool:
    """Tell whether no two modes share a line style."""
    return len({repr(style) for style in styles.values()}) == len(styles)

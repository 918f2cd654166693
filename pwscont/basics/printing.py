"""How single records look in a terminal and in a notebook: a few lines for a record of any size."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from html import escape
from math import ceil, log10

from pwscont.basics.arrays import Array

#: Most unknowns of a state that are shown.
MOST_UNKNOWNS_SHOWN = 6
#: Most letters of a text, such as the label of a body with many contact nodes.
MOST_LETTERS = 72
#: The first of the default names of unknowns.
UNNAMED = ("z[0]",)
#: Significant digits of numbers for users, and of the difference of the ends of a narrow
#: interval.
DIGITS_SHOWN, DIGITS_OF_DIFFERENCE = 8, 3


def counted(count: int | float, noun: str, plural: str = "s") -> str:
    """Return a number with a noun, such as ``3 pieces``; the plural ends with ``plural``."""
    number = "infinitely many" if count == math.inf else count
    return f"{number} {noun}{'' if count == 1 else plural}"


def with_article(noun: str) -> str:
    """Return a noun with the article.

    Examples
    --------
    >>> from pwscont.extending import with_article
    >>> with_article("fold"), with_article("isolated solution")
    ('a fold', 'an isolated solution')
    """
    return f"{'an' if noun[:1].lower() in set('aeio') else 'a'} {noun}"


def short(words: str) -> str:
    """Return words that fit into a line."""
    return words if len(words) <= MOST_LETTERS else f"{words[: MOST_LETTERS - 4]} ..."


def apart(lo: float, hi: float) -> tuple[str, str]:
    """Return the ends of an interval in at least eight digits, in more where eight are equal.

    Examples
    --------
    >>> from pwscont.extending import apart
    >>> apart(0.0, 1.0), apart(1.0, 1.0 + 1e-9)
    (('0', '1'), ('1', '1.000000001'))
    """
    part = (hi - lo) / max(abs(lo), abs(hi), 1e-300)
    needed = DIGITS_OF_DIFFERENCE - log10(part) if part > 0.0 else 0.0
    digits = min(max(DIGITS_SHOWN, ceil(needed)), 17)
    return f"{lo:.{digits}g}", f"{hi:.{digits}g}"


def number(value: float, interval: tuple[float, float] = (0.0, 1.0), digits: int = 8) -> str:
    """Return a number as users read it; values of an interval far from zero get further digits."""
    lo, hi = interval
    further = int(log10(max(abs(lo), abs(hi)) / (hi - lo)))
    return f"{value:.{digits + further}g}"


def named(thing: object, *words: object) -> str:
    """Return a repr: the name of the class, and in brackets what there is to know."""
    return f"{type(thing).__name__}({', '.join(map(str, words))})"


def at(x: Array) -> str:
    """Return a point (z, alpha) in words, where the names of the unknowns are not at hand."""
    return f"alpha={x[-1]:.10g}, {state(UNNAMED, x[:-1])}"


def state(names: Sequence[str], z: Array) -> str:
    """Return the first unknowns with names, and the number of unknowns."""
    values = [f"{value:.6g}" for value in z[:MOST_UNKNOWNS_SHOWN]]
    dots = ["..."] if len(z) > MOST_UNKNOWNS_SHOWN else []
    rest = f" {len(z)} unknowns" if dots else ""
    if names[:1] == UNNAMED:
        return f"z=[{', '.join([*values, *dots])}]{rest}"
    shown = [f"{name}={value}" for name, value in zip(names, values, strict=False)]
    return ", ".join([*shown, *dots]) + rest


def card(title: str, rows: Iterable[tuple[str, object]]) -> str:
    """Return a small HTML table for notebooks."""
    lines = "".join(
        f"<tr><td>{escape(key)}</td><td>{escape(str(value))}</td></tr>" for key, value in rows
    )
    return f"<table><tr><th colspan='2'>{escape(title)}</th></tr>{lines}</table>"

"""Expressions of MATLAB, as in files of numbers, computed without running anything.

Every value is a table of numbers, shape (rows, columns); a number is a table of a single entry. Any
other operation, a matrix product for example, is refused with the line's number.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from typing import Any, NoReturn, final

import numpy as np

from pwscont import InvalidInputError
from pwscont.extending import EPS, Array, Indices

#: Tables written out in plain numbers, the largest part of a file, need no reading word by word.
TABLE = re.compile(r"\[[-+.,;\s\deEiInNfFaA]*\]")
#: A text in quotes; a quote right behind a value is a transpose.
TEXT = r"(?<![\w)\]}.'])(?:'(?:[^'\n]|'')*'(?!')|\"(?:[^\"\n]|\"\")*\"(?!\"))"
TOKEN = re.compile(
    r"(?P<space>[ \t\r\f]+)|(?P<number>(?:\d+(?:\.(?![*/^])\d*)?|\.\d+)(?:[eE][-+]?\d+)?(?!\w))"
    rf"|(?P<name>[A-Za-z]\w*)|(?P<text>{TEXT})"
    r"|(?P<sign>\.[*/^]|[=~<>]=|&&|\|\||[-+*/^()\[\]{}.,;:=<>&|~\n])"
)
CONSTANTS = {"Inf": np.inf, "inf": np.inf, "NaN": np.nan, "nan": np.nan, "pi": np.pi}
CONSTANTS |= {"true": 1.0, "false": 0.0}
FUNCTIONS: dict[str, Callable[[Array], Any]] = {
    **{name: getattr(np, name) for name in ("sin", "cos", "tan", "sqrt", "exp", "log", "abs")},
    **{f"a{name}": getattr(np, f"arc{name}") for name in ("sin", "cos", "tan")},
    **{name: getattr(np, name) for name in ("isinf", "isnan")},
    "find": lambda table: np.flatnonzero(table.ravel(order="F"))[:, np.newaxis] + 1.0,
}


def steps(first: Array, last: Array) -> Array:
    """Return a row of numbers from the first to the last, or below the last, one apart."""
    a, b = first.item(), last.item()
    return a + np.arange(np.floor(b - a + 2.0 * EPS * max(abs(a), abs(b))) + 1.0)[np.newaxis]


#: The operators, from loose binding to tight binding.
BINARY: tuple[dict[str, Callable[[Array, Array], Array]], ...] = (
    {"||": np.logical_or},
    {"&&": np.logical_and},
    {"|": np.logical_or},
    {"&": np.logical_and},
    {
        **{"<": np.less, "<=": np.less_equal, ">": np.greater, ">=": np.greater_equal},
        **{"==": np.equal, "~=": np.not_equal},
    },
    {":": steps},
    {"+": np.add, "-": np.subtract},
    {"*": np.multiply, "/": np.divide, ".*": np.multiply, "./": np.divide},
)
#: Sign that means more than an operation entry by entry -> the side that must be a number, and the
#: check of the two sides.
NEEDS_NUMBER: dict[str, tuple[str, Callable[[Array, Array], bool]]] = {
    "*": ("one side", lambda a, b: 1 in (a.size, b.size)),
    "/": ("its right", lambda a, b: b.size == 1),
    **dict.fromkeys(("^", ":", "||", "&&"), ("each side", lambda a, b: a.size == b.size == 1)),
}
ANYTHING = ("", lambda a, b: True)


@final
@dataclass(frozen=True, slots=True)
class Token:
    """A word of a file, the line of the word, and whether a space stands before the word."""

    kind: str
    text: str
    line: int
    spaced: bool
    table: Array | None = None


def tokens(text: str) -> Iterator[Token]:
    """Yield the words of a file; comments and continued lines must be gone."""
    place, line, spaced = 0, 1, False
    while place < len(text):
        if found := TABLE.match(text, place):
            table = _plain(found[0][1:-1])
            if table is not None:
                yield Token("table", found[0], line, spaced, table)
                place, line, spaced = found.end(), line + _lines(found[0]), False
                continue
        found = TOKEN.match(text, place)
        if not found:
            refuse(line, f"{text[place:].splitlines()[0]!r} is no part of a statement known here")
        kind = str(found.lastgroup)
        if kind != "space":
            yield Token(kind, found[0], line, spaced)
        place, spaced = found.end(), kind == "space"
        line += _lines(found[0])
    yield Token("sign", "\n", line, spaced)
    yield Token("end", "the end of the file", line, spaced)


def _lines(text: str) -> int:
    """Return the number of lines that end in a text; a form feed ends a continued line."""
    return text.count("\n") + text.count("\f")


def refuse(line: int, reason: str) -> NoReturn:
    """Raise an error that names a line."""
    raise InvalidInputError(f"line {line} of the case cannot be read: {reason}")


def _plain(body: str) -> Array | None:
    """Return a table of plain numbers, None if a text is more than such a table."""
    rows = [row.replace(",", " ").split() for row in re.split(r"[;\n]", body)]
    try:
        numbers = [[float(word) for word in row] for row in rows if row]
    except ValueError:
        return None
    if len({len(row) for row in numbers}) > 1:
        return None
    return np.array(numbers) if numbers else np.zeros((0, 0))


@final
class Reader:
    """Reads expressions word by word.

    Parameters
    ----------
    text : str
    known : callable
        Returns the value of a name that may have a field, as in ``mpc.bus``, or None.
    """

    def __init__(self, text: str, known: Callable[[str, str | None], Array | None]) -> None:
        self._tokens, self._place, self._known = list(tokens(text)), 0, known
        self._sizes: list[int] = []  # what `end` means in the indices that are being read
        self._in_table = False

    # -- words ---------------------------------------------------------------------------

    @property
    def next(self) -> Token:
        """The word that comes next."""
        return self._tokens[self._place]

    def take(self, *expected: str) -> Token:
        """Return the next word and go on; refuse a word that is not among the expected words."""
        token = self.next
        if expected and token.text not in expected:
            refuse(token.line, f"{token.text!r} stands where {expected[0]!r} is expected")
        self._place += token.kind != "end"
        return token

    def taken(self, *wanted: str) -> bool:
        """Go on if the next word is wanted, and return whether the word is wanted."""
        is_wanted = self.next.kind in ("sign", "name") and self.next.text in wanted
        self._place += is_wanted
        return is_wanted

    # -- expressions ---------------------------------------------------------------------

    def expression(self, level: int = 0) -> Array:
        """Return the value of the next expression."""
        if level == len(BINARY):
            return self._signed()
        value = self.expression(level + 1)
        while self.next.text in BINARY[level] and not self._begins_entry():
            token = self.take()
            value = self._combined(token, BINARY[level], value, self.expression(level + 1))
            if token.text == self.next.text == ":":
                refuse(token.line, "numbers with a step, as in 1:2:5, are not known here")
        return value

    def _begins_entry(self) -> bool:
        """Tell whether a sign belongs to the next entry, as in ``[1 -2]``."""
        after = self._tokens[self._place + 1]
        is_sign = self.next.text in "+-" and self.next.spaced and not after.spaced
        return self._in_table and is_sign

    def _combined(self, token: Token, known: Mapping[str, Any], a: Array, b: Array) -> Array:
        where, fits = NEEDS_NUMBER.get(token.text, ANYTHING)
        if not fits(a, b):
            refuse(token.line, f"{token.text!r} needs a number on {where}, and not a table")
        try:
            with np.errstate(all="ignore"):
                return np.asarray(known[token.text](1.0 * a, 1.0 * b))
        except ValueError:
            refuse(token.line, f"tables of shapes {a.shape} and {b.shape} beside {token.text!r}")

    def _signed(self) -> Array:
        if self.taken("-"):
            return -1.0 * self._signed()
        if self.taken("+"):
            return 1.0 * self._signed()
        if self.taken("~"):
            return np.logical_not(self._signed())
        value = self._atom()
        while self.next.text in ("^", ".^"):
            token = self.take()
            power = -self._atom() if self.taken("-") else self._atom()
            value = self._combined(token, {"^": np.power, ".^": np.power}, value, power)
        return value

    def _atom(self) -> Array:
        token = self.take()
        if token.table is not None:
            return token.table
        if token.kind == "number":
            return np.array([[float(token.text)]])
        if token.text == "(":
            return self._inside(self.expression, ")")
        if token.text == "[":
            return self._inside(self._table, "]", in_table=True)
        if token.kind == "name":
            return self._named(token)
        refuse(token.line, f"{token.text!r} stands where a value is expected")

    def _inside(self, read: Callable[[], Array], closing: str, in_table: bool = False) -> Array:
        """Return what stands between brackets."""
        before, self._in_table = self._in_table, in_table
        value = read()
        self._in_table = before
        self.take(closing)
        return value

    def _table(self) -> Array:
        """Return a table of entries that are expressions."""
        line = self.next.line
        rows: list[list[Array]] = [[]]
        while self.next.text != "]":
            if self.taken(";", "\n"):
                rows.append([])
            elif not self.taken(","):
                rows[-1].append(self.expression())
        try:
            return np.vstack([np.hstack(row) for row in rows if row])
        except ValueError:
            refuse(line, "the rows of this table have different lengths")

    def _named(self, token: Token) -> Array:
        """Return the value of a name, an entry of a table, or a value of a function."""
        if token.text == "end" and self._sizes:
            return np.array([[float(self._sizes[-1])]])
        field = self.take().text if self.taken(".") else None
        value = self._known(token.text, field)
        if value is not None:
            return value[self.indices(value)] if self._is_called() else value
        if field is None and token.text in CONSTANTS:
            return np.array([[CONSTANTS[token.text]]])
        if field is None and token.text in FUNCTIONS and self._is_called():
            self.take("(")
            with np.errstate(all="ignore"):
                return np.asarray(FUNCTIONS[token.text](1.0 * self._inside(self.expression, ")")))
        name = token.text if field is None else f"{token.text}.{field}"
        refuse(token.line, f"{name!r} is not known here")

    def _is_called(self) -> bool:
        return self.next.text == "(" and not (self._in_table and self.next.spaced)

    def indices(self, table: Array) -> Any:
        """Return the rows and columns that come next in round brackets."""
        line = self.take("(").line
        before, self._in_table, found = self._in_table, False, []
        for axis, closing in enumerate([",", ")"]):
            found.append(self._index(table.shape[axis], line))
            self.take(closing)
        self._in_table = before
        return np.ix_(*found)

    def _index(self, size: int, line: int) -> Indices:
        """Return places along an axis, counted from zero."""
        after = self._tokens[self._place + 1].text
        if self.next.text == ":" and after in (",", ")"):
            self.take()
            return np.arange(size)
        self._sizes.append(size)
        value = self.expression().ravel(order="F")
        self._sizes.pop()
        places = np.flatnonzero(value) if value.dtype == bool else value - 1
        if (places != np.round(places)).any() or not ((places >= 0) & (places < size)).all():
            refuse(line, f"an index that is not among 1 to {size}")
        return places.astype(np.intp)

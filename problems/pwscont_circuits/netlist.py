"""Netlists in the notation of SPICE, for the elements of this package."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import final

from pwscont import InvalidInputError
from pwscont_circuits import elements
from pwscont_circuits.circuit import Circuit
from pwscont_circuits.elements import Element
from pwscont_circuits.stamps import GROUND

NUMBER = re.compile(
    r"([+-]?(?:\d+\.?\d*|\.\d+)(?:e[+-]?\d+)?)(t|g|meg|k|m|u|\u03bc|n|p|f)?[a-wyz\u03c9]*"
)
#: A thousandth of an inch, in SPICE.
MIL = re.compile(r"[-+.\d]+(e[+-]?\d+)?mil|.*mils?$")
SUFFIXES = {"t": 1e12, "g": 1e9, "meg": 1e6, "k": 1e3, "m": 1e-3}
SUFFIXES |= {"u": 1e-6, "\u03bc": 1e-6, "n": 1e-9, "p": 1e-12, "f": 1e-15, "": 1.0}

DIODE = {"von": "threshold", "ron": "resistance", "goff": "leakage"}
TUNNEL = {
    "vp": "peak_voltage",
    "ip": "peak_current",
    "vv": "valley_voltage",
    "iv": "valley_current",
    "ron": "resistance",
}
BIPOLAR = {
    "af": "forward_alpha",
    "ar": "reverse_alpha",
    "vf": "forward_threshold",
    "vr": "reverse_threshold",
    "rf": "forward_resistance",
    "rr": "reverse_resistance",
}
MOSFET = {"vto": "threshold", "ron": "resistance"}
OPAMP = {"gain": "gain", "low": "low", "high": "high"}
#: Type of model -> letter of elements, class of elements, and SPICE's name -> name of a parameter.
MODELS: dict[str, tuple[str, Callable[..., Element], dict[str, str]]] = {
    "d": ("d", elements.Diode, DIODE),
    "tunnel": ("d", elements.TunnelDiode, TUNNEL),
    "npn": ("q", partial(elements.BipolarTransistor, kind="npn"), BIPOLAR),
    "pnp": ("q", partial(elements.BipolarTransistor, kind="pnp"), BIPOLAR),
    "nmos": ("m", partial(elements.MosfetSwitch, kind="nmos"), MOSFET),
    "pmos": ("m", partial(elements.MosfetSwitch, kind="pmos"), MOSFET),
    "opamp": ("x", elements.OpAmp, OPAMP),
}
#: Letter of elements with a value instead of a model -> class of the elements.
VALUED: dict[str, Callable[..., Element]] = {
    "r": elements.Resistor,
    "v": elements.VoltageSource,
    "i": elements.CurrentSource,
}
#: Letter of an element -> number of nodes.
ENDS = {"r": 2, "v": 2, "i": 2, "d": 2, "q": 3, "m": 3, "x": 3}


@final
@dataclass(frozen=True, slots=True)
class Netlist:
    r"""The contents of a netlist: title, circuit and sweep.

    Attributes
    ----------
    title : str
    circuit : Circuit
    sweep : tuple of (str, float, float), optional
        The source that ``.dc`` sweeps, and from where to where.

    Examples
    --------
    >>> from pwscont_circuits import parse_netlist
    >>> netlist = parse_netlist("divider\nVE a 0 1\nR1 a 0 1k\n.dc VE 0 5 0.1\n.end\n")
    >>> netlist.title, netlist.sweep
    ('divider', ('VE', 0.0, 5.0))
    """

    title: str
    circuit: Circuit
    sweep: tuple[str, float, float] | None = None


def read_netlist(path: str | Path) -> Netlist:
    """Read a netlist from a file; see :func:`parse_netlist`.

    Raises
    ------
    InvalidInputError
        If the file cannot be read, or the text is refused; the message names the file.

    Examples
    --------
    >>> from importlib.resources import files
    >>> from pwscont_circuits import read_netlist
    >>> read_netlist(files("pwscont_circuits") / "inverter.cir").title
    'CMOS inverter with a load'
    """
    try:
        return parse_netlist(Path(path).read_text(encoding="utf-8"))
    except OSError as error:
        raise InvalidInputError(f"cannot read {path}: {error.strerror}") from error
    except (InvalidInputError, UnicodeDecodeError) as error:
        raise InvalidInputError(f"netlist {path}: {error}") from error


def parse_netlist(text: str) -> Netlist:
    r"""Return the title, the circuit and the sweep of a netlist.

    The first line is the title, and lines behind ``.end`` are not read; a part of the circuit at
    these places is refused. ``*`` begins a line of comment, ``;`` a comment behind a line, and a
    line that begins with ``+`` goes on with the line before. Capital and small letters are alike.
    Numbers may have the suffixes t, g, meg, k, m, u, n, p and f, and letters of a unit after the
    suffix::

        Rname  plus minus resistance
        Vname  plus minus [DC] value            Iname  plus minus [DC] value
        Dname  anode cathode model              Qname  collector base emitter model
        Mname  drain gate source model          Xname  plus minus out model
        .model name D(von= ron= goff=)          .model name TUNNEL(vp= ip= vv= iv= ron=)
        .model name NPN(af= ar= vf= vr= rf= rr=), or PNP
        .model name NMOS(vto= ron=), or PMOS    .model name OPAMP(gain= low= high=)
        .dc source from to [step]               .end

    D is a diode or a tunnel diode, as its model says. X is an op-amp. The step of ``.dc`` is not
    used, and may be left out.

    Raises
    ------
    InvalidInputError
        If a line is not understood, which the message names, or something is wrong with the
        circuit.

    Examples
    --------
    >>> from pwscont_circuits import parse_netlist
    >>> len(parse_netlist("divider\nVE a 0 1\nR1 a b 1k\nR2 b 0 1k\n.end\n").circuit.elements)
    3
    """
    if not isinstance(text, str):
        raise InvalidInputError(
            f"a netlist must be a text, got {text!r}; read_netlist takes a path"
        )
    every = re.split("\r\n?|\n", text.removeprefix("\ufeff"))  # no other sign ends a comment
    before = next((i for i, line in enumerate(every) if line.strip()), 0)
    title, *rest = every[before:] or [""]
    reader = _Reader()
    lines = list(_lines(rest, before + 2))
    ends = (place for place, (_, words) in enumerate(lines) if " ".join(words).lower() == ".end")
    over = next(ends, len(lines))
    for cards in (True, False):  # a model may stand after elements that refer to the model
        for number, words in lines[:over]:
            if (words[0].lower() == ".model") == cards:
                _at_line(number, reader.read, words)
    for number, words in ((before + 1, _words(title) or ["*"]), *lines[over + 1 :]):
        _refuse_lost(number, words, reader)
    return Netlist(title.strip(), Circuit(reader.elements.values()), reader.sweep)


def _lines(rest: Sequence[str], first: int) -> Iterator[tuple[int, list[str]]]:
    """Yield the number and the words of each line, with the lines that go on appended."""
    found: list[tuple[int, str]] = []
    for number, line in enumerate(rest, first):
        code = line.partition(";")[0].strip()
        if code.startswith("+") and found:
            found[-1] = (found[-1][0], f"{found[-1][1]} {code[1:]}")
        elif code and not code.startswith("*"):
            found.append((number, code))
    for number, line in found:
        yield number, _words(line)


def _words(line: str) -> list[str]:
    return re.sub(r"\s*=\s*", "=", re.sub(r"[(),]", " ", line)).split()


def _refuse_lost(number: int, words: list[str], reader: _Reader) -> None:
    """Refuse a line that is not read, and would be a part of the circuit at another place."""
    try:
        reader.read(words)
    except InvalidInputError:
        return  # nearly always
    raise InvalidInputError(
        f"line {number} of the netlist, {' '.join(words)!r}, is not read: the first line is the "
        "title, and behind .end nothing is read"
    )


def _at_line(number: int, read: Callable[[list[str]], None], words: list[str]) -> None:
    try:
        read(words)
    except InvalidInputError as error:
        raise InvalidInputError(f"line {number} of the netlist: {error}") from error


def number_of(word: str) -> float:
    """Return the number that a word stands for, such as 4700 for ``4.7kOhm``."""
    plain = word.casefold()  # of both signs for micro this is the Greek letter
    match = NUMBER.fullmatch(plain)
    if match is None or MIL.match(plain):
        raise InvalidInputError(f"{word!r} is no number")
    return float(match[1]) * SUFFIXES[match[2] or ""]


@final
class _Reader:
    """The elements and models read so far."""

    def __init__(self) -> None:
        self.elements: dict[str, Element] = {}
        self.sweep: tuple[str, float, float] | None = None
        self._models: dict[str, tuple[str, Callable[..., Element]]] = {}
        self._spelling: dict[str, str] = {"gnd": GROUND}

    def read(self, words: list[str]) -> None:
        """Read a line."""
        first = words[0].lower()
        if first == ".model":
            self._read_model(words[1:])
        elif first == ".dc":
            self._read_sweep(words[1:])
        elif first[0] == ".":
            raise InvalidInputError(f"{words[0]} is not read here; .model, .dc and .end are")
        elif first[0] in ENDS:
            element = self._element(first[0], words)
            self.elements[element.name] = element
        else:
            raise InvalidInputError(
                f"no element begins with {words[0][0]!r}; there are {', '.join(ENDS).upper()}"
            )

    def _element(self, letter: str, words: list[str]) -> Element:
        name, *rest = words
        ends = [self._spelled(word) for word in rest[: ENDS[letter]]]
        rest = [word for word in rest[ENDS[letter] :] if letter == "r" or word.lower() != "dc"]
        if len(rest) != 1:
            what = "a value" if letter in VALUED else "a model"
            raise InvalidInputError(
                f"{name} needs {ENDS[letter]} nodes and {what}, got {words[1:]}"
            )
        spelled = self._spelled(name)
        if spelled in self.elements:
            raise InvalidInputError(f"the name {name} is used a second time")
        if letter in VALUED:
            return VALUED[letter](spelled, *ends, number_of(rest[0]))
        return self._modelled(letter, rest[0])(spelled, *ends)

    def _spelled(self, word: str) -> str:
        """Return a name as first written, with the same capital letters."""
        return self._spelling.setdefault(word.lower(), word)

    def _modelled(self, letter: str, model: str) -> Callable[..., Element]:
        if model.lower() not in self._models:
            raise InvalidInputError(f"there is no .model {model}")
        owner, make = self._models[model.lower()]
        if owner != letter:
            raise InvalidInputError(f"model {model} is for elements {owner.upper()}")
        return make

    def _read_model(self, words: list[str]) -> None:
        if len(words) < 2 or words[1].lower() not in MODELS:
            raise InvalidInputError(f".model needs a name and one of the types {', '.join(MODELS)}")
        letter, make, parameters = MODELS[words[1].lower()]
        given = {}
        for word in words[2:]:
            name, _, value = word.partition("=")
            if name.lower() not in parameters:
                known = ", ".join(parameters)
                raise InvalidInputError(f"{words[1]} has no parameter {name!r}; it has {known}")
            if parameters[name.lower()] in given:
                raise InvalidInputError(f"the parameter {name} is given a second time")
            given[parameters[name.lower()]] = number_of(value)
        if words[0].lower() in self._models:
            raise InvalidInputError(f"there is a second .model {words[0]}")
        self._models[words[0].lower()] = letter, partial(make, **given)

    def _read_sweep(self, words: list[str]) -> None:
        if len(words) not in (3, 4):
            raise InvalidInputError(".dc needs a source and two values, perhaps a step")
        if self.sweep:
            raise InvalidInputError("there is a second .dc; one source is swept")
        first, last, *_ = map(number_of, words[1:])
        self.sweep = self._spelled(words[0]), first, last

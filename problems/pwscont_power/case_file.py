"""Files of MATPOWER cases: the tables, and the statements behind the tables.

A case file is a function in MATLAB. Many public files hold resistances in ohm and loads in kW, and
convert the units in the last lines; read without the last lines such a case is another network.
Therefore every statement is read: values and parts of tables that are assigned, the names of
columns, and ``if`` with a condition that is known. Any other statement is refused with the line's
number.
"""

from __future__ import annotations

import re
from pathlib import Path
from typing import final

import numpy as np

from pwscont import InvalidInputError
from pwscont.extending import Array
from pwscont_power.expressions import TEXT, Reader, Token, refuse

#: The fields that are read, and fields that say nothing about the power flow: names, costs, limits
#: of the optimal power flow, results.
READ = {"baseMVA", "bus", "gen", "branch", "dcline"}
# fmt: off
BESIDE = {
    "version", "gencost", "areas", "bus_name", "gentype", "genfuel", "reserves", "dclinecost",
    "if", "iflims", "softlims", "userfcn", "A", "l", "u", "N", "H", "Cw", "fparm", "z0", "zl",
    "zu", "x", "mu", "f", "raw", "var", "lin", "nln", "om", "success", "et", "iterations",
    "order", "internal",
}
# fmt: on
#: The part of a line before a comment or three dots; a text in quotes holds no comment or dots.
CODE = re.compile(rf"(?:{TEXT}|(?!\.\.\.)[^%])*")
BRACKETS = {"(": ")", "[": "]", "{": "}"}
#: The statements that end with ``end``.
BLOCKS = {"if", "for", "parfor", "while", "switch", "try"}
#: Function that names columns -> the names with values, in the order of the returned values.
NAMES = {
    "idx_bus": "PQ=1 PV=2 REF=3 NONE=4 BUS_I=1 BUS_TYPE=2 PD=3 QD=4 GS=5 BS=6 BUS_AREA=7 VM=8 VA=9 "
    "BASE_KV=10 ZONE=11 VMAX=12 VMIN=13 LAM_P=14 LAM_Q=15 MU_VMAX=16 MU_VMIN=17",
    "idx_brch": "F_BUS=1 T_BUS=2 BR_R=3 BR_X=4 BR_B=5 RATE_A=6 RATE_B=7 RATE_C=8 TAP=9 SHIFT=10 "
    "BR_STATUS=11 PF=14 QF=15 PT=16 QT=17 MU_SF=18 MU_ST=19 ANGMIN=12 ANGMAX=13 MU_ANGMIN=20 "
    "MU_ANGMAX=21",
    "idx_gen": "GEN_BUS=1 PG=2 QG=3 QMAX=4 QMIN=5 VG=6 MBASE=7 GEN_STATUS=8 PMAX=9 PMIN=10 "
    "MU_PMAX=22 MU_PMIN=23 MU_QMAX=24 MU_QMIN=25 PC1=11 PC2=12 QC1MIN=13 QC1MAX=14 QC2MIN=15 "
    "QC2MAX=16 RAMP_AGC=17 RAMP_10=18 RAMP_30=19 RAMP_Q=20 APF=21",
    "idx_cost": "PW_LINEAR=1 POLYNOMIAL=2 MODEL=1 STARTUP=2 SHUTDOWN=3 NCOST=4 COST=5",
}


def read_case_file(file: Path) -> dict[str, Array]:
    """Return the tables of a case file, as changed by all statements of the file.

    Raises
    ------
    InvalidInputError
        If the file cannot be opened, or a statement is not known; the message gives the line.
    """
    try:
        text = file.read_text(encoding="utf-8-sig")
    except (OSError, UnicodeDecodeError) as error:
        raise InvalidInputError(f"the case cannot be read: {error}") from error
    return CaseFile(_without_comments(text)).tables()


def _without_comments(text: str) -> str:
    """Return a text with as many lines, without comments and with continued lines joined."""
    lines, depth, opened = [], 0, 0
    every = text.removesuffix("\n").split("\n")  # no other sign ends a comment
    for number, line in enumerate(every, 1):
        opened = opened if depth else number
        depth += line.strip() == "%{"
        found = CODE.match(line)
        lines.append("" if depth or not found else found[0])
        lines[-1] += " \f" if found and line[found.end() :].startswith("...") else "\n"
        depth -= depth > 0 and line.strip() == "%}"
    if depth:
        refuse(opened, "the comment that begins with '%{' has no end")
    return "".join(lines)


@final
class CaseFile:
    """The statements of a case file, carried out in order."""

    def __init__(self, text: str) -> None:
        self._names: dict[str, Array] = {}
        self._fields: dict[str, Array] = {}
        self._case, self._outputs = "mpc", ["mpc"]
        self._reader = Reader(text, self._value)
        self._is_left = False

    def tables(self) -> dict[str, Array]:
        """Return the fields of the case."""
        while self._reader.next.kind != "end" and not self._is_left:
            self._statement()
        if len(self._outputs) == 1:
            return self._fields
        return {name: self._names[name] for name in self._outputs if name in READ & {*self._names}}

    def _value(self, name: str, field: str | None) -> Array | None:
        if field is None:
            return self._names.get(name)
        return self._fields.get(field) if name == self._case else None

    # -- statements ----------------------------------------------------------------------

    def _statement(self) -> None:
        reader = self._reader
        if reader.taken(";", ",", "\n"):
            return
        if reader.next.text == "[":
            self._named_columns()
        else:
            self._begun_by(reader.take())
        if reader.next.kind != "end":
            reader.take(";", ",", "\n")

    def _begun_by(self, token: Token) -> None:
        """Carry out a statement that begins with a name."""
        reader = self._reader
        if token.text == "function":
            self._function()
        elif token.text == "if":
            if not self._holds(token.line):
                self._skipped()
        elif token.text == "define_constants":
            for names in NAMES.values():
                self._assign_names([pair.split("=")[0] for pair in names.split()], names)
        elif token.text == "return":  # MATLAB leaves the function here
            self._is_left = True
        elif token.text in ("end", "endfunction"):
            pass
        elif token.kind != "name" or reader.next.text not in (".", "=", "("):
            refuse(token.line, f"the statement that begins with {token.text!r} is not known here")
        else:
            self._assignment(token)

    def _holds(self, line: int) -> bool:
        """Tell whether a condition is true: a table with entries, all of them different from 0."""
        value = self._reader.expression()
        if np.isnan(value).any():
            refuse(line, "a condition that is not a number")
        return value.size > 0 and bool(value.all())

    def _function(self) -> None:
        """Read the names of the values that the file returns: a case, or the tables."""
        reader = self._reader
        if self._fields or self._names:
            refuse(reader.next.line, "a second function is not known here")
        self._outputs = self._named() if reader.taken("[") else [reader.take().text]
        reader.take("=")
        self._case = self._outputs[0] if len(self._outputs) == 1 else ""
        reader.take()
        if reader.taken("("):
            reader.take(")")

    def _skipped(self) -> None:
        """Pass over the statements of an ``if`` whose condition is false, up to ``end``."""
        depth, brackets, before = 1, 0, ""
        while depth:
            token = self._reader.take()
            is_other = token.text in ("else", "elseif") and depth == 1
            is_other |= token.text.startswith("end") and token.text != "end"
            is_keyword = not brackets and before != "."  # not in x(end, 1) or mpc.if
            if token.kind == "end" or (is_keyword and is_other):
                refuse(token.line, f"{token.text!r} after 'if' is not known here")
            depth += is_keyword * ((token.text in BLOCKS) - (token.text == "end"))
            brackets += (token.text in BRACKETS) - (token.text in BRACKETS.values())
            before = token.text

    def _named_columns(self) -> None:
        """Carry out ``[PQ, PV, ...] = idx_bus``."""
        reader = self._reader
        line, names = reader.take("[").line, self._named()
        reader.take("=")
        function = reader.take().text
        if function not in NAMES:
            refuse(line, f"the function {function!r} is not known here")
        self._assign_names(names, NAMES[function])

    def _named(self) -> list[str]:
        """Return the names up to a square bracket; ``~`` stands for a value that is not kept."""
        names = []
        while not self._reader.taken("]"):
            token = self._reader.take()
            if token.kind == "name" or token.text == "~":
                names.append(token.text)
            elif token.text != ",":
                refuse(token.line, f"{token.text!r} stands where a name is expected")
        return names

    def _assign_names(self, names: list[str], values: str) -> None:
        for name, pair in zip(names, values.split(), strict=False):
            self._names[name] = np.array([[float(pair.split("=")[1])]])

    def _assignment(self, token: Token) -> None:
        """Carry out an assignment to a name or a field, or to a part of a name or a field."""
        reader, values, name = self._reader, self._names, token.text
        if reader.taken("."):
            values, name = self._fields, reader.take().text
            if token.text != self._case or name not in READ | BESIDE:
                refuse(token.line, f"{token.text}.{name} is not known here")
        if name in BESIDE and values is self._fields:
            self._passed_over()
            return
        if name == self._case or not (name in values or reader.next.text == "="):
            refuse(token.line, f"a value for {name!r}, of which there is no table yet")
        if reader.taken("="):
            values[name] = reader.expression()
        else:
            values[name] = self._changed_part(values[name].copy(), token.line)

    def _changed_part(self, table: Array, line: int) -> Array:
        """Return a table after an assignment to some rows and columns."""
        part = self._reader.indices(table)
        self._reader.take("=")
        value = self._reader.expression()
        if value.size != 1 and value.shape != table[part].shape:
            refuse(line, f"values of shape {value.shape} for a part of shape {table[part].shape}")
        table[part] = value
        return table

    def _passed_over(self) -> None:
        """Pass over an assignment that says nothing about the power flow, up to its end."""
        reader, expected, signs = self._reader, list[str](), list[str]()
        while expected or reader.next.text not in (";", ",", "\n"):
            token = reader.take()
            is_wrong = token.kind == "end" or (token.text == "\n" and ")" in expected)
            if token.text == "=":
                is_wrong = "=" in signs or bool(expected)
            elif token.kind == "text":
                is_wrong = not expected and signs[-1:] != ["="]
            elif token.text in BRACKETS:
                expected.append(BRACKETS[token.text])
            elif token.text in BRACKETS.values():
                is_wrong = not expected or expected.pop() != token.text
            if is_wrong:
                refuse(token.line, f"{token.text!r} has no place in this field, which is not read")
            signs.append(token.text)

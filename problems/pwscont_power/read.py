"""Networks from MATPOWER cases and from pandapower.

Columns are those of the MATPOWER case format, version 2 (MATPOWER manual, appendix B).
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

import numpy as np

from pwscont import InvalidInputError, MissingPackageError
from pwscont.extending import Array
from pwscont_power.network import Branch, Generator, Network

#: Types of buses: the slack, and those out of service.
SLACK, ISOLATED = 3, 4
#: What pandapower gives beside the tables where it is not zero.
LOST = {"branch_g", "branch_r_asym", "branch_x_asym", "branch_g_asym", "branch_b_asym"}
#: The columns that are read of each table.
COLUMNS = {
    "bus": range(6),
    "gen": (0, 1, 2, 3, 4, 5, 7),
    "branch": (0, 1, 2, 3, 4, 8, 9, 10),
}


def from_matpower(case: Mapping[str, Any] | str | Path) -> Network:
    """Return the network of a MATPOWER case.

    Parameters
    ----------
    case : mapping, str or Path
        ``baseMVA``, ``bus``, ``gen`` and ``branch``, as in MATPOWER and PYPOWER; or a file ``.m``
        with these tables written out in numbers.

    Returns
    -------
    Network
        Per unit of ``baseMVA``. What is out of service is left out, generators at one bus are
        added up; the slack has no limits. Generators at buses without voltage control, and those
        whose reactive limits are equal, are loads of fixed power.

    Raises
    ------
    InvalidInputError
        If tables are missing, too narrow, or not finite, or there is not one slack.

    Examples
    --------
    >>> from importlib.resources import files
    >>> from pwscont_power import from_matpower
    >>> len(from_matpower(files("pwscont_power") / "data" / "case14.m").buses)
    14
    """
    tables = case if isinstance(case, Mapping) else _read(Path(case))
    bus, gen, branch = (_table(tables, name) for name in COLUMNS)
    base = float(np.squeeze(tables.get("baseMVA", 0.0)))
    if not base > 0.0:
        raise InvalidInputError(f"baseMVA must be positive, got {base}")
    bus, gen = bus[bus[:, 1] != ISOLATED], gen[gen[:, 7] > 0]
    numbers = bus[:, 0].astype(int)
    slack = numbers[bus[:, 1] == SLACK]
    if len(slack) != 1:
        raise InvalidInputError(f"one bus of type 3 is needed, the slack; there are {len(slack)}")
    controlled = numbers[bus[:, 1] > 1]
    places = {int(number): i for i, number in enumerate(numbers)}
    gen = gen[[int(row[0]) in places for row in gen]]
    held = _held(gen, controlled, int(slack[0]), base)
    generation = np.zeros(len(bus), dtype=complex)
    for row in gen:
        reactive = np.clip(row[2], row[4], row[3]) if row[0] in controlled else row[2]
        generation[places[int(row[0])]] += row[1] + 1j * (0.0 if row[0] in held else reactive)
    return Network(
        buses=tuple(numbers.tolist()),
        branches=tuple(_branches(branch, places)),
        generators=tuple(Generator(number, *three) for number, three in held.items()),
        slack=int(slack[0]),
        load=(bus[:, 2] + 1j * bus[:, 3]) / base,
        generation=generation / base,
        shunt=(bus[:, 4] + 1j * bus[:, 5]) / base,
    )


def from_pandapower(net: Any) -> Network:
    """Return the network of a pandapower net, whose extra must be installed.

    Buses have pandapower's own numbers where its conversion keeps them.

    Parameters
    ----------
    net : pandapower.pandapowerNet

    Raises
    ------
    MissingPackageError
        If pandapower is not installed.
    InvalidInputError
        As for :func:`from_matpower`.

    Examples
    --------
    >>> from pandapower.networks import case14  # doctest: +SKIP
    >>> from pwscont_power import from_pandapower
    >>> len(from_pandapower(case14()).buses)  # doctest: +SKIP
    """
    try:
        from pandapower.converter.pypower.to_ppc import to_ppc  # noqa: PLC0415  an optional package
    except ImportError as error:
        raise MissingPackageError(
            "from_pandapower needs pandapower; in a checkout of pwscont: pip install '.[power]'"
        ) from error
    case = to_ppc(net, init="flat", calculate_voltage_angles=True)
    if lost := sorted(LOST & set(case)):
        raise InvalidInputError(
            f"branches of this net have {', '.join(lost)}, for which a MATPOWER case has no place; "
            "set iron losses and asymmetries of lines and transformers to zero"
        )
    return from_matpower(case)


def _table(tables: Mapping[str, Any], name: str) -> Array:
    """Return a table of numbers."""
    if name not in tables:
        raise InvalidInputError(f"the case has no table {name!r}")
    try:
        table = np.atleast_2d(np.asarray(np.real(tables[name]), dtype=float))
    except (TypeError, ValueError) as error:
        raise InvalidInputError(f"the table {name!r} must be rows of numbers") from error
    needed = COLUMNS[name][-1] + 1
    if table.shape[1] < needed:
        raise InvalidInputError(
            f"the table {name!r} has {table.shape[1]} columns, {needed} are needed"
        )
    for column in COLUMNS[name]:
        if np.isnan(table[:, column]).any():
            row = int(np.flatnonzero(np.isnan(table[:, column]))[0])
            raise InvalidInputError(
                f"the table {name!r} has no number in row {row + 1}, column {column + 1}"
            )
    return table


def _branches(table: Array, places: Mapping[int, int]) -> Iterator[Branch]:
    """Yield the branches in service."""
    for row in table[table[:, 10] > 0]:
        start, end = int(row[0]), int(row[1])
        if start in places and end in places:
            r, x, b, tap, shift = row[[2, 3, 4, 8, 9]].tolist()
            yield Branch(start, end, r, x, b, tap or 1.0, math.radians(shift))


def _held(
    gen: Array, controlled: Array, slack: int, base: float
) -> dict[int, tuple[float, float, float]]:
    """Return voltage and reactive limits of the buses whose voltages are held.

    The slack has no limits. A generator whose limits are equal holds nothing.
    """
    held = {}
    for bus in dict.fromkeys(gen[:, 0].astype(int).tolist()):
        rows = gen[gen[:, 0] == bus]
        low, high = (
            (-np.inf, np.inf) if bus == slack else (rows[:, [4, 3]].sum(axis=0) / base).tolist()
        )
        if bus in controlled and low != high:
            held[bus] = (float(rows[0, 5]), low, high)
    return held


def _read(file: Path) -> dict[str, Any]:
    """Return the tables of a case file."""
    try:
        text = re.sub(r"%.*", "", file.read_text(encoding="utf-8"))
    except (OSError, UnicodeDecodeError) as error:
        raise InvalidInputError(f"the case cannot be read: {error}") from error
    tables: dict[str, Any] = {}
    for name, body in re.findall(r"mpc\.(\w+)\s*=\s*\[(.*?)\]", text, re.DOTALL):
        if name in COLUMNS:
            lines = filter(None, map(str.strip, re.split(r"[;\n]", body)))
            tables[name] = [_numbers(line, name) for line in lines]
    if found := re.search(r"mpc\.baseMVA\s*=\s*([^;\s]+)", text):
        (tables["baseMVA"],) = _numbers(found[1], "baseMVA")
    return tables


def _numbers(line: str, name: str) -> list[float]:
    try:
        return [float(word) for word in re.split(r"[\s,]+", line)]
    except ValueError as error:
        raise InvalidInputError(
            f"the case has a line of {name!r} that is not numbers: {line!r}"
        ) from error

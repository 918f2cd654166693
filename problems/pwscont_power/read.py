"""Networks from MATPOWER cases and from pandapower.

Columns follow the MATPOWER case format, version 2 (MATPOWER manual, appendix B).
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from pwscont import InvalidInputError, MissingPackageError
from pwscont.extending import Array
from pwscont_power.case_file import BESIDE, READ, read_case_file
from pwscont_power.network import Branch, Generator, Network

#: Types of buses: the slack, and buses out of service.
SLACK, ISOLATED = 3, 4
#: The fields that pandapower adds to a case, with a number for each branch.
CONDUCTANCE, END_SHUNT = "branch_g", ("branch_g_asym", "branch_b_asym")
#: Size of the reactive limits that stand for no limit in pandapower, in MVAr.
NO_LIMIT = 1e9
#: Table of a case -> the columns that are read.
COLUMNS = {
    "bus": range(6),
    "gen": (0, 1, 2, 3, 4, 5, 7),
    "branch": (0, 1, 2, 3, 4, 8, 9, 10),
}
#: The columns of ``gen`` that may be infinite: the reactive limits.
LIMITS = (3, 4)


def from_matpower(case: Mapping[str, Any] | str | Path) -> Network:
    """Return the network of a MATPOWER case.

    Parameters
    ----------
    case : mapping, str or Path
        ``baseMVA``, ``bus``, ``gen`` and ``branch``, as in MATPOWER and PYPOWER; or a file ``.m``
        with these tables written out in numbers. Statements behind the tables, such as the
        conversion of ohm and kW, are carried out if the statements assign values or parts of
        tables.

    Returns
    -------
    Network
        Per unit of ``baseMVA``. Parts out of service are left out, generators at the same bus are
        added up; the slack has no limits. Generators at buses without voltage control, and
        generators with equal reactive limits, are loads of fixed power.

    Raises
    ------
    InvalidInputError
        If tables are missing, too narrow, or not finite, or there is no single slack; if the case
        has parts that are not read, such as DC lines in service or a statement of another kind,
        with the line of the statement.

    Examples
    --------
    >>> from importlib.resources import files
    >>> from pwscont_power import from_matpower
    >>> len(from_matpower(files("pwscont_power") / "data" / "case14.m").buses)
    14
    """
    if not isinstance(case, Mapping | str | Path):
        raise InvalidInputError(
            f"a case is a mapping of tables or the path of a file, got {case!r}"
        )
    tables = case if isinstance(case, Mapping) else read_case_file(Path(case))
    _check_all_is_read(tables)
    bus, gen, branch = (_table(tables, name) for name in COLUMNS)
    base = _base(tables.get("baseMVA", 0.0))
    _check_buses(bus, gen, branch)
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
    extra = [_of_branches(tables, name, len(branch)) for name in (CONDUCTANCE, *END_SHUNT)]
    shunt = (bus[:, 4] + 1j * bus[:, 5]) / base
    branches = []
    for row, g, *end in zip(branch, *extra, strict=True):
        if row[10] > 0 and int(row[0]) in places and int(row[1]) in places:
            branches.append(_branch(row, g))
            shunt[places[int(row[1])]] += 0.5 * complex(*end)
    return Network(
        buses=tuple(numbers.tolist()),
        branches=tuple(branches),
        generators=tuple(Generator(number, *three) for number, three in held.items()),
        slack=int(slack[0]),
        load=(bus[:, 2] + 1j * bus[:, 3]) / base,
        generation=generation / base,
        shunt=shunt,
    )


def from_pandapower(net: Any) -> Network:
    """Return the network of a pandapower net, whose extra must be installed.

    Buses have pandapower's own numbers where the conversion keeps the numbers. Iron losses of
    transformers and conductances of lines are read. Reactive limits that are not given are
    infinite.

    Parameters
    ----------
    net : pandapower.pandapowerNet

    Raises
    ------
    MissingPackageError
        If pandapower is not installed.
    InvalidInputError
        As for :func:`from_matpower`; for loads that depend on the voltage, DC lines, elements of
        power electronics, and impedances that depend on the direction.

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
    _check_all_is_converted(net)
    case = dict(to_ppc(net, init="flat", calculate_voltage_angles=True, mode="pf"))
    in_service = case["internal"]["branch_is"]
    for name in set(case) - READ:
        if name.startswith("branch_") and len(case[name]) == len(in_service):
            case[name] = case[name][in_service]  # the converted case has no other branches
    wider = net["_options"].get("delta", 0.0)  # pandapower widens the limits by ``delta``
    limits = case["gen"][:, 3:5] - [wider, -wider]
    case["gen"][:, 3:5] = np.where(abs(limits) < NO_LIMIT, limits, np.copysign(np.inf, limits))
    return from_matpower(case)


def _check_all_is_converted(net: Any) -> None:
    """Refuse elements that pandapower leaves out of a case without a word."""
    loads = net["load"][net["load"]["in_service"]]
    shares = [name for name in loads if name.startswith("const_") and loads[name].any()]
    if shares:
        raise InvalidInputError(
            f"loads of this net depend on the voltage ({', '.join(shares)}), and only loads of "
            "constant power are read"
        )
    for name in ("dcline", "vsc_stacked"):
        if name in net and net[name]["in_service"].any():
            raise InvalidInputError(f"the net has {name!r} in service, which is not read")


def _check_all_is_read(tables: Mapping[str, Any]) -> None:
    """Refuse unknown tables; tables of results, names and costs are known."""
    known = READ | BESIDE | {CONDUCTANCE, *END_SHUNT}
    for name, table in tables.items():
        if name not in known and not name.startswith("_") and np.size(table):
            raise InvalidInputError(f"the case has {name!r}, which is not read")
    lines = np.atleast_2d(np.asarray(tables.get("dcline", ()), dtype=float))
    if lines.size and (lines.shape[1] < 3 or not (lines[:, 2] <= 0.0).all()):
        raise InvalidInputError(
            "the case has DC lines in service, in the table 'dcline', which are not read; take "
            "them out of service, as MATPOWER does by default, or write them as generators"
        )


def _base(given: Any) -> float:
    base = np.asarray(given, dtype=float)
    if base.size != 1 or not 0.0 < base.item() < np.inf:
        raise InvalidInputError(f"baseMVA must be positive, and one number, got {given}")
    return float(base.item())


def _check_buses(bus: Array, gen: Array, branch: Array) -> None:
    """Check numbers and types of buses, and that parts in service are at known buses."""
    if not np.isin(bus[:, 1], [1, 2, SLACK, ISOLATED]).all():
        raise InvalidInputError("types of buses are 1, 2, 3 and 4, in column 2 of 'bus'")
    if (bus[:, 0] != np.round(bus[:, 0])).any():
        raise InvalidInputError("numbers of buses must be whole, in column 1 of 'bus'")
    used = [gen[gen[:, 7] > 0, 0], *branch[branch[:, 10] > 0, :2].T]
    for name, ends in zip(("gen", "branch", "branch"), used, strict=True):
        if (unknown := ends[~np.isin(ends, bus[:, 0])]).size:
            raise InvalidInputError(f"{name!r} names bus {unknown[0]:g}, which 'bus' does not have")


def _of_branches(tables: Mapping[str, Any], name: str, count: int) -> Array:
    """Return a number for each branch, zero by default."""
    given = np.asarray(np.real(tables.get(name, np.zeros(count))), dtype=float)
    if given.shape != (count,) or not np.isfinite(given).all():
        raise InvalidInputError(f"{name!r} must be one finite number for each of {count} branches")
    return given


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
    limits = LIMITS if name == "gen" else ()
    for column in COLUMNS[name]:
        wrong = np.isnan if column in limits else lambda numbers: ~np.isfinite(numbers)
        if (rows := np.flatnonzero(wrong(table[:, column]))).size:
            raise InvalidInputError(
                f"the table {name!r} has no finite number in row {rows[0] + 1}, column {column + 1}"
            )
    return table


def _branch(row: Array, g: float) -> Branch:
    r, x, b, tap, shift = row[[2, 3, 4, 8, 9]].tolist()
    return Branch(int(row[0]), int(row[1]), r, x, b, tap or 1.0, math.radians(shift), float(g))


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
            if (rows[:, 5] != rows[0, 5]).any():
                raise InvalidInputError(f"generators at bus {bus} hold different voltages")
            held[bus] = (float(rows[0, 5]), low, high)
    return held

"""Files of MATPOWER cases: tables in other units, and the statements that convert them."""

import re

import numpy as np
import pytest
from pwscont_power import PowerFlow, from_matpower

from pwscont import InvalidInputError, trace

NAMES = """[PQ, PV, REF, NONE, BUS_I, BUS_TYPE, PD, QD, GS, BS, BUS_AREA, VM, ...
    VA, BASE_KV, ZONE, VMAX, VMIN, LAM_P, LAM_Q, MU_VMAX, MU_VMIN] = idx_bus;
[F_BUS, T_BUS, BR_R, BR_X, BR_B, RATE_A, RATE_B, RATE_C, ...
    TAP, SHIFT, BR_STATUS, PF, QF, PT, QT, MU_SF, MU_ST, ...  % three dots, then anything
    ANGMIN, ANGMAX, MU_ANGMIN, MU_ANGMAX] = idx_brch;
"""
BASES = "Vbase = mpc.bus(1, BASE_KV) * 1e3;      %% in Volts\nSbase = mpc.baseMVA * 1e6;\n"
#: Ways to write the same conversion: resistances from ohm, loads from kW.
CONVERSIONS = [
    NAMES
    + BASES
    + "mpc.branch(:, [BR_R BR_X]) = mpc.branch(:, [BR_R BR_X]) / (Vbase^2 / Sbase);\n"
    + "mpc.bus(:, [PD, QD]) = mpc.bus(:, [PD, QD]) / 1e3;\n",
    "define_constants;\nZ = mpc.bus(1,BASE_KV)^2/mpc.baseMVA;\n"
    "mpc.branch(:,BR_R)=mpc.branch(:,BR_R)./Z; mpc.branch(:,BR_X)=mpc.branch(:,BR_X)./Z;\n"
    "mpc.bus(1:end, PD:QD) = 1e-3*mpc.bus(:, PD:QD);",
    "kilo = 10^3;\nY = [1 -1 +1] / (mpc.bus(end - 2, 10) ^ 2 / mpc.baseMVA);\n"
    "mpc.branch(:, [3, 4]) = mpc.branch(:, 3:4) * Y(1, end);\n"
    "if 2*kilo == 2e3 & ~(kilo < 1)\n  mpc.bus(:, 3:4) = mpc.bus(:, 3:4) / kilo;\nend\n"
    "if kilo ~= 1000\n  mpc.bus(:, 3) = find(nothing(1)); if 1, end\nend\n",
    "%{\nmpc.bus(:, 3) = 0;\n%}\nS = mpc.baseMVA; V = mpc.bus(1, 10);\n"
    "mpc.branch(:, 3:4) = mpc.branch(:, 3:4) * S / V^2;\n"
    "loads = mpc.bus(:, 3) > 0 | mpc.bus(:, 4) ~= 0;\n"
    "mpc.bus(loads, [3 4]) = -(-mpc.bus(loads, [3 4])) .* [1e-3 1e-3];\nreturn;\n"
    "mpc.bus(:, 3) = 9;\n",
]


def written(table):
    return "[\n" + "".join("\t" + "\t".join(map(repr, row)) + ";\n" for row in table.tolist()) + "]"


def random_case(seed):
    """Return the tables of a line of buses, in ohm and kW, and a right case per unit and in MW."""
    rng = np.random.default_rng(seed)
    n, base, kV = int(rng.integers(3, 7)), 10.0 ** rng.integers(0, 3), rng.choice([0.4, 12.66, 110])
    bus = np.zeros((n, 13))
    bus[:, 0], bus[:, 1], bus[0, 1], bus[:, 9] = np.arange(1, n + 1), 1, 3, kV
    bus[1:, 2:4] = rng.uniform(10.0, 90.0, (n - 1, 2)) * base
    branch = np.zeros((n - 1, 13))
    branch[:, 0], branch[:, 1], branch[:, 10] = bus[:-1, 0], bus[1:, 0], 1
    branch[:, 2:4] = rng.uniform(0.01, 0.09, (n - 1, 2)) * kV**2 / base
    gen = np.array([[1.0, 0, 0, 10, -10, 1, 100, 1, 10, 0]])
    case = {"baseMVA": base, "bus": bus, "gen": gen, "branch": branch}
    right = {name: np.array(table) for name, table in case.items()}
    right["bus"][:, 2:4] /= 1e3
    right["branch"][:, 2:4] /= kV**2 / base
    return case, right


def as_file(folder, case, statements, begin="function mpc = c\n"):
    file = folder / "case.m"
    tables = (f"mpc.{name} = {written(np.atleast_2d(table))};\n" for name, table in case.items())
    file.write_text(begin + "mpc.version = '2';\n" + "".join(tables) + statements, encoding="utf-8")
    return file


@pytest.mark.parametrize("statements", CONVERSIONS)
@pytest.mark.parametrize("seed", range(3))
def test_units_are_converted_as_the_file_says(tmp_path, statements, seed):
    case, right = random_case(seed)
    found, network = from_matpower(as_file(tmp_path, case, statements)), from_matpower(right)
    np.testing.assert_allclose(found.admittance.toarray(), network.admittance.toarray(), rtol=1e-13)
    np.testing.assert_allclose(found.load, network.load, rtol=1e-14)


def test_the_nose_of_a_case_in_ohm(tmp_path):
    """Two buses, x = P = 0.1 per unit: the largest loading is 1 / (2 x P)."""
    bus = np.array([[1, 3, 0, 0, 0, 0, 1, 1, 0, 10.0], [2, 1, 1000, 0, 0, 0, 1, 1, 0, 10]])
    gen = np.array([[1, 0, 0, 10, -10, 1, 100, 1.0]])
    branch = np.array([[1, 2, 0, 1, 0, 0, 0, 0, 0, 0, 1.0]])
    case = {"baseMVA": 10.0, "bus": bus, "gen": gen, "branch": branch}
    system = PowerFlow(from_matpower(as_file(tmp_path, case, CONVERSIONS[0])))
    (nose,) = trace(system, (system.start(), 0.0), (0.0, 60.0)).special_points("fold")
    assert nose.alpha == pytest.approx(50.0, rel=1e-9)


def test_files_in_the_first_format_and_names_with_dots(tmp_path):
    case, right = random_case(0)
    tables = [f"{name} = {written(np.atleast_2d(table))};" for name, table in case.items()]
    names = "names = 1; % it's not 'read'"
    convert = CONVERSIONS[1].replace("mpc.", "")
    file = tmp_path / "old.m"
    begin = "function [baseMVA, bus, gen, branch] = old"
    file.write_text("\n".join([begin, *tables, names, convert]), encoding="utf-8")
    np.testing.assert_allclose(from_matpower(file).load, from_matpower(right).load, rtol=1e-14)
    beside = "mpc.bus_name = {\n'50% [...';\n'O''Brien (';\n};\nmpc.gencost = [2 0 0 3\n1 2 3 4];\n"
    file = as_file(tmp_path, case, beside + CONVERSIONS[0])
    np.testing.assert_allclose(from_matpower(file).load, from_matpower(right).load, rtol=1e-14)


#: Statements behind the tables, with the loads of the buses 2 and 3 that MATLAB computes, in MW.
COMPUTED = [
    ("mpc.areas = [1 1], mpc.bus(2,3) = 0;", (0, 20)),
    ("mpc.gencost = [2 0 0 3 0 1 0], mpc.bus(:,3) = mpc.bus(:,3) / 2;", (5, 10)),
    ("mpc.bus_name = {'a' 'b, c' 'it''s %'}, mpc.bus(2,3) = 5;", (5, 20)),
    ("mpc.gencost(1, 2) = mpc.gencost(1, 2) * 2, mpc.bus(2,3) = 5;", (5, 20)),
    ("if find(mpc.bus(:,3) > 1e6)\nmpc.bus(:,3) = 0;\nend", (10, 20)),
    ("if []\nmpc.bus(:,3) = 0;\nend", (10, 20)),
    ("if [1 0]\nmpc.bus(:,3) = 0;\nend", (10, 20)),
    ("if 1 | 1 && 0\nmpc.bus(:,3) = 0;\nend", (10, 20)),
    ("if 1 || 1 && 0\nmpc.bus(:,3) = 0;\nend", (0, 0)),
    ("if 0, if 1, x = 1; end, try\nx = 2;\nend, mpc.bus(:,3) = 0; end", (10, 20)),
    ("if 0, x = mpc.bus(1,end); mpc.if.map = 1; mpc.bus(3,3) = 2; end", (10, 20)),
    ("x = 1:2.7; mpc.bus(2,3) = x(1,end);", (2, 20)),
    ("x = 0.1:1.1; mpc.bus(2,3) = x(1,end);", (1.1, 20)),
    ("x = 0:-0.5; mpc.bus(x, 3) = 5;", (10, 20)),
    ("mpc.version = 'a; % b'';', mpc.bus(2,3) = 5;", (5, 20)),
    *((f"% a comment {sign} mpc.bus(2,3) = 5;", (10, 20)) for sign in "\v\f\x1c\x85\u2028"),
    ("mpc.bus(+(mpc.bus(2:3,3) > 5), 4) = 5; k = abs(1 < 2); mpc.bus(k,3) = 0;", (10, 20)),
]


@pytest.mark.parametrize(("statement", "loads"), COMPUTED)
def test_statements_mean_what_they_mean_in_matlab(tmp_path, statement, loads):
    case = random_case(0)[0]
    case["baseMVA"], case["bus"] = 1.0, case["bus"][:3]
    case["bus"][:, 2], case["branch"] = [0, 10, 20], case["branch"][:2]
    found = from_matpower(as_file(tmp_path, case, statement + "\n"))
    assert found.load.real == pytest.approx([0, *loads], abs=1e-12)


REFUSED = [
    ("%{ \nmpc.bus(2,3) = 5;", "the comment that begins with '%{' has no end"),
    ("mpc.genfuel = {'a'}'; mpc.bus(2,3) = 5; %'", "is no part of a statement"),
    ("mpc.genfuel = {'a'} '; mpc.bus(2,3) = 5; %'", "has no place in this field"),
    ("mpc.gencost = [2 0\nmpc.bus(2,3) = 5;\n];", "'=' has no place in this field"),
    ("mpc.gencost = [2 0)\nmpc.bus(2,3) = 5;", "')' has no place in this field"),
    ("mpc.gencost = 2];\nmpc.bus(2,3) = 5;", "']' has no place in this field"),
    ("mpc.gencost(1,\n2);\nmpc.bus(2,3) = 5;", "has no place in this field"),
    ("mpc.gencost = {1\n2", "'the end of the file' has no place in this field"),
    ("mpc.areas = 1 mpc.bus(2,3) = 5;", "'=' has no place in this field"),
    ("x = 2:2:4;", "numbers with a step"),
    ("if [1 0] || 1\nend", "'||' needs a number on each side"),
    ("if 0/0\nend", "a condition that is not a number"),
    ("if 0\nif 1\nendif\nend\nx = 1;\nend", "'endif' after 'if'"),
    ("[a(1), b] = idx_bus;", "'(' stands where a name is expected"),
    ("[a, b", "stands where a name is expected"),
    ("mpc.baseMVA = hundred;", "'hundred' is not known"),
    ("mpc.bus = [1 3 x];", "'x' is not known"),
    ("mpc.bus = [1 3\n1 2 3];", "the rows of this table have different lengths"),
    ("mpc = scale_load(2, mpc);", "a value for 'mpc'"),
    ("mpc.bus(:, 3) = scaled(mpc.bus(:, 3));", "'scaled' is not known"),
    ("for i = 1:3\nend", "the statement that begins with 'for' is not known"),
    ("disp('hello');", "a value for 'disp'"),
    ("mpc.bus(:, 14) = 0;", "an index that is not among 1 to 13"),
    ("mpc.bus(0, 3) = 0;", "an index that is not among 1 to 3"),
    ("mpc.bus(:, 3) = [1 2];", "values of shape (1, 2) for a part of shape (3, 1)"),
    ("mpc.bus(:, 3) = mpc.bus(:, 3) * mpc.bus(:, 4);", "'*' needs a number on one side"),
    ("mpc.bus(:, 3) = 1 / mpc.bus(:, 4);", "'/' needs a number on its right"),
    ("mpc.bus(:, 3) = mpc.bus(:, 3)';", "is no part of a statement"),
    ("x = [1; 2] + [1; 2; 3];", "tables of shapes (2, 1) and (3, 1) beside '+'"),
    ("mpc.bus(:, 3) = 2i;", "is no part of a statement"),
    ("x = 3 4;", "'4' stands where ';' is expected"),
    ("x = ;", "';' stands where a value is expected"),
    ("if 0\nx = 1;\nelse\nx = 2;\nend", "'else' after 'if'"),
    ("if 0\nx = 1;", "after 'if'"),
    ("[a, b] = idx_ct;", "the function 'idx_ct' is not known"),
    ("mpc.hvdc = [1 2];", "mpc.hvdc is not known"),
    ("s.bus = [1 2];", "s.bus is not known"),
    ("mpc.bus.x = 1;", "stands where"),
    ("function y = f(x)", "a second function is not known"),
    ("import os;", "the statement that begins with 'import' is not known"),
    ("__import__('os').system('ls')", "is no part of a statement"),
    ("x = mpc.bus(2);", "stands where ',' is expected"),
]


@pytest.mark.parametrize(("statement", "words"), REFUSED)
def test_other_statements_are_refused_by_line(tmp_path, statement, words):
    case = random_case(0)[0]
    case["bus"] = case["bus"][:3]
    file = as_file(tmp_path, case, "\n%{\n note\n%}\n" + NAMES + statement + "\n")
    lines = file.read_text(encoding="utf-8").splitlines()
    first = lines.index(statement.splitlines()[0]) + 1
    with pytest.raises(InvalidInputError, match=re.escape(words)) as caught:
        from_matpower(file)
    found = int(re.match(r"line (\d+) of the case cannot be read", str(caught.value))[1])
    assert first <= found <= first + statement.count("\n") + 1


def test_values_that_a_statement_spoils_are_refused(tmp_path):
    case, _ = random_case(0)
    for statement in ("mpc.branch(:, 3) = mpc.branch(:, 3) / 0;", "mpc.bus(2, 3) = acos(2);"):
        with pytest.raises(InvalidInputError, match="has no finite number in row"):
            from_matpower(as_file(tmp_path, case, statement))


def test_files_that_are_no_text_are_refused(tmp_path):
    file = tmp_path / "case.m"
    for content in ("% Zürich".encode("latin-1"), b"\x00\xff"):
        file.write_bytes(content)
        with pytest.raises(InvalidInputError, match="the case cannot be read"):
            from_matpower(file)
    file.write_text("", encoding="utf-8")
    with pytest.raises(InvalidInputError, match="the case has no table 'bus'"):
        from_matpower(file)

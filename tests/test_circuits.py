"""Circuits: published and hand-made answers, brute force over all segments, errors in words."""

import re
from fractions import Fraction

import numpy as np
import pytest
from circuit_cases import random_chain, random_circuit
from pwscont_circuits import (
    BipolarTransistor,
    Circuit,
    CurrentSource,
    Diode,
    MosfetSwitch,
    NonlinearResistor,
    OpAmp,
    Polyline,
    Resistor,
    TunnelDiode,
    VoltageSource,
    parse_netlist,
    read_netlist,
)
from pwscont_circuits.netlist import number_of
from pwscont_circuits.scenes import (
    INVERTER,
    chua,
    diode_ladder,
    netlist,
    schmitt_trigger,
    tunnel_diode,
)

from pwscont import InvalidInputError, UnknownNameError, check_system, explore

E = VoltageSource("E", "in", "0", 1.0)
R = Resistor("R", "in", "a", 2.0)
D = Diode("D1", "a", "0")


def at(graph, kind):
    return sorted(point.alpha for point in graph.special_points(kind))


def counts(graph):
    return [count for _, _, count in graph.multiplicity()]


# -- scenes ------------------------------------------------------------------------------


def test_the_tunnel_diode_has_three_operating_points_between_its_folds():
    graph = tunnel_diode().run()
    assert at(graph, "nonsmooth fold") == pytest.approx([6.0, 9.0], rel=1e-13)
    assert counts(graph) == [1, 3, 1]
    assert graph.guarantee == "complete"
    voltages = sorted(s["V(d)"] for s in graph.solutions(7.5))
    # 7.5 = v + 8 i(v) on each segment
    truth = [Fraction(15, 2) / 9, (Fraction(15, 2) - 12) / -3, (Fraction(15, 2) + 12) / 9]
    assert voltages == pytest.approx([float(v) for v in truth], rel=1e-12)


def test_the_schmitt_trigger_switches_where_it_must():
    graph = schmitt_trigger().run()
    folds = [1.4792248062015503, 3.2125124847178763]
    assert at(graph, "nonsmooth fold") == pytest.approx(folds, rel=1e-12)
    others = [1.742321116928447, 3.1116621622682286]
    assert at(graph, "transition") == pytest.approx(others, rel=1e-12)
    assert (len(graph.pieces), counts(graph), graph.guarantee) == (5, [1, 3, 1], "complete")
    assert set(graph.balances()) == {1}
    events = [point.message for point in graph.special_points("nonsmooth fold")]
    assert events == ["Q2 becomes active", "Q2 turns off"]


def test_chuas_circuit_has_three_operating_points():
    """Kennedy, Robust op amp realization of Chua's circuit, Frequenz 46, 1992: slopes and knots."""
    graph = chua().run()
    assert (counts(graph), graph.guarantee) == ([1, 3, 1], "complete")
    inner, outer, knot = -50.0 / 66e3, -9.0 / 22e3, 8.3 * 3.3 / 25.3
    away = (outer - inner) * knot / (1.0 / 1800.0 + outer)
    voltages = sorted(s["V(c1)"] for s in graph.solutions(0.0))
    assert voltages == pytest.approx([-away, 0.0, away], rel=1e-3, abs=1e-12)  # finite gain
    fold = knot * (1.0 + 1800.0 * inner)
    assert at(graph, "nonsmooth fold") == pytest.approx([fold, -fold], rel=1e-3)


def test_a_larger_resistor_in_chuas_circuit_leaves_the_loop_open():
    """Without op-amps' saturation the outer slope would win: at 1.2 kOhm there is one point."""
    assert counts(chua(resistance=1200.0).run()) == [1]


def ladder_voltages(E, sections, rise):
    """Return the node voltages of the ladder by trying how many diodes are on, from the first."""
    for on in range(sections + 1):
        A, b = np.zeros((sections, sections)), np.zeros(sections)
        for k in range(sections):
            A[k, k] = 1.0 + (k < sections - 1)
            if k:
                A[k, k - 1] = A[k - 1, k] = -1.0
            if k < on:
                A[k, k] += 20.0
                b[k] = 20.0 * (0.6 + k * rise)
        b[0] += E
        v = np.linalg.solve(A, b)
        beyond = v - 0.6 - rise * np.arange(sections)
        if (beyond[:on] >= -1e-12).all() and (beyond[on:] <= 1e-12).all():
            return v
    raise AssertionError("not in this order")


@pytest.mark.parametrize(
    ("sections", "rise"), [(1, 0.0), (5, 0.0), (20, 0.05), (50, 0.01), (50, 0.0)]
)
@pytest.mark.sweep(3)
def test_the_ladder_has_one_operating_point_everywhere(sections, rise):
    scene = diode_ladder(sections=sections, rise=rise)
    graph = scene.run()
    assert graph.guarantee.startswith("complete")
    assert counts(graph) == [1]
    for source in (0.3, 0.9, 2.7):
        (found,) = graph.solutions(source)
        v = [found[f"V(n{k})"] for k in range(1, sections + 1)]
        np.testing.assert_allclose(v, ladder_voltages(source, sections, rise), atol=1e-12)


@pytest.mark.parametrize("sections", [9, 16, 24, 60])
def test_behind_the_corner_of_a_ladder_every_diode_is_on(sections):
    """Currents fall to 1e-70 of the first; in rational numbers none of them is zero."""
    rng = np.random.default_rng(sections)
    series, on = 10.0 ** rng.uniform(-1.0, 1.0, (2, sections)).round(2)
    lines = ["ladder", "VE n0 0 0", ".dc VE 0 3"]
    for k, (R, ron) in enumerate(zip(series.tolist(), on.tolist(), strict=True), start=1):
        lines += [f"R{k} n{k - 1} n{k} {R!r}", f"D{k} n{k} 0 M{k}"]
        lines += [f".model M{k} D(von=0.6 ron={ron!r})"]
    circuit = parse_netlist("\n".join(lines)).circuit
    graph = explore(circuit.sweep("VE"), (0.0, 3.0))
    inner = Fraction(0)  # conductance of the sections behind, seen from the last diode on
    for R, ron in zip(series[::-1].tolist(), on[::-1].tolist(), strict=True):
        inner += 1 / Fraction(ron)
        gain = 1 / (1 + Fraction(R) * inner)  # of the rise of voltage from a diode to the next
        assert gain > 0
        inner = 1 / (Fraction(R) + 1 / inner)
    before, after = graph.pieces
    assert [p.kind for p in graph.special_points()] == ["start", "corner", "end"]
    assert (after.character.array.all(), before.character.array.any()) == (True, False)


def test_the_inverter_inverts():
    graph = netlist().run()
    assert (counts(graph), graph.guarantee) == ([1], "complete")
    low, high = graph.solutions(0.5)[0], graph.solutions(4.5)[0]
    assert low["V(out)"] == pytest.approx(5.0 * 100.0 / 102.0)  # 2k above, load 100k
    assert high["V(out)"] == pytest.approx(0.0, abs=1e-12)
    words = [graph.system.label(solution.character) for solution in (low, high)]
    assert words == ["MP on, MN off", "MP off, MN on"]


# -- elements ----------------------------------------------------------------------------


def driven(element, *more):
    """Return the system of an element between a and ground, driven through one ohm."""
    return Circuit([E, Resistor("R", "in", "a", 1.0), element, *more]).sweep("E")


def test_every_system_keeps_the_contract():
    rng = np.random.default_rng(0)
    for scene in (tunnel_diode(), schmitt_trigger(), chua(gain=20.0), diode_ladder(), netlist()):
        system = scene.system
        points = [(rng.normal(size=system.size), float(rng.normal())) for _ in range(2)]
        report = check_system(system, points)
        assert not report.defects, str(report)


def test_characteristics_are_those_of_the_formulas():
    curve = Polyline([1.0, 2.0], [1.0, -0.5, 1.0], 1.0)
    np.testing.assert_allclose(curve([-1.0, 1.0, 1.5, 2.0, 4.0]), [-1.0, 1.0, 0.75, 0.5, 2.5])
    for side, value, slope in curve.supports():
        v = np.linspace(-9.0, 9.0, 400)
        assert (side * (curve(v) - value - slope * v) >= -1e-12).all()


@pytest.mark.parametrize("kind", ["nmos", "pmos"])
def test_a_mosfet_switch_conducts_alike_in_both_directions(kind):
    sign = 1.0 if kind == "nmos" else -1.0
    gate = VoltageSource("VG", "g", "0", 3.0 * sign)
    for drain, source in (("a", "0"), ("0", "a")):
        system = driven(MosfetSwitch("M", drain, "g", source, kind, 1.0, 4.0), gate)
        graph = explore(system, (-9.0, 9.0))
        for value in (-8.0, -1.0, 0.5, 7.0):
            (found,) = graph.solutions(value)
            v, i = found["V(a)"], value - found["V(a)"]  # through one ohm
            law = max(0.0, 2.0) - max(0.0, 2.0 - sign * v)  # v_GS = 3 at the grounded end
            assert i == pytest.approx(sign * law / 4.0, abs=1e-12)


def test_a_follower_follows_up_to_its_rails():
    follower = OpAmp("X", "a", "out", "out", 1e6, -2.0, 3.0)
    graph = explore(driven(Resistor("RL", "a", "0", 1.0), follower), (-10.0, 10.0))
    for value in (-9.0, -1.0, 5.0, 9.0):
        (found,) = graph.solutions(value)
        assert found["V(out)"] == pytest.approx(np.clip(value / 2.0, -2.0, 3.0), rel=2e-6)
    assert graph.guarantee == "complete"


def test_current_sources_flow_from_plus_to_minus():
    system = Circuit([CurrentSource("I", "0", "a", 0.0), Resistor("R", "a", "0", 5.0)]).sweep("I")
    (found,) = explore(system, (0.0, 2.0)).solutions(1.0)
    assert found["V(a)"] == pytest.approx(5.0)


def test_labels_and_events_are_in_words():
    graph = diode_ladder(sections=4, rise=0.01).run()
    labels = [graph.system.label(piece.character) for piece in graph.pieces]
    assert labels[0] == "D1 to D4 off"
    assert labels[-1] == "D1, D2 on, D3, D4 off"
    assert [p.message for p in graph.special_points("transition")] == ["D1 turns on", "D2 turns on"]
    assert graph.system.test_name(1) == "D2 at 0.61"


# -- uniqueness --------------------------------------------------------------------------


def test_uniqueness_is_promised_where_it_is_true():
    assert Circuit([E, R, D]).sweep("E").unique
    assert not Circuit([E, R, TunnelDiode("T", "a", "0")]).sweep("E").unique
    assert not schmitt_trigger().system.unique
    between = [E, R, D, Diode("D2", "a", "b"), Diode("D3", "b", "0")]
    assert not Circuit(between).sweep("E").unique  # b floats while both are off
    leaky = [E, R, D, Diode("D2", "a", "b", leakage=1e-6), Diode("D3", "b", "0")]
    assert Circuit(leaky).sweep("E").unique


def check(case, sources=(-9.1, -4.3, -1.33, 0.37, 2.7, 5.1, 8.3)):
    """Compare a random circuit with brute force; return the largest number of operating points."""
    circuit, truth = case
    system = circuit.sweep("E")
    graph = explore(system, (-12.0, 12.0))
    voltages = [name for name in system.names() if name.startswith("V(")]
    order = [system.names().index(f"V(n{k + 1})") for k in range(len(voltages))]
    assert graph.is_balanced()
    for source in sources:
        wanted = truth(source).solutions()
        found = [solution.z[order] for solution in graph.solutions(source)]
        assert len(found) == len(wanted), (source, graph.guarantee)
        for v in wanted:
            assert min(np.abs(v - other).max() for other in found) < 1e-7
    return max(count for *_, count in graph.multiplicity())


@pytest.mark.parametrize("seed", range(2))
@pytest.mark.sweep(2)
def test_random_circuits_have_all_operating_points(seed):
    check(random_circuit(seed))


def test_a_chain_of_tunnel_diodes_has_all_operating_points():
    assert check(random_chain(1)) >= 5


@pytest.mark.slow
@pytest.mark.parametrize("first", range(0, 200, 40))
def test_many_random_circuits_have_all_operating_points(first):
    for seed in range(first, first + 10):
        check(random_circuit(seed))


@pytest.mark.slow
@pytest.mark.parametrize("first", range(0, 100, 20))
def test_many_chains_have_all_operating_points(first):
    assert max(check(random_chain(seed)) for seed in range(first, first + 20)) >= 9


# -- netlists ----------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("word", "value"),
    [
        ("1", 1.0),
        ("4.7kOhm", 4700.0),
        ("2MEG", 2e6),
        ("3m", 3e-3),
        ("10u", 1e-5),
        ("10\u00b5", 1e-5),
        ("10\u03bcF", 1e-5),
        ("1k\u03a9", 1e3),
        ("2M\u2126", 2e-3),
        ("1.5e3", 1500.0),
        (".5n", 5e-10),
        ("-3V", -3.0),
        ("1e-3k", 1.0),
    ],
)
def test_numbers_have_suffixes_and_units(word, value):
    assert number_of(word) == pytest.approx(value, rel=1e-15)


def test_a_netlist_with_comments_and_lines_that_go_on_is_read():
    read = parse_netlist(
        """a divider with a diode
        * a comment
        v1 IN gnd dc 5 ; another
        R1 in
        + out 1k
        D1 out 0 fast
        .MODEL Fast D ( von = 0.7,
        + ron = 10m )
        .dc V1 0 5 0.1
        .end
        this is not read"""
    )
    assert read.title == "a divider with a diode"
    assert read.sweep == ("v1", 0.0, 5.0)
    assert read.circuit.elements == (
        VoltageSource("v1", "IN", "0", 5.0),
        Resistor("R1", "IN", "out", 1000.0),
        Diode("D1", "out", "0", 0.7, 0.01),
    )


@pytest.mark.parametrize("sign", ["\v", "\f", "\x1c", "\x85", "\u2028"])
def test_only_the_end_of_a_line_ends_a_comment(sign):
    read = parse_netlist(
        f"title\r\nV1 a 0 1\rR1 a 0 1\n* no {sign} R2 a 0 1\nR3 a 0 1 ; {sign}R4 a 0 1"
    )
    assert [element.name for element in read.circuit.elements] == ["V1", "R1", "R3"]


def test_a_netlist_is_read_from_a_file(tmp_path):
    assert read_netlist(INVERTER).sweep == ("VIN", 0.0, 5.0)
    with pytest.raises(InvalidInputError, match=r"cannot read .*nothing\.cir: No such file"):
        read_netlist(tmp_path / "nothing.cir")
    without = tmp_path / "without.cir"
    without.write_text("no sweep\nV1 a 0 1\nR1 a 0 1\n", encoding="utf-8")
    with pytest.raises(InvalidInputError, match=r"needs a line \.dc"):
        netlist(str(without))


@pytest.mark.parametrize(
    ("line", "words"),
    [
        ("C1 a 0 1u", "no element begins with 'C'; there are R, V, I, D, Q, M, X"),
        ("R1 a 0 12x4", "'12x4' is no number"),
        ("R1 a 0", "R1 needs 2 nodes and a value"),
        ("R1 a 0 -5", "R1: resistance must be positive, got -5"),
        ("V0 a 0 1", "the name V0 is used a second time"),
        ("R1 a 0 1x", "'1x' is no number"),  # a million in some programs
        ("R1 a 0 10mil", "'10mil' is no number"),
        ("R1 a 0 10mils", "'10mils' is no number"),
        ("R1 a 0 1e3Millis", "'1e3Millis' is no number"),
        ("R1 a 0 1kmils", "'1kmils' is no number"),
        (".dc V0 0 5 abc", "'abc' is no number"),
        (".model T D(von=0.6 ron=1 von=0.7)", "the parameter von is given a second time"),
        (".model dd D(von=0.6)", "there is a second .model dd"),
        ("D1 a 0 what", "there is no .model what"),
        ("Q1 a b 0 DD", "model DD is for elements D"),
        (".model T NPN(bf=100)", "NPN has no parameter 'bf'; it has af, ar, vf"),
        (".model T JFET(x=1)", ".model needs a name and one of the types d, tunnel"),
        (".tran 1n 1u", ".tran is not read here"),
        (".dc V0", ".dc needs a source and two values"),
    ],
)
def test_errors_name_the_line(line, words):
    text = f"title\n.model DD D(von=0.6)\n\nV0 a 0 1\n{line}\n"
    with pytest.raises(InvalidInputError, match=re.escape(f"line 5 of the netlist: {words}")):
        parse_netlist(text)


def test_one_source_is_swept():
    with pytest.raises(InvalidInputError, match=r"line 5 of the netlist: there is a second \.dc"):
        parse_netlist("title\nV0 a 0 1\nR1 a 0 1\n.dc V0 0 1\n.dc V0 0 2\n")


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("R3 a 0 2\nV0 a 0 1\nR1 a 0 1\n", "line 1 of the netlist, 'R3 a 0 2', is not read"),
        ("\n.model D D(von=0.6)\nV0 a 0 1\n", "line 2 of the netlist, '.model D D von=0.6'"),
        ("title\nV0 a 0 1\nR1 a 0 1\n.END\n* b\nR2 a\n+ 0 1", "line 6 of the netlist, 'R2 a 0 1'"),
    ],
)
def test_no_part_of_the_circuit_is_lost_before_or_behind_the_netlist(text, words):
    with pytest.raises(InvalidInputError, match=re.escape(words)):
        parse_netlist(text)


def test_a_sweep_may_fall(tmp_path):
    file = tmp_path / "falling.cir"
    file.write_text("falling\nV1 a 0 1\nR1 a 0 1\n.dc V1 5 0 -0.1\n", encoding="utf-8")
    assert netlist(str(file)).interval == (0.0, 5.0)


def test_errors_count_lines_before_the_title():
    with pytest.raises(InvalidInputError, match="line 4 of the netlist"):
        parse_netlist("\n  \ntitle\nC1 a 0 1u\n")


# -- wrong circuits ----------------------------------------------------------------------

BACK = Resistor("RB", "a", "0", 1.0)


@pytest.mark.parametrize(
    ("elements", "words"),
    [
        ([E, R, D, Diode("D1", "in", "0")], "the name D1 is used 2 times"),
        ([E, R], "node 'a' is at R alone, which has an end in the air"),
        ([E, R, D, Resistor("R2", "otu", "a", 1.0)], "node 'otu' is at R2 alone"),
        ([E, R, D, OpAmp("X", "b", "a", "in2")], "1 node (b) without a way for current to ground"),
        ([E, R, D, CurrentSource("I", "b", "0", 1.0)], "1 node (b) without a way"),
        (
            [E, R, D, Resistor("R2", "b", "c", 1.0), Resistor("R3", "b", "c", 1.0)],
            "2 nodes (b, c) without a way",
        ),
        ([E, R, D, VoltageSource("E2", "in", "0", 2.0)], "E2 closes a loop of given voltages"),
        ([E, R, D, OpAmp("X", "a", "0", "in")], "X closes a loop of given voltages, among E, X"),
        ([VoltageSource("E", "a", "b", 1.0), Resistor("R", "a", "b", 1.0)], "connected to ground"),
        ([], "a circuit needs elements, and there are none"),
        ([E, R, "D1"], "elements must be elements of circuits, got 'D1'"),
    ],
)
def test_wrong_circuits_are_refused(elements, words):
    with pytest.raises(InvalidInputError, match=re.escape(words)):
        Circuit(elements)


@pytest.mark.parametrize(
    ("make", "words"),
    [
        (lambda: Resistor("R", "a", "0", -1.0), "R: resistance must be positive, got -1"),
        (lambda: Resistor("R", "a", "0", np.nan), "resistance of R"),
        (lambda: Diode("D", "a", "0", resistance=0.0), "D: resistance must be positive"),
        (lambda: Diode("D", "a", "0", leakage=-1.0), "D: leakage must not be negative"),
        (lambda: TunnelDiode("D", "a", "0", 2.0, 1.0, 1.0, 0.5, 1.0), "above peak_voltage"),
        (lambda: TunnelDiode("D", "a", "0", 1.0, 1.0, 2.0, 1.5, 1.0), "below peak_current"),
        (lambda: BipolarTransistor("Q", "c", "b", "e", "nnp"), "kind must be 'npn' or 'pnp'"),
        (lambda: BipolarTransistor("Q", "c", "b", "e", forward_alpha=1.0), "must be below one"),
        (lambda: OpAmp("X", "a", "b", "c", low=1.0, high=1.0), "low must be below high"),
        (lambda: Polyline([2.0, 1.0], [0.0, 1.0, 2.0]), "knots must ascend"),
        (lambda: Polyline([1.0], [0.0]), "k knots need k + 1 slopes"),
        (lambda: Resistor("R", "a", 0, 1.0), "R: minus must be a text, got 0; ground is the node"),
        (lambda: parse_netlist("a title"), "a circuit needs elements"),
        (lambda: VoltageSource("", "a", "0", 1.0), "the name of an element must be a text"),
        (lambda: diode_ladder(sections=0), "sections must be from 1 to 100000, got 0"),
        (lambda: diode_ladder(sections=99999999), "sections must be from 1 to 100000"),
    ],
)
def test_wrong_numbers_are_refused(make, words):
    with pytest.raises(InvalidInputError, match=re.escape(words)):
        make()


def test_a_circuit_says_how_large_it_is():
    assert repr(Circuit([E, R, D])) == "Circuit(3 elements, 2 nodes beside ground)"


def test_unknown_names_are_refused():
    with pytest.raises(UnknownNameError, match="no source is called 'V'; the sources are: E"):
        Circuit([E, R, D]).sweep("V")
    (found,) = explore(Circuit([E, R, D]).sweep("E"), (0.0, 1.0)).solutions(0.5)
    with pytest.raises(UnknownNameError, match=r"V\(b\)"):
        found["V(b)"]


def test_a_resistor_of_any_characteristic_may_have_negative_slopes():
    curve = Polyline([-1.0, 1.0], [-0.4, -0.8, -0.4], 0.8)
    system = driven(NonlinearResistor("N", "a", "0", curve))
    graph = explore(system, (-3.0, 3.0))
    (found,) = graph.solutions(1.0)
    assert found["V(a)"] + float(curve(found["V(a)"])) == pytest.approx(1.0)
    assert "N on segment" in graph.system.label(found.character)


@pytest.mark.parametrize(
    ("make", "words"),
    [
        (lambda: VoltageSource("E", "a", "0", "5V"), "value of E must be a number, got '5V'"),
        (lambda: NonlinearResistor("N", "a", "0", 3), "characteristic of N must be a Polyline"),
        (lambda: Resistor("R", "a", "0", "many"), "resistance of R must be a number, got 'many'"),
        (lambda: Circuit(3), "elements must be a sequence of elements, got 3"),
        (lambda: parse_netlist(3), "a netlist must be a text, got 3; read_netlist takes a path"),
    ],
)
def test_what_is_no_circuit_is_refused_in_words(make, words):
    with pytest.raises(InvalidInputError, match=words):
        make()

"""Evolutions that are proved to be the only ones."""

from dataclasses import replace

import numpy as np
import pytest
from plain_laws import Plain
from pwscont_coulomb import ContactBody, LoadHistory, QuasiStaticCoulomb

from pwscont import InvalidInputError, Stop, evolve, prove
from pwscont.evolution.graph import EvolutionGraph
from pwscont.extending import ExactRates
from pwscont.proof.prove import is_unique


def evolution(F, A=((2.0, -1.0), (-1.0, 2.0))):
    body = ContactBody(A, [[1.0, 0.0]], [[0.0, 1.0]])
    loads = [[0.0, 0.0], [1.0, 3.0], [1.0, -3.0], [0.5, 2.0]]
    return evolve(QuasiStaticCoulomb(body, LoadHistory(loads), F), (0.0, 3.0))


def least_eigenvalue(F):
    """Return the least eigenvalue of the forms of one node: F couples N A w and T w."""
    A, row = np.array([[2.0, -1.0], [-1.0, 2.0]]), np.array([2.0, -1.0])
    forms = [A - 0.5 * s * F * (np.outer([0, 1], row) + np.outer(row, [0, 1])) for s in (-1, 1)]
    return min(np.linalg.eigvalsh(form).min() for form in forms)


@pytest.mark.parametrize("F", [0.0, 0.3, 0.9, 1.4, 4.0])
def test_one_evolution_is_proved_where_forms_are_positive_definite(F):
    found = evolution(F)
    proof = prove(found)
    assert proof.holds == (least_eigenvalue(F) > 0.0 and len(found.paths()) == 1)
    assert proof.statements[0].startswith("exactly one evolution" if proof.holds else "not proved")


@pytest.mark.parametrize(("F", "is_proved"), [(1.7, True), (1.743, False)])
def test_rounding_of_the_smallest_numbers_is_counted(F, is_proved):
    """F = sqrt(3) is the limit; in multiples of 5e-324, products of F with the data are off."""
    A, rows = np.array([[2.0, -1.0], [-1.0, 2.0]]), np.eye(2)
    for unit in (1.0, *(k * 5e-324 for k in range(1, 8))):
        signs = (np.array([F]), np.array([-F]))
        holds = all(is_unique(unit * A, rows[:1], rows[1:], friction) for friction in signs)
        assert holds <= is_proved
        assert holds == is_proved or unit < 1.0


def tampered(change, found=None):
    """Return an evolution with nodes, pieces or system changed: slip+, stick, slip-, no contact."""
    found = found or evolution(0.3)
    parts = {
        "nodes": [replace(node) for node in found.nodes],
        "pieces": [replace(piece) for piece in found.pieces],
        "system": found.system,
    }
    parts |= change(**parts)
    made = parts["nodes"], parts["pieces"], found.interval, found._reader, found.quantities
    return EvolutionGraph(*made, found.guarantee, parts["system"])


def moved(part, attribute, by, number=2):
    def change(nodes, pieces, system):
        thing = {"node": nodes, "piece": pieces}[part][number]
        setattr(thing, attribute, getattr(thing, attribute) + by)
        return {}

    return change


def renamed(nodes, pieces, system):
    pieces[1].label = "slip+"
    return {}


def without_first(nodes, pieces, system):
    for piece in pieces:
        piece.start, piece.end = piece.start - 1, piece.end - 1
    return {"nodes": nodes[1:], "pieces": pieces[1:]}


def without_last(nodes, pieces, system):
    return {"nodes": nodes[:-1], "pieces": pieces[:-1]}


def without_an_event(nodes, pieces, system):
    pieces[1].end, pieces[1].last = pieces[2].end, pieces[2].last
    del pieces[2], nodes[2]
    for piece in pieces:
        piece.start, piece.end = piece.start - (piece.start > 2), piece.end - (piece.end > 2)
    return {}


def exchanged(nodes, pieces, system):
    nodes[2].t, nodes[3].t = nodes[3].t, nodes[2].t
    return {}


def of_another_body(nodes, pieces, system):
    return {"system": evolution(0.3, ((2.0, -1.0), (-1.0, 2.0 + 1e-6))).system}


def with_more_friction(nodes, pieces, system):
    return {"system": evolution(0.3 + 1e-6).system}


TAMPERED = {
    **{
        f"{part} {attribute} by {by}": moved(part, attribute, by)
        for part, attribute in [("node", "z"), ("node", "t"), ("node", "memory")]
        for by in (1e-3, -1e-6)
    },
    **{f"piece {end}": moved("piece", end, 1e-6) for end in ("first", "last")},
    "the memory of the start": moved("node", "memory", 1e-6, 0),
    **{
        change.__name__: change
        for change in (
            renamed,
            without_first,
            without_last,
            without_an_event,
            exchanged,
            of_another_body,
            with_more_friction,
        )
    },
}


def test_an_evolution_that_is_put_together_anew_is_proved():
    assert prove(tampered(lambda **parts: {})).holds


@pytest.mark.parametrize("name", TAMPERED)
def test_a_tampered_evolution_is_not_proved(name):
    proof = prove(tampered(TAMPERED[name]))
    assert not proof.holds
    assert "the piece from" in proof.open[0] or "only" in proof.open[0]


def test_the_state_with_which_an_evolution_begins_is_that_of_the_initial_slip_or_named():
    body, loads = evolution(0.3).system.body, LoadHistory([[1.0, 0.0], [1.0, 3.0]])
    system = QuasiStaticCoulomb(body, loads, 0.3)
    own = evolve(system, (0.0, 1.0))
    other = evolve(QuasiStaticCoulomb(body, loads, 0.3, slip=0.2), (0.0, 1.0))
    again, started = (
        evolve(system, (0.0, 1.0), start=each.states(0.0)[0].z) for each in (own, other)
    )
    lent = tampered(lambda **parts: {"system": system}, other)
    for found, is_named in ((own, 0), (other, 0), (again, 0), (started, 1), (lent, 1)):
        proof = prove(found)
        assert proof.holds
        assert ("from the given state" in proof.statements[0]) == is_named


def test_nodes_that_rest_are_no_rounding():
    """u_t stays 0 up to rounding, and the body is without load at first."""
    body = ContactBody([[3.0, -1.0], [-1.0, 3.0]], [[1.0, 0.0]], [[0.0, 1.0]])
    loads = LoadHistory([[0.0, 0.0], [0.0, 0.0], [4.0, 0.0], [4.0, 0.0]])
    assert prove(evolve(QuasiStaticCoulomb(body, loads, 0.28), (0.0, 3.0))).holds


def test_the_end_of_an_evolution_at_a_stop_is_named():
    system = evolution(0.3).system
    stopped = evolve(system, (0.0, 3.0), events={"stop": Stop(lambda z, t: t - 0.75)})
    assert prove(stopped).statements[0].endswith("followed up to a stop at t = 0.75")


class PlainWithRates(Plain, ExactRates):
    """The same law without an evolver of its own, with the data of the law."""

    def exact_rates(self):
        return self.system.exact_rates()


def test_evolutions_by_rays_are_proved_too():
    system = PlainWithRates(evolution(0.3).system)
    found = evolve(system, (0.0, 3.0))
    assert prove(found).holds
    assert not prove(tampered(moved("node", "z", 1e-6), found)).holds


@pytest.mark.parametrize("on", [1.0, -0.5])
@pytest.mark.parametrize("law", [lambda system: system, PlainWithRates])
def test_several_events_at_a_corner_of_the_load_are_proved_right(on, law):
    """At t = 1 two nodes reach the bound of friction, a third one leaves, and the load turns."""
    body = ContactBody(2.0 * np.eye(6), np.eye(6)[::2], np.eye(6)[1::2])
    pushed = np.array([[1.0, 0.0], [1.0, 0.5], [1.0, 0.5 + on]])
    lifted = np.array([[1.0, 0.0], [0.0, 0.0], [-2.0, 0.0]])
    system = QuasiStaticCoulomb(body, LoadHistory(np.hstack([pushed, pushed, lifted])), 0.5)
    found = evolve(law(system), (0.0, 2.0))
    assert prove(found).holds
    for t in np.linspace(0.0, 2.0, 33).tolist():
        (state,) = found.states(t)
        slid = 0.5 * max(on, 0.0) * max(t - 1.0, 0.0)
        true = [0.0, slid, 0.0, slid, min(1.0 - t, 0.0), 0.0]
        assert state.z[:6] == pytest.approx(true, abs=1e-12)


def test_a_frictionless_node_has_no_direction_of_slip():
    """Such a node may be called slip+ and move backwards."""
    found = evolution(0.0)
    assert any(piece.label == "slip+" for piece in found.pieces)
    assert prove(found).holds


def with_rates(monkeypatch, **changed):
    """Return the proof for data of other types or values."""
    found = evolution(0.3)
    rates = dict(zip("ANTF", found.system.exact_rates(), strict=True))
    new = tuple(changed.get(name, each) for name, each in rates.items())
    monkeypatch.setattr(QuasiStaticCoulomb, "exact_rates", lambda self: new)
    return prove(found)


@pytest.mark.parametrize(
    ("changed", "words"),
    [
        ({"F": np.array([np.nan])}, "finite"),
        ({"F": np.array([-0.3])}, "not negative"),
        ({"F": np.array([0.3, 0.3])}, "shapes"),
        ({"A": np.eye(3)}, "shapes"),
        ({"A": np.eye(2) * np.longdouble(1) / 3}, "no doubles"),
        ({"A": np.eye(2, dtype=complex)}, "complex"),
    ],
)
def test_rates_that_make_no_sense_are_refused(monkeypatch, changed, words):
    with pytest.raises(InvalidInputError, match=words):
        with_rates(monkeypatch, **changed)


@pytest.mark.parametrize("a", [2.0 - 2.0**-21, 2.0, 2.0 + 2.0**-22])
def test_single_precision_is_computed_in_double_precision(monkeypatch, a):
    """The form of [[1, a], [0, 1]] is positive definite for a < 2."""
    A = np.array([[1.0, a], [0.0, 1.0]], dtype=np.float32)
    assert with_rates(monkeypatch, A=A, F=np.zeros(1)).holds == (a < 2.0)

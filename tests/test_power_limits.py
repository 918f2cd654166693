"""Power flow: limit and nose in the plane, and mistakes."""

import json
import re
from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from power_parts import from_flat
from pwscont_power import Branch, Generator, PowerFlow, from_matpower
from pwscont_power.networks import three_bus as three_bus_network
from pwscont_power.scenes import three_bus_flow, three_bus_limits

from pwscont import InvalidInputError

# -- limit and nose in the plane -------------------------------------------------------------------


@cache
def plane():
    return three_bus_limits().solve((), lambda pieces, value: None)


@pytest.mark.slow
def test_limit_and_nose_meet():
    (first, second) = sorted(plane().loci.meetings.tolist())
    assert first == pytest.approx([2.87541, 2.40787], abs=1e-5)
    assert second[0] == pytest.approx(3.04506, abs=1e-5)
    crossings = [str(part.crossing) for part in plane().loci.parts]
    assert sorted(crossings) == sorted(
        ["limit, the loading goes on", "limit and nose at once", "limit, the loading goes on"]
        + 2 * ["nose"]
    )
    text = plane().as_text()
    assert "limit and nose meet at Q_max = 2.40786611, lambda = 2.87541264" in text


@pytest.mark.slow
def test_loci_pass_through_what_each_limit_has():
    for part in plane().loci.parts:
        for loading, Q_max in part.plane[3:-3:9]:
            graph = from_flat(three_bus_flow(Q_max), 0.2, 3.2)
            kinds = {
                "nose": "fold",
                "limit and nose at once": "nonsmooth fold",
                "limit, the loading goes on": "transition",
            }
            found = [p.alpha for p in graph.special_points(kinds[str(part.crossing)])]
            assert min(abs(alpha - loading) for alpha in found) < 1e-8


@pytest.mark.slow
def test_the_plane_is_written(tmp_path):
    picture, file = plane().write(tmp_path)
    assert picture.stat().st_size > 10_000
    data = json.loads(file.read_text(encoding="utf-8"))
    assert {node["locus"] for node in data["nodes"]} == {0, 1, 2}
    ids = [node["id"] for node in data["nodes"]]
    assert ids == list(range(len(ids)))


# -- mistakes --------------------------------------------------------------------------------------


CASE = {
    "baseMVA": 100.0,
    "bus": [[10, 3, 0, 0, 0, 0], [20, 2, 50, 20, 0, 5], [30, 1, 40, 10, 0, 0]],
    "gen": [
        [10, 0, 0, 0, 0, 1.02, 100, 1],
        [20, 10, 0, 30, -10, 1.01, 100, 1],
        [20, 5, 0, 20, -10, 1.01, 100, 1],
        [30, 5, 2, 0, 0, 1.0, 100, 1],
        [20, 99, 0, 99, 0, 1.0, 100, 0],
    ],
    "branch": [
        [10, 20, 0.01, 0.1, 0.02, 0, 0, 0, 0, 0, 1],
        [20, 30, 0.01, 0.1, 0.02, 0, 0, 0, 0.95, 30, 1],
        [10, 30, 0.01, 0.1, 0.02, 0, 0, 0, 0, 0, 0],
    ],
}


def test_a_case_is_read():
    network = from_matpower(CASE)
    assert (network.buses, network.slack, len(network.branches)) == ((10, 20, 30), 10, 2)
    assert network.generators[1] == Generator(20, 1.01, -0.2, 0.5)
    np.testing.assert_allclose(network.generation, [0, 0.15, 0.05 + 0.02j])
    ratio = 0.95 * np.exp(1j * np.pi / 6)
    series = 1 / (0.01 + 0.1j)
    np.testing.assert_allclose(network.admittance.toarray()[1, 2], -series / ratio.conjugate())
    np.testing.assert_allclose(network.admittance.toarray()[2, 1], -series / ratio)


def test_conductances_of_branches_are_read():
    """Iron losses, and what differs between the ends: by the rows of pandapower's matrix."""
    extra = {"branch_g": [0.04, 0.0, 9.0], "branch_g_asym": [0.02, 0, 0]}
    found, without = from_matpower(CASE | extra), from_matpower(CASE)
    change = (found.admittance - without.admittance).toarray()
    np.testing.assert_allclose(change, np.diag([0.02, 0.03, 0.0]), atol=1e-15)


WRONG = [
    ({"branch_g": [1.0]}, "'branch_g' must be one finite number for each of 3 branches"),
    ({"svc": [[1.0]]}, "the case has 'svc', which is not read"),
    ({"dcline": [[10, 20, 1, 5, 5]]}, "the case has DC lines in service"),
    ({"dcline": [[10, 20]]}, "the case has DC lines in service"),
    ({"bus": [[10, 7, 0, 0, 0, 0]]}, "types of buses are 1, 2, 3 and 4"),
    ({"bus": [[10.5, 3, 0, 0, 0, 0]]}, "numbers of buses must be whole"),
    ({"bus": CASE["bus"][:2]}, "'gen' names bus 30, which 'bus' does not have"),
    ({"branch": [[10, 20, np.inf, 0.1, 0, 0, 0, 0, 0, 0, 1]]}, "in row 1, column 3"),
    ({"gen": [[10, 0, 0, 9, -9, 1, 0, 1], [10, 0, 0, 9, -9, 2, 0, 1]]}, "hold different voltages"),
    ({"gen": None}, "the case has no table 'gen'"),
    ({"baseMVA": 0.0}, "baseMVA must be positive"),
    ({"bus": [[1, 2, 3]]}, "the table 'bus' has 3 columns, 6 are needed"),
    ({"bus": [[n, 3, 0, 0, 0, 0] for n in (10, 20, 30)]}, "one bus of type 3 is needed"),
    ({"branch": CASE["branch"][:1]}, "bus 30 is not connected to the slack, bus 10"),
    ({"branch": [[10, 20, 0, 0, 0, 0, 0, 0, 0, 0, 1]]}, "from bus 10 to bus 20 needs an impedance"),
    ({"gen": [[10, 0, 0, 0, 0, 1, 100, 1], [20, 0, 0, -1, 0, 1, 100, 1]]}, "bus 20: Q_min < Q_max"),
]


@pytest.mark.parametrize(("change", "words"), WRONG)
def test_mistakes_are_said_in_words(change, words):
    case = {name: value for name, value in (CASE | change).items() if value is not None}
    with pytest.raises(InvalidInputError, match=re.escape(words)):
        PowerFlow(from_matpower(case))


def test_more_mistakes():
    network = three_bus_network()
    for wrong in (
        lambda: PowerFlow(network, growing=[1.0, 2.0]),
        lambda: PowerFlow(network, growing=[1.0]),
        lambda: PowerFlow(network, fixed=np.nan),
    ):
        with pytest.raises(InvalidInputError, match=r"growing|fixed"):
            wrong()
    with pytest.raises(InvalidInputError, match="network must be a Network, got 3"):
        PowerFlow(3)
    for branches in ((1, 2), network.branches[0]):
        with pytest.raises(InvalidInputError, match=r"branches must be several Branch\(...\), got"):
            replace(network, branches=branches)
    for numbers in (("1.0",), (1.0, "0.0"), (1.0, 0.0, None)):
        with pytest.raises(InvalidInputError, match="generator at bus 2"):
            Generator(2, *numbers)
    with pytest.raises(
        InvalidInputError, match="x of the branch from bus 1 to bus 2 must be a num"
    ):
        Branch(1, 2, 0.0, "small")
    with pytest.raises(InvalidInputError, match="a case is a mapping of tables or the path of a"):
        from_matpower(5)
    with pytest.raises(InvalidInputError, match="there is no generator at bus 3"):
        network.with_limits(3, 0.0, 1.0)
    with pytest.raises(InvalidInputError, match="cannot be read"):
        from_matpower("no such file.m")
    with pytest.raises(InvalidInputError, match="there is no bus 9"):
        network.places([9])
    with pytest.raises(InvalidInputError, match="--at needs a scene with one parameter"):
        three_bus_limits().values([1.0])

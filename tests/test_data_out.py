"""The branch graph in other tools: networkx, pandas, JSON, names, and what users record."""

import copy
import json
import pickle
from dataclasses import replace

import networkx as nx
import numpy as np
import pytest
from data_parts import SCENES, Circle, answer_of, of_another, power, with_record
from pwscont_coulomb.scenes import fig7

from pwscont import (
    BranchGraph,
    InvalidInputError,
    InvalidSystemError,
    PwscontError,
    UnknownNameError,
    enumerate_solutions,
    explore,
    trace,
)
from pwscont.basics.quantities import Quantities


@pytest.fixture(scope="module")
def plain():
    return fig7().run()


@pytest.fixture(scope="module")
def recorded(plain):
    return with_record(plain, power=power)


@pytest.fixture(params=SCENES, ids=lambda scene: scene.__name__)
def graph(request):
    return answer_of(request.param)


def test_node_attributes(graph):
    points = {p.id: p for p in graph.special_points() if p.id >= 0}
    assert dict(graph.nx.nodes(data="alpha")) == {i: p.alpha for i, p in points.items()}
    assert nx.get_node_attributes(graph.nx, "kind") == {i: str(p.kind) for i, p in points.items()}
    assert nx.get_node_attributes(graph.nx, "message") == {i: p.message for i, p in points.items()}
    for node, z in nx.get_node_attributes(graph.nx, "z").items():
        np.testing.assert_array_equal(json.loads(z), points[node].z)


def test_edge_attributes(graph):
    assert graph.nx.number_of_edges() == len(graph.pieces)
    for a, b, key, data in graph.nx.edges(keys=True, data=True):
        piece = graph.pieces[key]
        assert {a, b} == {piece.start, piece.end}
        assert (data["alpha_lo"], data["alpha_hi"]) == piece.interval
        expected = (piece.id, piece.label, piece.det_sign, str(piece.character))
        assert tuple(data[k] for k in ("piece", "label", "det_sign", "character")) == expected


def test_everything_is_plain(graph):
    nodes, edges = graph.nx.nodes(data=True), graph.nx.edges(data=True)
    assert type(graph.nx) is nx.MultiGraph
    for data in [*(d for _, d in nodes), *(d for *_, d in edges)]:
        assert type(data) is dict
        assert {type(value) for value in data.values()} <= {str, int, float}


def test_copies_and_subgraphs_keep_the_attributes(graph):
    component = {node for piece in graph.components()[0] for node in (piece.start, piece.end)}
    other, part = graph.nx.copy(), graph.nx.subgraph(component)
    assert nx.utils.graphs_equal(other, graph.nx)
    assert set(part.nodes) == component
    assert part.number_of_edges() == len(graph.components()[0])
    assert all(data == graph.nx.nodes[node] for node, data in part.nodes(data=True))


@pytest.mark.parametrize("write", [nx.write_graphml, nx.write_graphml_xml, nx.write_gexf])
def test_written_for_other_programs(recorded, write, tmp_path):
    write(recorded.nx, tmp_path / "graph")
    assert (tmp_path / "graph").stat().st_size > 0


def test_graphml_can_be_read_back(graph, tmp_path):
    nx.write_graphml(graph.nx, tmp_path / "graph.graphml")
    again = nx.read_graphml(tmp_path / "graph.graphml", node_type=int, force_multigraph=True)
    assert dict(again.nodes(data=True)) == dict(graph.nx.nodes(data=True))
    lengths = [sorted(nx.get_edge_attributes(g, "length").values()) for g in (again, graph.nx)]
    assert lengths[0] == lengths[1]


def test_shortest_path_by_length(plain):
    pieces = plain.components()[0]
    nodes = [pieces[0].start, *(piece.end for piece in pieces)]
    assert nx.shortest_path(plain.nx, nodes[0], nodes[-1], weight="length") == nodes
    total = nx.shortest_path_length(plain.nx, nodes[0], nodes[-1], weight="length")
    assert total == pytest.approx(sum(nx.get_edge_attributes(plain.nx, "length").values()))


def test_length_of_a_closed_loop():
    """Alpha is measured by its interval, of length 4, and z by its largest magnitude, 1."""
    graph = trace(Circle(), ([1.0], 0.0), (-2.0, 2.0))
    lengths = nx.get_edge_attributes(graph.nx, "length").values()
    t = np.linspace(0.0, np.pi, 100001)
    exact = np.hypot(np.diff(np.cos(t)) / 4.0, np.diff(np.sin(t))).sum()
    assert len(lengths) == 2
    assert list(lengths) == pytest.approx([exact] * 2, rel=0.05)
    assert max(lengths) <= exact * (1.0 + 1e-9)  # chords


def test_lengths_survive_the_file(plain, tmp_path):
    plain.save(tmp_path / "graph.npz")
    loaded = BranchGraph.load(tmp_path / "graph.npz")
    assert nx.utils.graphs_equal(loaded.nx, plain.nx)


def test_drawn(graph, monkeypatch):
    monkeypatch.setenv("MPLBACKEND", "Agg")
    import matplotlib.pyplot as plt  # noqa: PLC0415  after the backend is chosen

    plt.switch_backend("Agg")
    figure, ax = plt.subplots()
    nx.draw(graph.nx, ax=ax, labels=nx.get_node_attributes(graph.nx, "kind"))
    drawn = {text.get_text() for text in ax.texts}
    plt.close(figure)
    assert drawn == set(nx.get_node_attributes(graph.nx, "kind").values())


def test_what_is_done_to_it_does_not_touch_the_graph(plain):
    graph = copy.deepcopy(plain)
    before = graph.to_dict()
    graph.nx.clear()
    assert graph.to_dict() == before
    assert [len(graph.pieces_at(p.id)) for p in graph.special_points()] == [1, 2, 2, 2, 1]


# -- names ---------------------------------------------------------------------------------------


def test_unknowns_by_name(plain):
    names = plain.system.names()
    assert plain.names == names
    for state in [*plain.special_points(), *plain.solutions(-0.7), *plain.solutions(-0.5)]:
        assert [state[name] for name in names] == state.z.tolist()


def test_unknowns_without_names_have_numbers():
    (solution, _) = explore(Circle(), (-0.5, 0.5)).solutions(0.0)
    assert solution["z[0]"] == solution.z[0]


def test_unknowns_of_enumerated_solutions():
    found = enumerate_solutions(fig7().system, -0.7)
    assert len(found) == 3
    assert [s["u_t"] for s in found] == [s.z[1] for s in found]


@pytest.mark.parametrize("error", [UnknownNameError, PwscontError, KeyError])
def test_unknown_names(recorded, error):
    with pytest.raises(error, match=r"^there is no 'u_T'; names are .*did you mean .*u_t"):
        recorded.point(0)["u_T"]
    with pytest.raises(error, match="power"):
        recorded.solutions(0.3)[0]["powr"]


@pytest.mark.parametrize(
    ("given", "meant"),
    [("u_nu", "u_ν"), ("lambda_t", "λ_t"), ("lambda_nu", "λ_ν"), ("λ_t", "λ_t"), ("u_t", "u_t")],
)
def test_greek_letters_in_words(plain, given, meant):
    solution = plain.solutions(0.3)[0]
    assert solution[given] == solution[meant]
    assert plain.point(0)[given] == plain.point(0)[meant]


def test_every_greek_letter_has_its_word():
    letters = "αβγδεζηθικλμνξοπρστυφχψωΓΔΘΛΞΠΣΦΨΩ"
    words = (
        "alpha beta gamma delta epsilon zeta eta theta iota kappa lambda mu nu xi omicron pi rho "
        "sigma tau upsilon phi chi psi omega Gamma Delta Theta Lambda Xi Pi Sigma Phi Psi Omega"
    )
    quantities = Quantities([f"{letter}_1" for letter in letters])
    z = np.arange(float(len(letters)))
    found = [quantities.value(f"{word}_1", z, 0.0) for word in words.split()]
    assert found == z.tolist()


def test_a_name_that_is_there_is_never_read_as_another():
    quantities = Quantities(["ν", "nu", "μ"], {"mu": lambda z, alpha: 7.0})
    assert [quantities.value(name, np.arange(3.0), 0.0) for name in ("nu", "ν", "mu")] == [1, 0, 7]


@pytest.mark.parametrize(
    ("names", "words"), [((), r"names\(\) must return 1 names"), ((3,), r"must return texts")]
)
def test_a_system_with_wrong_names_loses_nothing(names, words, tmp_path):
    class Misnamed(Circle):
        def names(self):
            return names

    with pytest.raises(InvalidSystemError, match=words):
        explore(Misnamed(), (-0.5, 0.5))
    graph = of_another(explore(Circle(), (-0.5, 0.5)), Misnamed())
    with pytest.raises(InvalidSystemError, match=words):
        graph.point(0)["z"]
    assert "SpecialPoint" in repr(graph.special_points())
    graph.save(tmp_path / "graph")
    assert BranchGraph.load(tmp_path / "graph").names == ("z[0]",)


# -- what users record ---------------------------------------------------------------------------


def test_recorded_on_solutions_and_points(recorded):
    for state in [*recorded.special_points(), *recorded.solutions(-0.7), *recorded.solutions(-1)]:
        assert state["power"] == power(state.z, state.alpha)
    assert nx.get_node_attributes(recorded.nx, "power")[0] == recorded.point(0)["power"]


@pytest.mark.parametrize("value", [np.float64(2.0), 2, np.array(2.0), np.float32(2.0), np.int64(2)])
def test_numbers_of_every_kind_are_floats(plain, value):
    found = with_record(plain, two=lambda z, alpha: value).point(0)["two"]
    assert (found, type(found)) == (2.0, float)


@pytest.mark.parametrize(
    "value", [None, "2", np.nan, np.inf, 1j, [1.0], np.ones(1), np.ones(300), 10**400], ids=type
)
def test_values_that_are_no_finite_float(plain, value):
    graph = with_record(plain, V14=lambda z, alpha: value)
    with pytest.raises(InvalidInputError, match=r"record 'V14' .* alpha = -2 ") as caught:
        graph.point(0)["V14"]
    assert len(str(caught.value)) < 250


def test_a_function_that_fails_loses_nothing(plain, tmp_path):
    graph = with_record(plain, bad=lambda z, alpha: 1.0 / (alpha + 2.0), power=power)
    words = r"record 'bad' failed at alpha = -2: ZeroDivisionError"
    with pytest.raises(InvalidInputError, match=words):
        graph.point(0)["bad"]
    with pytest.raises(InvalidInputError, match=words):
        graph.to_dataframe("special")
    data = json.loads(json.dumps(graph.to_dict(), allow_nan=False))
    assert data["nodes"][0]["recorded"] == {"bad": None, "power": 2.5}
    assert len(data["not_recorded"]) == 1
    assert data["nodes"][1]["recorded"]["bad"] == pytest.approx(1.0 / 1.5)
    assert graph.count(-0.7) == 3
    assert "bad" not in graph.nx.nodes[0]
    graph.save(tmp_path / "graph")
    loaded = BranchGraph.load(tmp_path / "graph")
    with pytest.raises(InvalidInputError, match=words):
        loaded.point(0)["bad"]
    assert loaded.point(0)["power"] == 2.5


def test_functions_may_work_in_place(plain):
    def spoil(z, alpha):
        z[:] = 0.0
        return 1.0

    graph = with_record(plain, spoil=spoil)
    before = graph.point(0).z.tolist()
    assert graph.point(0)["spoil"] == 1.0
    assert graph.point(0).z.tolist() == before


@pytest.mark.parametrize(
    ("record", "words"),
    [
        ({"u_t": power}, "'u_t' is taken"),
        ({"alpha": power}, "'alpha' is taken"),
        ({"label": power}, "'label' is taken"),
        ({"": power}, "not empty"),
        ({3: power}, "got 3"),
        ({"power": 1.0}, "'power' must be a function"),
        ([power], "must map names to functions"),
    ],
)
def test_records_that_do_not_fit(plain, record, words):
    with pytest.raises(InvalidInputError, match=words):
        BranchGraph(
            plain.special_points(), plain.pieces, plain.interval, system=plain.system, record=record
        )


def test_files_keep_names_and_recorded_values(recorded, tmp_path):
    recorded.save(tmp_path / "graph")
    loaded = BranchGraph.load(tmp_path / "graph")
    assert loaded.names == recorded.names
    assert loaded.to_dict() == recorded.to_dict()
    for one, other in zip(loaded.special_points(), recorded.special_points(), strict=True):
        assert (one["power"], one["u_t"]) == (other["power"], other["u_t"])
    assert loaded.solutions(-1.0)[0]["u_t"] == recorded.solutions(-1.0)[0]["u_t"]
    loaded.save(tmp_path / "again")
    assert BranchGraph.load(tmp_path / "again").to_dict() == recorded.to_dict()


def test_a_loaded_graph_records_what_it_is_given(recorded, tmp_path):
    recorded.save(tmp_path / "graph")
    loaded = BranchGraph.load(
        tmp_path / "graph", fig7().system, {"twice": lambda z, alpha: 2.0 * alpha, "power": power}
    )
    (solution,) = loaded.solutions(0.3)
    assert (solution["twice"], solution["power"]) == (0.6, power(solution.z, 0.3))
    assert loaded.point(0)["power"] == recorded.point(0)["power"]
    with pytest.raises(InvalidInputError, match="u_t"):
        BranchGraph.load(tmp_path / "graph", record={"u_t": power})


def edited(path, change):
    """Rewrite the header of a saved graph."""
    with np.load(path) as file:
        arrays = dict(file)
    header = json.loads(str(arrays["header"]))
    change(header)
    with path.open("wb") as file:
        np.savez(file, **(arrays | {"header": np.array(json.dumps(header))}))


def test_files_of_earlier_versions(plain, tmp_path):
    def forget(header):
        del header["names"]
        for node in header["nodes"]:
            del node["recorded"]

    plain.save(tmp_path / "graph")
    edited(tmp_path / "graph", forget)
    loaded = BranchGraph.load(tmp_path / "graph")
    assert loaded.names == ("z[0]", "z[1]", "z[2]", "z[3]")
    assert loaded.multiplicity() == plain.multiplicity()
    assert BranchGraph.load(tmp_path / "graph", plain.system).names == plain.names


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (lambda header: header.update(names=["u"]), "names of the header must be a list of 4"),
        (lambda header: header.update(names=[1, 2, 3, 4]), "names must be texts"),
        (lambda header: header["nodes"][0].update(recorded=3), "recorded of entry 0"),
        (lambda header: header["nodes"][0].update(recorded={"V": None}), "V of recorded of"),
    ],
)
def test_names_and_values_edited_by_hand(plain, tmp_path, change, words):
    plain.save(tmp_path / "graph")
    edited(tmp_path / "graph", change)
    with pytest.raises(PwscontError, match=words):
        BranchGraph.load(tmp_path / "graph")


@pytest.mark.parametrize("way", [copy.copy, copy.deepcopy, lambda x: pickle.loads(pickle.dumps(x))])
def test_copies_of_records(recorded, way):
    for state in (recorded.point(0), recorded.solutions(0.3)[0]):
        assert (way(state)["u_t"], way(state)["power"]) == (state["u_t"], state["power"])
    assert way(recorded).to_dict() == recorded.to_dict()


def test_a_solution_is_sent_without_its_system(recorded):
    (solution,) = recorded.solutions(0.3)
    assert len(pickle.dumps(solution)) < 2000


# -- kinds of one's own --------------------------------------------------------------------------


def test_kinds_of_ones_own(plain, tmp_path):
    points = [replace(p, kind="knot") if p.id == 3 else p for p in plain.special_points()]
    graph = BranchGraph(points, plain.pieces, plain.interval, system=plain.system)
    graph.save(tmp_path / "graph")
    for one in (graph, BranchGraph.load(tmp_path / "graph")):
        (knot,) = one.special_points("knot")
        assert (knot.id, knot.kind, one.to_dict()["nodes"][3]["kind"]) == (3, "knot", "knot")
        with pytest.raises(InvalidInputError, match=r"unknown kind 'knott'.*stopped.*knot"):
            one.special_points("knott")
    assert plain.special_points("knot") == []

"""Queries, file and presentation of the branch graph, on graphs known in closed form."""

import json
import math
import pickle
import zipfile
from itertools import pairwise

import networkx as nx
import numpy as np
import pytest
from paper_systems import CASES, ONE_NODE, contact_body
from pwscont_coulomb import AffineLoad, CoulombLoad
from reference_enumeration import solve_modes

from pwscont import LCP, BranchGraph, Character, PseudoArclength, draw_counts, explore, plot, trace
from pwscont.basics.errors import GraphFileError, InvalidInputError, SystemNeededError
from pwscont.basics.outcome import Kind
from pwscont.graph.records import Piece, Place, SpecialPoint

FREE, STICK, SLIP_PLUS, SLIP_MINUS = "no contact", "stick", "slip+", "slip-"


@pytest.fixture(scope="module")
def fig7():
    case = CASES["fig7"]
    return explore(case.system, case.interval, parameter="f_t")


@pytest.fixture(scope="module")
def curved():
    case = CASES["fig10"]
    return explore(case.system, case.interval)


# -- counting ------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("alpha", "labels"),
    [
        (-2.0, {FREE}),
        (-1.5, {FREE}),
        (-0.75, {FREE, STICK, SLIP_MINUS}),
        (-0.25, {STICK}),
        (0.0, {STICK}),
        (1.5, {SLIP_PLUS}),
        (2.0, {SLIP_PLUS}),
    ],
)
def test_which_solutions_at_regular_alphas(fig7, alpha, labels):
    found = fig7.solutions(alpha)
    assert {s.label for s in found} == labels
    assert fig7.count(alpha) == len(found) == len(labels)
    assert fig7.balance(alpha) == sum(s.det_sign for s in found) == 1
    for s in found:
        assert s.alpha == alpha
        expected = solve_modes(ONE_NODE, [0.25, alpha], 4.0, (s.label,))
        np.testing.assert_allclose(s.z, expected, rtol=0, atol=1e-14)
        assert fig7.pieces[s.piece].label == s.label
        assert fig7.pieces[s.piece].character == s.character


@pytest.mark.parametrize(
    ("alpha", "fold", "other"),
    [(-1.0, (0, 0, -0.25, 1.0), FREE), (-0.5, (0, -0.25, 0, 0), STICK)],
)
def test_at_a_nonsmooth_fold_two_solutions_meet(fig7, alpha, fold, other):
    assert fig7.count(alpha) == 2
    meeting = [s for s in fig7.solutions(alpha) if s.det_sign == 0]
    regular = [s for s in fig7.solutions(alpha) if s.det_sign != 0]
    assert [s.label for s in regular] == [other]
    np.testing.assert_allclose([s.z for s in meeting], [fold], rtol=0, atol=1e-14)
    assert fig7.balance(alpha) == 1


def test_at_a_transition_one_solution_passes(fig7):
    assert fig7.count(1.0) == len(fig7.solutions(1.0)) == 1
    (solution,) = fig7.solutions(1.0)
    np.testing.assert_allclose(solution.z, [0, 0, -0.25, -1.0], rtol=0, atol=1e-14)
    assert solution.det_sign == 1
    assert fig7.balance(1.0) == 1


def test_close_to_a_fold_both_solutions_are_told_apart(fig7):
    """The two solutions approach like the distance to the fold: no tolerance hides them."""
    assert [fig7.count(-1.0 + e) for e in (-1e-9, 1e-9)] == [1, 3]
    assert [fig7.count(-0.5 + e) for e in (-1e-9, 1e-9)] == [3, 1]


def test_multiplicity_covers_the_interval(fig7):
    table = fig7.multiplicity()
    assert table[0][0] == -2.0
    assert table[-1][1] == 2.0
    assert all(a[1] == b[0] for a, b in pairwise(table))
    np.testing.assert_allclose(table, [(-2, -1, 1), (-1, -0.5, 3), (-0.5, 2, 1)], atol=1e-14)


def test_balance_of_half_a_graph_is_not_constant(fig7):
    """Without the slip piece the sum changes, and the graph says that a branch is missing."""
    pieces = [p for p in fig7.pieces if p.label != SLIP_MINUS]
    half = BranchGraph(fig7.special_points(), pieces, fig7.interval)
    assert fig7.is_balanced()
    assert not half.is_balanced()
    assert half.balances() != fig7.balances()
    assert half.balance(-0.75) == 2


@pytest.mark.parametrize("alpha", [-2.0001, 2.0001, math.inf, math.nan])
@pytest.mark.parametrize("query", ["count", "solutions", "balance"])
def test_outside_the_interval(fig7, alpha, query):
    with pytest.raises(InvalidInputError, match="outside"):
        getattr(fig7, query)(alpha)


# -- special points ------------------------------------------------------------------------------


def test_special_points_by_kind(fig7):
    kinds = {kind: fig7.special_points(kind) for kind in ("transition", "nonsmooth fold", "fold")}
    found = {kind: sorted(p.alpha for p in points) for kind, points in kinds.items()}
    assert found["fold"] == []
    np.testing.assert_allclose(found["transition"], [1.0], atol=1e-14)
    np.testing.assert_allclose(found["nonsmooth fold"], [-1.0, -0.5], atol=1e-14)
    ends = fig7.special_points("start") + fig7.special_points("end")
    assert {p.alpha for p in ends} == {-2.0, 2.0}
    assert len(fig7.special_points()) == 5


@pytest.mark.parametrize("kind", ["folds", "", "Transition", "nonsmooth", 3])
def test_unknown_kind(fig7, kind):
    with pytest.raises(InvalidInputError, match=r"unknown kind .*nonsmooth fold"):
        fig7.special_points(kind)


def test_itineraries_are_each_other_reversed(fig7):
    (component,) = fig7.components()
    forward, backward = (fig7.itinerary(component, orientation) for orientation in (1, -1))
    assert [p.id for p in forward] == [p.id for p in backward][::-1]
    assert [p.alpha for p in forward] == pytest.approx([-2.0, -0.5, -1.0, 1.0, 2.0])


def test_start_in_the_middle_is_no_node(fig7):
    system = CASES["fig7"].system
    graph = trace(system, ((0, 0, -0.25, 0.0), 0.0), (-2.0, 2.0))
    (start,) = graph.special_points("start")
    assert start.id == -1
    assert len(graph.pieces) == len(fig7.pieces)
    assert graph.pieces[start.piece].label == STICK


# -- the networkx graph --------------------------------------------------------------------------


def test_networkx_graph(fig7):
    assert type(fig7.nx) is nx.MultiGraph
    edges = list(fig7.nx.edges(keys=True, data=True))
    assert sorted(key for _, _, key, _ in edges) == [0, 1, 2, 3]
    for a, b, key, data in edges:
        piece = fig7.pieces[key]
        assert data["piece"] == piece.id == key
        assert {a, b} == {piece.start, piece.end}
    for node, data in fig7.nx.nodes(data=True):
        assert data["alpha"] == fig7.point(node).alpha
        np.testing.assert_array_equal(json.loads(data["z"]), fig7.point(node).z)


def test_pieces_touch_their_nodes(fig7, curved):
    for graph in (fig7, curved):
        for piece in graph.pieces:
            for end, row in ((piece.start, 0), (piece.end, -1)):
                node = graph.point(end)
                expected = np.append(node.z, node.alpha)
                np.testing.assert_allclose(piece.points[row], expected, rtol=0, atol=1e-12)


def test_components_partition_the_pieces():
    case = CASES["example3"]
    graph = explore(case.system, case.interval)
    ids = [p.id for component in graph.components() for p in component]
    assert sorted(ids) == [p.id for p in graph.pieces]
    assert len(graph.components()) == nx.number_connected_components(graph.nx) == 3


def test_a_line_in_one_cell_is_one_piece():
    load = AffineLoad([0.0, -5.0], [-1.0, 0.0])
    system = CoulombLoad(contact_body(ONE_NODE), load, 0.1)
    graph = explore(system, (3.0, 4.0))
    assert [p.label for p in graph.pieces] == [FREE]
    assert graph.multiplicity() == [(3.0, 4.0, 1)]


# -- the file ------------------------------------------------------------------------------------


def assert_equal_graphs(a, b):
    assert a.interval == b.interval
    assert a.parameter == b.parameter
    for p, q in zip(a.special_points(), b.special_points(), strict=True):
        fields = [(x.id, x.kind, x.alpha, x.message, x.backward, x.piece) for x in (p, q)]
        assert fields[0] == fields[1]
        np.testing.assert_array_equal(p.z, q.z)
    for p, q in zip(a.pieces, b.pieces, strict=True):
        fields = [(x.id, x.start, x.end, x.character, x.label, x.det_sign) for x in (p, q)]
        assert fields[0] == fields[1]
        np.testing.assert_array_equal(p.points, q.points)
    assert a.to_dict() == b.to_dict()


@pytest.mark.parametrize("name", ["fig7", "fig10", "fig12", "example1", "example3"])
def test_round_trip(name, tmp_path):
    case = CASES[name]
    graph = explore(case.system, case.interval, parameter="load α")
    graph.save(tmp_path / "graph")
    assert_equal_graphs(BranchGraph.load(tmp_path / "graph"), graph)
    assert [path.name for path in tmp_path.iterdir()] == ["graph"]  # nothing left behind


def test_round_trip_of_a_start_within_a_piece(tmp_path):
    graph = trace(CASES["fig7"].system, ((0, 0, -0.25, 0.0), 0.0), (-2.0, 2.0))
    graph.save(str(tmp_path / "graph.npz"))
    assert_equal_graphs(BranchGraph.load(str(tmp_path / "graph.npz")), graph)


def test_round_trip_of_an_empty_graph(tmp_path):
    BranchGraph([], [], (0.0, 1.0)).save(tmp_path / "graph")
    loaded = BranchGraph.load(tmp_path / "graph")
    assert loaded.pieces == ()
    assert loaded.multiplicity() == [(0.0, 1.0, 0)]


def test_saving_replaces_the_old_file(fig7, curved, tmp_path):
    curved.save(tmp_path / "graph")
    fig7.save(tmp_path / "graph")
    assert_equal_graphs(BranchGraph.load(tmp_path / "graph"), fig7)


def test_the_file_holds_no_pickle(curved, tmp_path):
    curved.save(tmp_path / "graph")
    with zipfile.ZipFile(tmp_path / "graph") as file:
        for entry in file.namelist():
            content = file.read(entry)
            assert content.startswith(b"\x93NUMPY")
            assert b"'|O'" not in content  # numpy's word for pickled objects


@pytest.fixture
def saved(fig7, tmp_path):
    fig7.save(tmp_path / "graph")
    return tmp_path / "graph"


@pytest.mark.parametrize("part", [0.0, 0.01, 0.3, 0.5, 0.9, 0.99])
def test_truncated_file(saved, part):
    content = saved.read_bytes()
    saved.write_bytes(content[: int(part * len(content))])
    with pytest.raises(GraphFileError, match="graph"):
        BranchGraph.load(saved)


@pytest.mark.slow
def test_flipped_bytes(saved, fig7):
    """A zip checks its entries: no damaged byte gives another graph silently."""
    content, refused = saved.read_bytes(), 0
    for position in range(0, len(content), 11):
        damaged = bytearray(content)
        damaged[position] ^= 0xFF
        saved.write_bytes(bytes(damaged))
        try:
            loaded = BranchGraph.load(saved)
        except GraphFileError:
            refused += 1
        else:
            assert_equal_graphs(loaded, fig7)  # a byte that carries nothing, such as a date
    assert refused > 0.7 * len(content) / 11


@pytest.mark.parametrize(
    "content", [b"", b"no graph at all\n", b"\x00" * 200, b"PK\x03\x04", b'{"format": 1}']
)
def test_foreign_content(tmp_path, content):
    (tmp_path / "graph").write_bytes(content)
    with pytest.raises(GraphFileError, match="graph"):
        BranchGraph.load(tmp_path / "graph")


def test_foreign_arrays(tmp_path):
    np.savez(tmp_path / "graph.npz", header=np.array("{}"), points=np.zeros(3))
    with pytest.raises(GraphFileError, match=r"graph\.npz"):
        BranchGraph.load(tmp_path / "graph.npz")
    np.save(tmp_path / "graph.npy", np.zeros(3))
    with pytest.raises(GraphFileError, match=r"graph\.npy"):
        BranchGraph.load(tmp_path / "graph.npy")


class Touch:
    """Writes a file when unpickled: what a malicious file would do."""

    def __init__(self, path):
        self.path = path

    def __reduce__(self):
        return open, (self.path, "w")


def test_pickled_content_is_refused_and_not_run(tmp_path):
    trace_file = tmp_path / "was run"
    (tmp_path / "graph").write_bytes(pickle.dumps(Touch(str(trace_file))))
    np.savez(tmp_path / "arrays.npz", header=np.array([Touch(str(trace_file))], dtype=object))
    for name in ("graph", "arrays.npz"):
        with pytest.raises(GraphFileError):
            BranchGraph.load(tmp_path / name)
    assert not trace_file.exists()


def rewritten(saved, **changes):
    """Save the same arrays with fields of the header changed."""
    with np.load(saved) as file:
        arrays = dict(file)
    header = json.loads(str(arrays["header"])) | changes
    with saved.open("wb") as file:
        np.savez(file, **(arrays | {"header": np.array(json.dumps(header))}))


@pytest.mark.parametrize(
    "changes",
    [
        {"format": "a picture"},
        {"version": 99},
        {"nodes": []},
        {"pieces": [{"id": 0}]},
        {"interval": [0.0]},
        {"interval": None},
        {"nodes": "none"},
        {"starts": 3},
    ],
    ids=lambda changes: "-".join(f"{k}={v}" for k, v in changes.items())[:30],
)
def test_wrong_header(saved, changes):
    rewritten(saved, **changes)
    with pytest.raises(GraphFileError, match="graph"):
        BranchGraph.load(saved)


def test_missing_file(tmp_path):
    with pytest.raises(GraphFileError, match="cannot read"):
        BranchGraph.load(tmp_path / "nowhere")


def test_directory(tmp_path):
    with pytest.raises(GraphFileError, match="cannot read"):
        BranchGraph.load(tmp_path)


# -- refinement after loading --------------------------------------------------------------------


def test_loaded_curved_graph_needs_its_system(curved, tmp_path):
    curved.save(tmp_path / "graph")
    without = BranchGraph.load(tmp_path / "graph")
    assert without.count(0.3) == 1
    assert without.balance(0.3) == 1
    assert without.multiplicity() == curved.multiplicity()
    with pytest.raises(SystemNeededError, match=r"curved.*system"):
        without.solutions(0.3)


def test_loaded_curved_graph_with_its_system(curved, tmp_path):
    case = CASES["fig10"]
    curved.save(tmp_path / "graph")
    graph = BranchGraph.load(tmp_path / "graph", system=case.system)
    for alpha in (0.3, 0.49, 0.6, 0.75):
        for s in graph.solutions(alpha):
            expected = solve_modes(case.body, case.load(alpha), 4.0, (s.label,))
            np.testing.assert_allclose(s.z, expected, rtol=0, atol=1e-12)


def test_loaded_straight_graph_needs_no_system(fig7, tmp_path):
    fig7.save(tmp_path / "graph")
    graph = BranchGraph.load(tmp_path / "graph")
    for s in graph.solutions(-0.7):
        expected = solve_modes(ONE_NODE, [0.25, -0.7], 4.0, (s.label,))
        np.testing.assert_allclose(s.z, expected, rtol=0, atol=1e-14)


# -- presentation --------------------------------------------------------------------------------


@pytest.mark.parametrize("name", list(CASES))
@pytest.mark.sweep(4)
def test_to_dict_is_json(name):
    case = CASES[name]
    graph = explore(case.system, case.interval, stepper=PseudoArclength())
    text = json.dumps(graph.to_dict(), allow_nan=False)
    data = json.loads(text)
    assert data["components"] == len(graph.components())
    assert len(data["pieces"]) == len(graph.pieces)
    assert len(data["nodes"]) == graph.nx.number_of_nodes()
    assert data["balance"] == {"value": 1, "constant": True}
    wide = [row for row in graph.multiplicity() if row[0] < row[1]]
    assert data["multiplicity"] == [list(row) for row in wide]
    for row, piece in zip(data["pieces"], graph.pieces, strict=True):
        assert (row["start"], row["end"], row["label"]) == (piece.start, piece.end, piece.label)
        np.testing.assert_array_equal(row["points"], piece.z)
        np.testing.assert_array_equal(row["alpha"], piece.alpha)


def test_repr(fig7):
    lines = repr(fig7).splitlines()
    assert "f_t in [-2, 2]" in lines[0]
    assert "components: 1, pieces: 4, special points: 5" in lines[0]
    assert [line.strip() for line in lines[1:]] == [
        "1 solution for f_t in [-2, -1)",
        "3 solutions for f_t in (-1, -0.5)",
        "1 solution for f_t in (-0.5, 2]",
        "complete",
    ]


def test_html(fig7):
    html = fig7._repr_html_()
    assert html.count("<tr>") == 1 + len(fig7.pieces)
    for label in (FREE, STICK, SLIP_PLUS, SLIP_MINUS):
        assert html.count(f"<td>{label}</td>") == 1


def test_html_escapes_what_a_user_wrote(fig7):
    graph = BranchGraph(
        fig7.special_points(), fig7.pieces, fig7.interval, parameter="<script>alert(1)</script>"
    )
    assert "<script>" not in graph._repr_html_()


def test_repr_of_a_solution(fig7):
    (solution,) = fig7.solutions(0.0)
    assert "stick" in repr(solution)
    assert "det +1" in repr(solution)


def graph_with_a_thin_stretch(error):
    """Return two pieces that meet, but for a stretch of 1e-12 on which there is none."""
    ends, errors = [0.0, 0.5, 0.5 + 1e-12, 1.0], np.full(2, error)
    points = [
        SpecialPoint(i, Kind.TRANSITION, Place(np.array([0.0, alpha]), errors), "", "")
        for i, alpha in enumerate(ends)
    ]
    pieces = [
        Piece(i, a, b, Character(()), str, np.array([[0.0, ends[a]], [0.0, ends[b]]]), 1)
        for i, (a, b) in enumerate([(0, 1), (2, 3)])
    ]
    return BranchGraph(points, pieces, (0.0, 1.0))


def test_a_stretch_thinner_than_the_errors_of_its_ends_is_not_judged():
    graph = graph_with_a_thin_stretch(error=1e-13)
    assert graph.balances() == [1, 0, 1]
    assert graph.is_balanced()
    assert graph.balance_values() == [1]
    assert graph.to_dict()["balance"] == {"value": 1, "constant": True}


def test_a_stretch_wider_than_the_errors_of_its_ends_is_judged():
    graph = graph_with_a_thin_stretch(error=1e-14)
    assert not graph.is_balanced()
    assert graph.balance_values() == [0, 1]
    missing = "not balanced: at least one branch missing in (0.5, 0.500000000001)"
    assert graph.guarantee.startswith(missing)


def test_where_every_stretch_is_blurred_the_balance_still_counts():
    assert not graph_with_a_thin_stretch(error=1.0).is_balanced()


@pytest.mark.parametrize(
    ("call", "named"),
    [
        (lambda graph, path: BranchGraph.load(path, LCP), "system must be a PiecewiseSystem"),
        (lambda graph, path: BranchGraph.load(path, "arch"), "system must be a PiecewiseSystem"),
        (lambda graph, path: graph.path(1, graph.solutions(0.5)[0]), "a must be a Solution"),
        (lambda graph, path: graph.itinerary(0), "each of component must be a Piece, got 0"),
        (lambda graph, path: plot(graph, ax="left"), "ax must be an Axes"),
        (lambda graph, path: draw_counts(graph, 3), "ax must be an Axes"),
        (lambda graph, path: draw_counts("graph", 3), "graph must be a BranchGraph"),
    ],
)
def test_arguments_of_another_kind_are_refused_in_words(call, named, tmp_path):
    graph, path = explore(LCP([[2.0]], q=[0.0], d=[-1.0]), (-1.0, 1.0)), tmp_path / "graph.json"
    graph.save(path)
    with pytest.raises(InvalidInputError, match=named):
        call(graph, path)

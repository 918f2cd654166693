"""Files of graphs that were edited by hand: refused in words, or read as far as they make sense."""

import contextlib
import copy
import json
import math
import os

import numpy as np
import pytest
from pwscont_coulomb import CoulombLoad
from pwscont_coulomb.scenes import example1, example3, fig7, fig10

from pwscont import BranchGraph, GraphFileError, InvalidInputError, PwscontError

NASTY = (
    None,
    True,
    "",
    "word",
    "+-",
    -1,
    0,
    3,
    99,
    10**400,
    1e200,
    -1e200,
    math.nan,
    math.inf,
    -0.5,
    [],
    [1, 2],
    ["a", None],
    [[0.0]],
    {},
    {"id": 0},
)
ARRAYS = (
    np.zeros(3),
    np.zeros((2, 2)),
    np.zeros((0, 0)),
    np.zeros((0, 5)),
    np.array("text"),
    np.zeros((4, 3), dtype=int),
    np.zeros((4, 3), dtype=complex),
    np.zeros((4, 3), dtype=bool),
    np.full((4, 3), np.nan),
    np.zeros((4, 3, 1)),
    np.array(1.0),
)


@pytest.fixture(
    params=[fig7, *(pytest.param(one, marks=pytest.mark.slow) for one in (example3, fig10))],
    ids=lambda scene: scene.__name__,
)
def saved(request, tmp_path):
    """Return the path of a saved graph, its arrays and header, and its system."""
    scene, path = request.param(), tmp_path / "graph.npz"
    scene.run().save(path)
    with np.load(path) as file:
        arrays = dict(file)
    return path, arrays, json.loads(str(arrays["header"])), scene.system


def places(data, way=()):
    """Yield the way to every entry of a JSON value."""
    entries = data.items() if isinstance(data, dict) else enumerate(data)
    for key, value in entries:
        yield (*way, key)
        if isinstance(value, dict | list):
            yield from places(value, (*way, key))


def edited(header, way, value):
    """Return the header with one entry changed, or deleted if ``value`` is Ellipsis."""
    header = copy.deepcopy(header)
    at = header
    for key in way[:-1]:
        at = at[key]
    if value is ...:
        del at[way[-1]]
    else:
        at[way[-1]] = value
    return header


def write(path, arrays, header):
    with path.open("wb") as file:
        np.savez(file, **(arrays | {"header": np.array(json.dumps(header))}))


def asked_everything(graph):
    """Ask a graph all that can be asked; what it cannot answer it refuses in words."""
    lo, hi = graph.interval
    for alpha in (lo, 0.3 * lo + 0.7 * hi, hi):
        for ask in (graph.count, graph.solutions, graph.balance):
            with contextlib.suppress(PwscontError):
                ask(alpha)
    (
        graph.multiplicity(),
        graph.balances(),
        graph.balance_values(),
        graph.components(),
        graph.guarantee,
    )
    graph.special_points(), graph.to_dict(), repr(graph), graph._repr_html_()


def check(path, system):
    """Load a file; returns whether it was refused."""
    refusals = []
    try:
        asked_everything(BranchGraph.load(path, system))
    except (GraphFileError, InvalidInputError) as error:
        refusals.append(str(error))
    assert all(message.startswith(str(path)) for message in refusals)
    return bool(refusals)


def test_an_edited_header_is_refused_in_words_or_makes_sense(saved):
    path, arrays, header, system = saved
    rng, ways, refused = np.random.default_rng(11), list(places(header)), 0
    for _ in range(100):
        way = ways[rng.integers(len(ways))]
        value = [*NASTY, ...][rng.integers(len(NASTY) + 1)]
        write(path, arrays, edited(header, way, value))
        refused += check(path, system if rng.random() < 0.5 else None)
    assert refused > 60


@pytest.mark.slow
def test_every_entry_with_every_nasty_value(saved):
    path, arrays, header, system = saved
    ways = list(places(header))
    for way in ways[:: max(1, len(ways) // 25)]:
        for value in [*NASTY, ...]:
            write(path, arrays, edited(header, way, value))
            check(path, system)


@pytest.mark.parametrize("name", ["header", "nodes", "starts", "points"])
def test_arrays_that_do_not_fit_are_refused(saved, name):
    path, arrays, _, system = saved
    for wrong in ARRAYS:
        if wrong.ndim == 2 and not wrong.size + arrays[name].size:
            continue  # no rows are no rows
        with path.open("wb") as file:
            np.savez(file, **(arrays | {name: wrong}))
        assert check(path, system), f"{name} with shape {wrong.shape}"
    others = {key: value for key, value in arrays.items() if key != name}
    with path.open("wb") as file:
        np.savez(file, **others)
    assert check(path, system)


@pytest.mark.parametrize(
    ("way", "value", "words"),
    [
        (("nodes", 1, "alpha"), None, "alpha of entry 1 of nodes must be a number, got None"),
        (("nodes", 0, "kind"), "", "kind of entry 0 of nodes must not be empty"),
        (("nodes", 0, "id"), -1, "each node and each piece needs an id of its own"),
        (("pieces", 1, "start"), 77, "piece 1 begins or ends at a node that is not there"),
        (("pieces", 0, "count"), 0, "count of entry 0 of pieces must be a whole number from 2 on"),
        (("pieces", 0, "label"), ..., "entry 0 of pieces has no label"),
        (("interval",), [1.0, -1.0], r"the interval needs lo < hi, got \(1.0, -1.0\)"),
        (("searched", 1), 9, "promise of searched must be at most 3, got 9"),
    ],
)
def test_messages_name_the_entry(tmp_path, way, value, words):
    path = tmp_path / "graph.npz"
    fig7().run().save(path)
    with np.load(path) as file:
        arrays = dict(file)
    write(path, arrays, edited(json.loads(str(arrays["header"])), way, value))
    with pytest.raises(GraphFileError, match=words):
        BranchGraph.load(path)


def test_a_graph_of_another_system_is_refused(tmp_path):
    fig7().run().save(tmp_path / "graph.npz")
    with pytest.raises(InvalidInputError, match="it has 4 unknowns, AffineCoulombLoad has 8"):
        BranchGraph.load(tmp_path / "graph.npz", example1().system)


@pytest.mark.parametrize(("moved", "error"), [(-1, GraphFileError), (0, InvalidInputError)])
def test_a_node_that_does_not_fit_its_pieces_is_refused(tmp_path, moved, error):
    """Without the system only alpha is compared: unknowns may differ by periods."""
    scene, path = fig7(), tmp_path / "graph.npz"
    graph = scene.run()
    graph.save(path)
    BranchGraph.load(path, scene.system)
    with np.load(path) as file:
        arrays = dict(file)
    header = json.loads(str(arrays["header"]))
    if moved:
        header = edited(header, ("nodes", 1, "alpha"), header["nodes"][1]["alpha"] + 0.01)
    else:
        arrays["nodes"][1, 0] += 0.5
    write(path, arrays, header)
    with pytest.raises(error, match="does not reach node"):
        BranchGraph.load(path, scene.system)


def test_a_device_is_not_replaced(tmp_path):
    pipe = tmp_path / "pipe"
    os.mkfifo(pipe)
    with pytest.raises(GraphFileError, match="it is a device, not a file"):
        fig7().run().save(pipe)
    assert pipe.is_fifo()


def test_a_failed_write_leaves_nothing_behind(tmp_path, monkeypatch):
    """The old file stays, and no part of a new one."""
    graph, path = fig7().run(), tmp_path / "graph.npz"
    graph.save(path)
    before = path.read_bytes()

    def full(*_):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr("os.replace", full)
    with pytest.raises(GraphFileError, match="No space left on device"):
        graph.save(path)
    assert [file.name for file in tmp_path.iterdir()] == ["graph.npz"]
    assert path.read_bytes() == before


def test_a_system_with_other_constants_is_refused(tmp_path):
    """Not one whose equations hold at the graph's points to a millionth."""
    scene = fig7()
    scene.run().save(tmp_path / "graph.npz")
    assert BranchGraph.load(tmp_path / "graph.npz", scene.system).count(0.0) > 0
    other = CoulombLoad(scene.system.body, scene.system.load, 0.9 * scene.system.friction)
    with pytest.raises(InvalidInputError, match=r"is of another system.*the constants"):
        BranchGraph.load(tmp_path / "graph.npz", other)


def test_points_beyond_all_sizes_are_refused(tmp_path):
    graph = example3().run()
    graph.save(tmp_path / "graph.npz")
    with np.load(tmp_path / "graph.npz", allow_pickle=False) as file:
        arrays = dict(file)
    (name,) = [key for key in arrays if key == "points"]
    arrays[name][0, 0] = 1e300
    np.savez(tmp_path / "graph.npz", **arrays)
    with pytest.raises(GraphFileError, match="at most"):
        BranchGraph.load(tmp_path / "graph.npz", example3().system)

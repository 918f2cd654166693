"""The shape of the code: imports point down, classes are abstract or final, imports are lean."""

import ast
import importlib
import inspect
import pkgutil
import subprocess
import sys
from abc import ABC
from collections import Counter
from functools import cache
from itertools import chain
from pathlib import Path

import networkx as nx
import pytest
from pwscont_coulomb.coulomb import Coulomb

import pwscont
import pwscont.extending
from pwscont import PiecewiseLinearSystem, PiecewiseSystem, SlicewiseLinearSystem, explore

ROOT = Path(pwscont.__file__).parent
PROBLEMS = ROOT.parent / "problems"
#: The plug-ins, by the names of their packages.
PACKAGES = sorted(path.parent.name for path in PROBLEMS.glob("*/__init__.py"))
#: The rooms, ground floor first.
ROOMS = [
    "basics",
    "system",
    "linear",
    "notation",
    "curve",
    "enumeration",
    "transitions",
    "graph",
    "search",
    "proof",
    "events",
    "continuation",
    "kit",
    "scenes",
    "view",
    "evolution",
    "two_parameters",
    "studies",
    "bench",
    "commands",
]
#: Rooms that stand on public names, as plug-ins do: without them all other rooms still work.
SATELLITES = ["notation", "scenes", "view", "two_parameters", "studies", "bench", "commands"]
FLOORS = {room: floor for floor, room in enumerate(ROOMS)}
FILES = sorted(path for path in ROOT.rglob("*.py"))
BUILDING = [path for path in FILES if path.parent != ROOT]
PLUG_INS = sorted(PROBLEMS.rglob("*.py"))
LONGEST_FILE = 500
#: Most files and lines of each room, a little above the figures when they were set. When a room
#: becomes smaller, its budget becomes smaller.
BUDGET = {
    "basics": (11, 1256),
    "system": (9, 1954),
    "linear": (5, 1091),
    "notation": (13, 3008),
    "curve": (12, 3434),
    "enumeration": (11, 2528),
    "transitions": (13, 3350),
    "graph": (8, 2465),
    "search": (9, 2023),
    "continuation": (9, 2735),
    "kit": (4, 976),
    "proof": (7, 2129),
    "events": (4, 556),
    "scenes": (14, 2682),
    "view": (6, 934),
    "evolution": (14, 3087),
    "two_parameters": (16, 3665),
    "studies": (11, 2271),
    "bench": (15, 1840),
    "commands": (10, 1174),
}
#: Most files and classes that the README's arch meets; a change that needs more says why.
MOST_FILES_MET, MOST_CLASSES_MET = 50, 55


def module_of(path):
    parts = path.relative_to(ROOT.parent).with_suffix("").parts
    return ".".join(parts[:-1] if parts[-1] == "__init__" else parts)


MODULES = {module_of(path): path for path in FILES}


@cache
def nodes_of(path):
    """Return the nodes of a file's syntax tree that these tests look at."""
    kinds = (ast.Import, ast.ImportFrom, ast.ClassDef, ast.Constant)
    tree = ast.parse(path.read_text(encoding="utf-8"))
    return [node for node in ast.walk(tree) if isinstance(node, kinds)]


@cache
def lines_of(path):
    return len(path.read_text(encoding="utf-8").splitlines())


def imported_names(path):
    """Yield module and name of every absolute import of a file, wherever it stands."""
    for node in nodes_of(path):
        if isinstance(node, ast.Import):
            yield from ((alias.name, "") for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            assert node.level == 0, f"{path}: relative import"
            yield from ((node.module, alias.name) for alias in node.names)


def named_modules(path):
    """Yield every module of pwscont that a file names in a text, as import_module takes it."""
    for node in nodes_of(path):
        if (
            isinstance(node, ast.Constant)
            and str(node.value) in MODULES
            and node.value != "pwscont"
        ):
            yield node.value


def modules_used(path):
    """Yield every module of pwscont that a file imports, by name or by text."""
    for module, imported in imported_names(path):
        full = f"{module}.{imported}"
        if module.split(".")[0] == "pwscont":
            yield full if full in MODULES else module
    yield from named_modules(path)


def name(path):
    return str(path.relative_to(ROOT.parent))


def test_every_package_has_a_floor():
    packages = {path.name for path in ROOT.iterdir() if (path / "__init__.py").exists()}
    assert packages == set(FLOORS)


def files_of(room):
    return [path for path in BUILDING if path.relative_to(ROOT).parts[0] == room]


@pytest.mark.parametrize("room", ROOMS)
def test_imports_point_down(room):
    used = [(path, module) for path in files_of(room) for module in modules_used(path)]
    for path, module in used:
        parts = module.split(".")
        if room in SATELLITES and module in ("pwscont", "pwscont.extending"):
            continue  # see the next test
        assert len(parts) > 1, f"{name(path)} imports the top of the package"
        there = parts[1]
        assert there in FLOORS, f"{name(path)} imports {module} from the top of the package"
        assert FLOORS[there] <= FLOORS[room], f"{name(path)} imports {module}, which lies above"


@pytest.mark.parametrize("room", ROOMS)
def test_public_names_that_a_satellite_imports_lie_below(room):
    for module, imported in chain.from_iterable(map(imported_names, files_of(room))):
        if module in ("pwscont", "pwscont.extending") and not imported.startswith("__"):
            home = getattr(getattr(importlib.import_module(module), imported), "__module__", "")
            if home.startswith("pwscont."):
                assert FLOORS[home.split(".")[1]] <= FLOORS[room], f"{imported} lies above"


def test_imports_by_text_are_seen():
    """The command line loads the bench by its name: the floors hold for that, too."""
    assert "pwscont.commands.cli" in set(named_modules(ROOT / "__main__.py"))


def circles(files, modules):
    """Return the groups of files that import each other, wherever the imports stand."""
    imports = nx.DiGraph()
    for path in files:
        me = next(module for module, file in modules.items() if file == path)
        for module, imported in imported_names(path):
            used = f"{module}.{imported}" if f"{module}.{imported}" in modules else module
            if used in modules and used != me:
                imports.add_edge(me, used)
    return [group for group in nx.strongly_connected_components(imports) if len(group) > 1]


def test_no_files_import_each_other():
    assert not circles(BUILDING, MODULES)


def test_no_files_of_plug_ins_import_each_other():
    parts = {path: path.relative_to(PROBLEMS).with_suffix("").parts for path in PLUG_INS}
    modules = {".".join(part).removesuffix(".__init__"): path for path, part in parts.items()}
    assert not circles(PLUG_INS, modules)


def test_no_file_needs_a_guide():
    assert not [str(path) for path in FILES + PLUG_INS if lines_of(path) > LONGEST_FILE]


@pytest.mark.parametrize("room", ROOMS)
def test_a_room_keeps_its_budget(room):
    files = files_of(room)
    most_files, most_lines = BUDGET[room]
    assert len(files) <= most_files
    assert sum(map(lines_of, files)) <= most_lines


class ArchOverStop(PiecewiseSystem):
    """The README's system."""

    size = 1

    def test_functions(self, z, alpha):
        return z - 1.0

    def residual(self, z, alpha, character):
        stop = 5.0 * (z - 1.0) if character.signs[0] else 0.0
        return z * (z - 1.0) * (z - 2.0) + stop - alpha


def met_by(call):
    """Return the files of pwscont that a call runs, and the classes whose methods run or are asked.

    The call runs once before, for imports and caches.
    """
    files, met = set(), set()

    def see(frame, event, _):
        code = frame.f_code
        if event != "call":
            return
        module = sys.modules.get(frame.f_globals.get("__name__"))
        if is_ours(module) and not code.co_filename.startswith("<"):
            files.add(code.co_filename)
            met.add(vars(module).get(code.co_qualname.split(".")[0]))
        if code.co_varnames[:1] and code.co_varnames[0] in ("self", "cls", "_cls"):
            first = frame.f_locals.get(code.co_varnames[0])
            kind = first if isinstance(first, type) else type(first)
            if is_ours(sys.modules.get(kind.__module__)):
                met.add(kind)

    call()
    before = sys.getprofile()
    sys.setprofile(see)
    try:
        call()
    finally:
        sys.setprofile(before)
    return files, {kind for kind in met if isinstance(kind, type)}


def is_ours(module):
    return getattr(module, "__name__", "").split(".")[0] == "pwscont"


def test_one_run_meets_few_files_and_classes():
    """A reader who follows the README's arch meets this much (docs/architecture)."""
    files, met = met_by(lambda: explore(ArchOverStop(), (-0.5, 1.0)))
    assert len(files) <= MOST_FILES_MET
    assert len(met) <= MOST_CLASSES_MET


def test_one_class_has_one_name():
    nodes = chain.from_iterable(map(nodes_of, FILES))
    names = Counter(node.name for node in nodes if isinstance(node, ast.ClassDef))
    assert not [found for found, times in names.items() if times > 1]


def test_the_framework_knows_no_problem():
    used = [(name(path), module) for path in FILES for module, _ in imported_names(path)]
    assert not [pair for pair in used if pair[1].split(".")[0] in PACKAGES]


@pytest.mark.parametrize("package", PACKAGES)
def test_a_plug_in_imports_public_names_only(package):
    """So it can be a template for anyone else's."""
    public = {"pwscont": pwscont.__all__, "pwscont.extending": pwscont.extending.__all__}
    files = [path for path in PLUG_INS if package in path.parts]
    assert files
    for module, imported in chain.from_iterable(map(imported_names, files)):
        if module.split(".")[0] == "pwscont":
            assert imported in public.get(module, ()), f"{module}.{imported} is not public"


@pytest.mark.parametrize("room", SATELLITES)
def test_a_satellite_imports_public_names_only(room):
    """Names of other satellites count as public, as far as these lie below."""
    public = {"pwscont": pwscont.__all__, "pwscont.extending": pwscont.extending.__all__}
    for path in (ROOT / room).rglob("*.py"):
        for module, imported in imported_names(path):
            top, *rooms = module.split(".")
            if top == "pwscont" and not (rooms and rooms[0] in SATELLITES):
                assert imported in public.get(module, ()), f"{name(path)} imports {imported}"


@pytest.mark.parametrize("room", [r for r in ROOMS if r not in (*SATELLITES, "proof")])
def test_the_core_imports_no_satellite(room):
    """Proofs are of formulas in the notation; scene, pictures and page of evolutions look alike."""
    pictures = [ROOT / "evolution" / f"{part}.py" for part in ("scene", "plotting", "browser")]
    for path in (ROOT / room).rglob("*.py"):
        if path not in pictures:
            used = {module.split(".")[1] for module in modules_used(path) if "." in module}
            assert not used & set(SATELLITES), name(path)


def test_the_core_works_without_satellites():
    code = """
import sys

class Missing:
    def find_spec(self, name, path=None, target=None):
        parts = name.split(".")
        if parts[0] == "pwscont" and len(parts) > 1 and parts[1] in %r:
            raise ImportError(name)

sys.meta_path.insert(0, Missing())
import pwscont.extending
from pwscont import PiecewiseSystem, explore

class Line(PiecewiseSystem):
    size = 1

    def test_functions(self, z, alpha):
        return z - 0.5

    def residual(self, z, alpha, character):
        return z - alpha

print(explore(Line(), (0.0, 1.0)).count(0.3))
"""
    run = [sys.executable, "-c", code % SATELLITES]
    assert subprocess.run(run, capture_output=True, text=True, check=True).stdout.strip() == "1"


def classes():
    for info in pkgutil.walk_packages([str(ROOT)], "pwscont."):
        if info.name.endswith("__main__"):
            continue
        module = importlib.import_module(info.name)
        for _, found in inspect.getmembers(module, inspect.isclass):
            if found.__module__ == info.name:
                yield found


def test_abstract_or_final():
    """Seams are abstract; what implements one is final and tweaked by composition."""
    seams = [found for found in classes() if ABC in found.__mro__]
    assert PiecewiseSystem in seams
    assert len(seams) > 10
    for found in seams:
        final = getattr(found, "__final__", False)
        assert inspect.isabstract(found) != final, f"{found.__qualname__} is neither or both"


BASES = [PiecewiseSystem, SlicewiseLinearSystem, PiecewiseLinearSystem, Coulomb]


@pytest.mark.parametrize("system", BASES)
def test_bases_of_systems_are_abstract(system):
    assert inspect.isabstract(system)
    with pytest.raises(TypeError, match="abstract"):
        system(*[None] * (system is Coulomb))


def loaded_by(statement):
    """Return the top-level modules that a fresh interpreter holds after a statement."""
    code = f"{statement}\nimport sys\nprint(*{{m.split('.')[0] for m in sys.modules}})"
    run = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    return set(run.stdout.split())


HEAVY = {
    "matplotlib",
    "pandas",
    "sqlite3",
    "networkx",
    *PACKAGES,
    "skfem",
    "meshio",
    "pytest",
    "IPython",
    "bokeh",
    "selenium",
    "tqdm",
}


def test_import_pwscont_is_lean():
    assert "numpy" not in loaded_by("import pwscont")
    loaded = loaded_by("from pwscont import explore")
    assert "numpy" in loaded
    assert not loaded & HEAVY


@pytest.mark.slow
def test_straight_pieces_need_no_optimizer():
    """It takes as long to import as all the rest."""
    code = (
        "import sys\nfrom pwscont import LCP, explore\n"
        "graph = explore(LCP([[2.0]], [0.0], [-1.0]), (-1.0, 1.0))\n"
        "print(len(graph.pieces), 'scipy.optimize' in sys.modules)"
    )
    run = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert run.stdout.split() == ["2", "False"]


@pytest.mark.slow
def test_static_problems_load_no_evolutions():
    code = (
        "import sys, pwscont_coulomb\n"
        "print(*[m for m in sys.modules if 'evolution' in m or 'quasi_static' in m])"
    )
    run = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert not run.stdout.split()


@pytest.mark.slow
@pytest.mark.parametrize("module", [*PACKAGES, "pwscont.extending"])
@pytest.mark.sweep(9)
def test_import_of_plug_ins_loads_no_plotting(module):
    loaded = loaded_by(f"import {module}")
    assert "pwscont" in loaded
    assert not loaded & (HEAVY - {module})


PUBLIC = [pwscont, pwscont.extending, *map(importlib.import_module, PACKAGES)]


@pytest.mark.parametrize("module", PUBLIC)
def test_everything_in_all_can_be_imported(module):
    for public in module.__all__:
        assert getattr(module, public) is not None


REFERENCE = ROOT.parent / "docs" / "reference" / "index.rst"
#: Explained there in a sentence: types that are other names, and numbers.
IN_A_SENTENCE = {
    *("Array", "Function", "Indices", "Matrix", "Shown", "Signs"),
    *(
        "CONFIDENCE",
        "CONVERGED",
        "DEFAULT_LOOK",
        "DUST",
        "EPS",
        "FEW_DIGITS",
        "GUARD",
        "SAME_ALPHA",
        "SMALL_PIVOT",
        "THREADS",
    ),
}


@pytest.mark.parametrize("module", PUBLIC)
def test_every_public_name_is_in_the_reference(module):
    text = REFERENCE.read_text(encoding="utf-8")
    listed = {line.split(".")[-1].strip() for line in text.splitlines() if "." in line}
    assert not set(module.__all__) - listed - IN_A_SENTENCE
    assert not [n for n in IN_A_SENTENCE & set(module.__all__) if f"``{n}``" not in text]

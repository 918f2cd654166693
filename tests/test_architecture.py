"""The shape of the code: imports point down, classes are abstract or final, imports are lean."""

import ast
import importlib
import inspect
import pkgutil
import subprocess
import sys
from abc import ABC
from pathlib import Path

import pytest

import pwscont
from pwscont import PiecewiseLinearSystem, PiecewiseSystem, SlicewiseLinearSystem

ROOT = Path(pwscont.__file__).parent
#: The rooms, ground floor first.
ROOMS = [
    "basics",
    "system",
    "linear",
    "curve",
    "stepping",
    "enumeration",
    "transitions",
    "graph",
    "search",
    "continuation",
    "scenes",
    "two_parameters",
    "bench",
    "commands",
]
FLOORS = {room: floor for floor, room in enumerate(ROOMS)}
FILES = sorted(path for path in ROOT.rglob("*.py"))
BUILDING = [path for path in FILES if path.parent != ROOT]


def package_of(path):
    return path.relative_to(ROOT).parts[0]


def imported_modules(path):
    """Yield every absolute module name that a file imports, wherever in the file."""
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            assert node.level == 0, f"{path}: relative import"
            yield from (f"{node.module}.{alias.name}" for alias in node.names)


def name(path):
    return str(path.relative_to(ROOT))


def test_every_package_has_a_floor():
    packages = {path.name for path in ROOT.iterdir() if (path / "__init__.py").exists()}
    assert packages == set(FLOORS)


@pytest.mark.parametrize("path", BUILDING, ids=name)
def test_imports_point_down(path):
    here = package_of(path)
    for module in imported_modules(path):
        parts = module.split(".")
        if parts[0] != "pwscont":
            continue
        assert len(parts) > 1, f"{name(path)} imports the top of the package"
        there = parts[1]
        assert there in FLOORS, f"{name(path)} imports {module} from the top of the package"
        lower = FLOORS[there] < FLOORS[here]
        assert there == here or lower, f"{name(path)} (floor {FLOORS[here]}) imports {module}"


@pytest.mark.parametrize("path", FILES, ids=name)
def test_the_framework_knows_no_problem(path):
    assert not [m for m in imported_modules(path) if m.split(".")[0] == "pwscont_coulomb"]


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


@pytest.mark.parametrize("system", [PiecewiseSystem, SlicewiseLinearSystem, PiecewiseLinearSystem])
def test_bases_of_systems_are_abstract(system):
    assert inspect.isabstract(system)
    with pytest.raises(TypeError, match="abstract"):
        system()


def loaded_by(statement):
    """Return the top-level modules that a fresh interpreter holds after a statement."""
    code = f"{statement}\nimport sys\nprint(*{{m.split('.')[0] for m in sys.modules}})"
    run = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    return set(run.stdout.split())


HEAVY = {"matplotlib", "pandas", "pwscont_coulomb", "skfem", "meshio", "pytest", "IPython", "tqdm"}


def test_import_pwscont_is_lean():
    assert "numpy" not in loaded_by("import pwscont")
    loaded = loaded_by("from pwscont import explore")
    assert "numpy" in loaded
    assert not loaded & HEAVY


def test_import_of_the_plug_in_loads_no_plotting():
    loaded = loaded_by("import pwscont_coulomb")
    assert "pwscont" in loaded
    assert not loaded & (HEAVY - {"pwscont_coulomb"})


def test_everything_in_all_can_be_imported():
    for public in set(pwscont.__all__) - {"plot", "draw_counts"}:
        assert getattr(pwscont, public) is not None

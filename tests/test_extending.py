"""The page on extending, run as it stands: seams are usable from the documentation alone."""

import inspect
import re

import pytest
from pages import blocks

import pwscont
from pwscont import extending


@pytest.mark.slow
def test_the_page_runs_from_top_to_bottom():
    *codes, package = blocks("extending.rst")
    assert len(codes) == 11
    assert package.startswith('"""')  # a file of its own, see test_own_package.py
    names = {}
    for code in codes:
        exec(compile(code, "extending.rst", "exec"), names)
    with pytest.raises(pwscont.InvalidInputError, match="half_width must be positive, got -1"):
        names["circle"](half_width=-1.0)


SEAMS = [extending.Stepper, extending.TransitionDetector, extending.Search]


@pytest.mark.parametrize("seam", SEAMS, ids=lambda seam: seam.__name__)
def test_every_type_of_a_seam_is_public(seam):
    public = {*extending.__all__, *pwscont.__all__}
    for _, method in inspect.getmembers(seam, inspect.isfunction):
        for annotation in method.__annotations__.values():
            for word in re.findall(r"\b[A-Z]\w+", str(annotation)):
                assert word in public | {"None", "Iterator", "Found"}, (
                    f"{method.__qualname__}: {word}"
                )


def test_all_names_are_there():
    assert all(hasattr(extending, name) for name in extending.__all__)
    assert len(set(extending.__all__)) == len(extending.__all__)

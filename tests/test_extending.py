"""The page on extending, run as it stands: seams are usable from the documentation alone."""

import inspect
import re
from pathlib import Path

import pytest

import pwscont
from pwscont import extending

PAGE = (Path(__file__).parents[1] / "docs" / "extending.rst").read_text(encoding="utf-8")
BLOCK = re.compile(r"^\.\. code-block:: python\n\n((?:   .*\n|\n)+)", re.MULTILINE)


def test_the_page_runs_from_top_to_bottom():
    blocks = [re.sub(r"^   ", "", code, flags=re.MULTILINE) for code in BLOCK.findall(PAGE)]
    assert len(blocks) == 6
    names = {}
    for code in blocks:
        exec(code, names)


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
    assert extending.__all__ == sorted(extending.__all__)

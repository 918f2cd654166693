"""Code blocks of the manual's pages."""

import re
from pathlib import Path

DOCS = Path(__file__).parents[2] / "docs"


def page(name):
    """Return the text of a page."""
    return (DOCS / name).read_text(encoding="utf-8")


def blocks(name, language="python"):
    """Return the code blocks of a page in one language, without their indentation."""
    found = re.findall(rf"^\.\. code-block:: {language}\n\n((?:   .*\n|\n)+)", page(name), re.M)
    return [re.sub(r"^   ", "", block, flags=re.M).rstrip() + "\n" for block in found]


def check_answers(code, names):
    """Compare what stands behind each arrow with what is there; return how many there are."""
    answers = re.findall(r"^(.+?)  # -> (.+)$", code, re.M)
    for question, answer in answers:
        assert repr(eval(question, names)) == answer, question
    return len(answers)

"""All families by name, and the case of a number."""

from __future__ import annotations

import zlib
from collections.abc import Callable

import numpy as np

from curved import contact, planar, thin
from curved.case import Case
from pwscont import NaturalParameter, PseudoArclength
from pwscont.curve.corrector import BorderedNewton, MoorePenrose
from pwscont.curve.pseudo_arclength import Hermite, Secant, Tangent
from pwscont.curve.stepper import Stepper

Family = Callable[[np.random.Generator], Case]

PLANE: dict[str, Family] = {
    "waves": planar.waves,
    "sheets": planar.sheets,
    "near-sheets": planar.near_sheets,
    "arches": planar.arches,
    "ellipses": planar.ellipses,
    "spirals": planar.spirals,
    "kinks": planar.kinks,
    "flat": planar.flat,
    "slabs": thin.slabs,
    "stripes": thin.stripes,
    "bumps": thin.bumps,
}
CONTACT: dict[str, Family] = {"contact": contact.contact, "friction": contact.friction}


def steppers(rng: np.random.Generator) -> Case:
    """Return a case of any other family, to be followed by any stepper that can."""
    names = [*PLANE, *CONTACT]
    name = names[int(rng.integers(len(names)))]
    case = {**PLANE, **CONTACT}[name](rng)
    case.parameters = {"of": name, **case.parameters}
    predictor = (Tangent(), Secant(), Hermite())[int(rng.integers(3))]
    corrector = (BorderedNewton(), MoorePenrose())[int(rng.integers(2))]
    chosen: Stepper = PseudoArclength(predictor, corrector)
    if not case.has_folds and rng.random() < 0.4:
        chosen = NaturalParameter()
    words = type(chosen).__name__, type(predictor).__name__, type(corrector).__name__
    return case.by(chosen, " ".join(words))


FAMILIES: dict[str, Family] = {**PLANE, **CONTACT, "steppers": steppers}


def case_of(family: str, seed: int, number: int) -> tuple[Case, np.random.Generator]:
    """Return a case and the generator that goes on; the same for the same arguments."""
    rng = np.random.default_rng([seed, zlib.crc32(family.encode()), number])
    return FAMILIES[family](rng), rng

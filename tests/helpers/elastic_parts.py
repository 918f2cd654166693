"""What tests of elastic bodies share."""

from elastic_bodies import strip
from pwscont_coulomb.elastic import (
    ContactBoundary,
    ElasticBody,
    Lame,
    Support,
)

# -- errors --------------------------------------------------------------------------------------


def body_with(**changes):
    given = {
        "mesh": strip(),
        "material": Lame(1.0, 1.0),
        "supports": [Support("top")],
        "contact": ContactBoundary("bottom", friction=0.5),
    }
    given |= changes
    return ElasticBody(given.pop("mesh"), given.pop("material"), **given)

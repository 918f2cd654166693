"""Elastic bodies from finite element meshes, for the Coulomb plug-in.

scikit-fem and meshio (the extra ``fem``) are loaded when the first body is made.
"""

from pwscont_coulomb.elastic.body_picture import ElasticPicture
from pwscont_coulomb.elastic.condensation import CondensedProblem
from pwscont_coulomb.elastic.contact_boundary import ContactBoundary
from pwscont_coulomb.elastic.elastic_body import ElasticBody
from pwscont_coulomb.elastic.elimination import Elimination
from pwscont_coulomb.elastic.full import FullProblem
from pwscont_coulomb.elastic.loads import BodyForce, Support, Traction
from pwscont_coulomb.elastic.material import Lame, PlaneStrain, PlaneStress, Young
from pwscont_coulomb.elastic.multifrontal import Multifrontal
from pwscont_coulomb.elastic.mumps import Mumps
from pwscont_coulomb.elastic.problem import ElasticProblem
from pwscont_coulomb.elastic.recovery import BodyState, recover
from pwscont_coulomb.elastic.superlu import SuperLU
from pwscont_coulomb.elastic.units import Units

__all__ = [
    "BodyForce",
    "BodyState",
    "CondensedProblem",
    "ContactBoundary",
    "ElasticBody",
    "ElasticPicture",
    "ElasticProblem",
    "Elimination",
    "FullProblem",
    "Lame",
    "Multifrontal",
    "Mumps",
    "PlaneStrain",
    "PlaneStress",
    "SuperLU",
    "Support",
    "Traction",
    "Units",
    "Young",
    "recover",
]

"""The outcome of a run: kinds of special points, reasons of failure, guarantees."""

from __future__ import annotations

from dataclasses import dataclass
from enum import IntEnum, StrEnum
from typing import final


@final
class Kind(StrEnum):
    """The kind of a special point; the value is the word that users read and query by."""

    START = "start"
    END = "end"
    TRANSITION = "transition"
    NONSMOOTH_FOLD = "nonsmooth fold"
    FOLD = "fold"
    BRANCH_POINT = "branch point"
    CORNER = "corner"
    PARTIAL_CORNER = "corner searched in part"
    NONSMOOTH_BRANCH_POINT = "nonsmooth branch point"
    DEGENERATE = "degenerate"
    ISOLATED = "isolated solution"
    EVENT = "event"
    STOPPED = "stopped"


#: Kinds of special points at which a curve leaves one cell for another: the change says all.
CROSSED = (Kind.TRANSITION, Kind.NONSMOOTH_FOLD)


def kind_of(word: str) -> Kind | str:
    """Return the kind with this word, or the word itself if a user's detector made the word."""
    return Kind(word) if word in set(Kind) else word


@final
class Remark(StrEnum):
    """What may be said of a special point beside its kind; the value stands in the message.

    A graph file keeps messages only: whoever decides by a remark asks :func:`says`.
    """

    ACCUMULATE = "special points seem to accumulate at alpha ="  # the value of alpha follows
    FILL = "solutions fill"  # the solutions around are no curves
    FILL_CURVES = "solutions fill a curve or more at this alpha"
    TOUCH = "curves touch here, or more than two cross: only the curves that arrive are followed"
    #: The determinant changed its sign on the piece that ends here.
    TWOFOLD = "on the way, two curves may have been taken for one"
    ON_BOUND = "a branch ends on its bound"
    REPEATS = (
        "the path repeats itself without end: set limits=Limits(pieces=...) to follow it further"
    )


#: What is said of a search that ends because there are so many solutions.
GIVEN_UP = "given up because many solutions were found: there may be more"
#: What is said of starts that a run leaves out.
IN_VAIN = "not followed, for the Jacobian loses rank there, as along paths that led nowhere"
#: What is said of a graph without a solution; the searches follow.
NOTHING_FOUND = "nothing found"


@final
class FailureReason(StrEnum):
    """The reason of a failure; the value is the advice that a user reads."""

    NOT_CONVERGED = (
        "Newton did not converge down to the smallest step; check the Jacobian with "
        "check_system, or allow a smaller StepSize.smallest"
    )
    NO_DESCENT = "Newton stalls where the residual is not zero, or does not settle"
    SINGULAR = (
        "the bordered Jacobian is singular: two branches meet here, or the curve is tangent "
        "to the interface"
    )
    NO_DIGITS = (
        "not one digit of the point is certain: Newton ran off, or the equations are singular to "
        "rounding"
    )
    NOT_FINITE = (
        "the residual, the Jacobian or a test function is not finite here; is the parameter "
        "outside its domain?"
    )
    OUTSIDE = (
        "the way on leaves the interval of the parameter and comes back into it; where unknowns "
        "are far from one, give scale()"
    )
    JUMP = (
        "every step that was tried, down to the smallest, leads away from the curve or to another "
        "one close by; check the Jacobian with check_system, or allow a smaller StepSize.smallest"
    )
    THIN_CELL = (
        "a test function vanishes within every step that was tried, but not at its ends; does it "
        "depend continuously on z and alpha?"
    )
    OUTSIDE_OF_CELL = (
        "a test function is clearly negative where the piece begins, and falls: the piece would be "
        "followed outside of its cell, next to interfaces that rounding does not tell apart"
    )
    HIDDEN_FOLDS = "alpha turns more than once within every step that was tried"
    FLAT = (
        "the parameter does not change any more: the branch runs to infinity, or is flat; where "
        "unknowns are far from one, give scale()"
    )
    ENDLESS = (
        "the branch runs to infinity: the parameter hardly changes any more; where unknowns are "
        "far from one, give scale()"
    )
    CREEPING = (
        "steps stay tiny however many are taken: do the equations vanish twice on the curve, as a "
        "square does, is H only rounding here, or has H a kink that no test function announces?"
    )
    TWICE = (
        "the Jacobian loses rank all along the curve: do the equations vanish twice, as a square "
        "does, or do curves touch?"
    )
    NO_TURN = "this stepper cannot turn at a fold; use PseudoArclength"
    UNBOUNDED = "the branch runs to infinity: nothing ends the piece at this value of the parameter"
    TOO_MANY_STEPS = (
        "the piece took more steps than allowed; allow longer steps, give scale() for unknowns far "
        "from one, or look for a mistake in residual or Jacobian with check_system"
    )


def says(message: str, *what: Remark | FailureReason) -> bool:
    """Tell whether the message of a special point holds one of these remarks or reasons."""
    return any(each in message for each in what)


@final
@dataclass(frozen=True, slots=True)
class Failure:
    """A step that could not be taken.

    Examples
    --------
    >>> from pwscont.extending import Failure, FailureReason
    >>> print(Failure(FailureReason.NO_TURN))
    this stepper cannot turn at a fold; use PseudoArclength
    """

    trouble: FailureReason | str  #: Advice to the user, or the words of a user's own stepper.

    def __str__(self) -> str:
        return str(self.trouble)


@final
class Guarantee(IntEnum):
    """How much of the zero set a search finds; larger is more.

    UNIQUE is a promise of the system: no alpha has two solutions.
    """

    NOTHING = 0
    BUT_LOOPS = 1
    EVERYTHING = 2
    UNIQUE = 3


@final
@dataclass(frozen=True, slots=True)
class SearchScope:
    """The searches of a run, and the promise of these searches."""

    what: str  #: The searches, in words.
    promise: Guarantee
    spent: str = ""  #: Why the run ended early, in words; empty if the run was finished.
    #: Distance along a curve, in intervals of alpha and typical magnitudes, within which two smooth
    #: folds may be passed over; zero if no fold is passed over.
    gap: float = 0.0

    @property
    def unseen(self) -> str:
        """What may have been passed over on the pieces that were followed; empty for nothing."""
        if not self.gap:
            return ""
        return f"two smooth folds closer together along a curve than {self.gap:.2g} of the interval"

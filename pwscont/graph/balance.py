"""The balance of signs, and the verdict on what may be missing.

The sum of signs can change only at the end of a piece that no other continues (docs/theory, F4).
Where the sum is wrong on a stretch of alpha, the ends around this stretch tell why: a piece was
stopped, or the model ends there. Where all pieces go on, a branch is missing, or stands there
twice. The sign of a branch that ends on purpose does not count.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Callable, Iterable, Iterator
from contextlib import suppress
from functools import partial
from itertools import combinations, compress, pairwise

import numpy as np

from pwscont.basics import outcome
from pwscont.basics.errors import PwscontError
from pwscont.basics.outcome import FailureReason, Guarantee, Kind, Remark, says
from pwscont.basics.printing import apart, number
from pwscont.basics.rounding import CONFIDENCE, EPS, GUARD
from pwscont.graph import queries
from pwscont.graph.records import SpecialPoint, are_one
from pwscont.graph.structure import NOT_SEARCHED, ConnectedPieces, connected
from pwscont.system.system import SlicewiseLinearSystem

#: A stretch of alpha.
Gap = tuple[float, float]
#: Kinds of points at which a branch may end, the kind first that explains the end best.
EXPLAINING = (Kind.END, Kind.EVENT, Kind.STOPPED)


def loose_ends(graph: ConnectedPieces) -> dict[SpecialPoint, int]:
    """Return the points within the interval at which the sum of signs jumps, and the jumps.

    Of points that vertical pieces join, or infinitely many solutions between two values of alpha,
    the point counts that explains the jump best.
    """
    jumps: dict[int, int] = defaultdict(int)
    for piece in graph.pieces:
        sign = piece.det_sign if piece.alpha[0] < piece.alpha[-1] else -piece.det_sign
        jumps[piece.start] += sign
        jumps[piece.end] -= sign
    jumping = sorted(node for node, jump in jumps.items() if jump)
    verticals = [(piece.start, piece.end) for piece in graph.verticals]
    for lo, hi, _ in graph.infinite:
        at = {i: graph.point(i).alpha for i in jumping}
        touching = (lo <= at[i] <= hi or graph.same(np.array([lo, hi]), at[i]).any() for i in at)
        verticals += pairwise(compress(jumping, touching))
    found = {}
    for nodes in connected(jumping, verticals):
        points = [graph.point(node) for node in nodes]
        jump = sum(jumps[node] for node in nodes)
        if jump and not any(graph.same(points[0].alpha, end) for end in graph.interval):
            order = [point for kind in EXPLAINING for point in points if point.kind == kind]
            found[max(order or points, key=partial(leaves_upright, graph))] = jump
    return found


def is_on_purpose(graph: ConnectedPieces, point: SpecialPoint) -> bool:
    """Tell whether the system or the user ends branches at a point."""
    ends = point.kind == Kind.EVENT and len(graph.pieces_at(point.id)) == 1
    return point.kind == Kind.END or ends or says(point.message, Remark.ON_BOUND)


#: Failures after which a branch is said to run to infinity.
TO_INFINITY = (FailureReason.UNBOUNDED, FailureReason.ENDLESS, FailureReason.FLAT)


def leaves_upright(graph: ConnectedPieces, point: SpecialPoint) -> bool:
    """Tell whether a branch runs to infinity at an alpha with infinitely many solutions."""
    runs = says(point.message, *TO_INFINITY)
    return runs and queries.is_beside_infinite(graph, point.alpha, _blur(point))


def _blur(point: SpecialPoint) -> float:
    """Return how far alpha of a point may be off, as alpha drifts on the way to infinity."""
    return CONFIDENCE * float(point.error[-1])


def _lost(graph: ConnectedPieces) -> list[SpecialPoint]:
    """Return the points from which a ray could not be followed."""
    return [point for point in graph.nodes if point.kind == Kind.STOPPED or point.lost]


def balance_at(graph: ConnectedPieces, alpha: float) -> int:
    """Return the sum of the signs of det(dH/dz) over all solutions at ``alpha``.

    Where solutions stay bounded the sum is the same at every regular alpha; if not, a
    branch is missing. The converse does not hold: a missed pair cancels.
    """
    queries.check_inside(graph, alpha)
    nodes = sum(queries.index_at(graph, node) for node in queries.nodes_at(graph, alpha))
    return nodes + sum(piece.det_sign for piece in queries.pieces_through(graph, alpha))


def balances(graph: ConnectedPieces) -> list[int]:
    """Return the balance within each interval between successive special points."""
    middles = [0.5 * (a + b) for a, b in pairwise(graph.breaks())]
    return [sum(piece.det_sign for piece in queries.pieces_over(graph, alpha)) for alpha in middles]


def balance_values(graph: ConnectedPieces) -> list[int]:
    """Return the different values of the balance, ascending: one value if nothing is missing.

    A stretch of alpha that is no longer than the uncertainty of the special points around it
    does not count: such a stretch may not exist, for the ends may be in the opposite order.
    """
    return sorted({value for value, _ in _judged(graph)})


def _judged(graph: ConnectedPieces) -> list[tuple[int, Gap]]:
    """Return balance and ends of stretches that are longer than uncertain, with finite numbers."""
    pairs = zip(balances(graph), pairwise(graph.breaks()), strict=True)
    # where solutions are infinitely many, the signs of the pieces around say nothing
    everything = [row for row in pairs if not queries.is_infinite(graph, 0.5 * sum(row[1]))]
    return [row for row in everything if not is_blurred(graph, *row[1])] or everything


def is_blurred(graph: ConnectedPieces, lo: float, hi: float) -> bool:
    """Tell whether the errors of the special points around a stretch overlap within it."""
    below = graph.alphas < 0.5 * (lo + hi)
    blur = CONFIDENCE * graph.alpha_errors
    first = (graph.alphas + blur)[below].max(initial=lo)
    last = (graph.alphas - blur)[~below].min(initial=hi)
    return bool(first >= last)


def is_balanced(graph: ConnectedPieces) -> bool:
    """Tell whether the balance is the same at every regular alpha of the interval.

    Where the system knows the degree (+1 for Coulomb friction), the balance must equal the
    degree. Stretches too short to be judged do not count, see :meth:`balance_values`.
    """
    return not unbalanced(graph)


def unbalanced(graph: ConnectedPieces) -> list[Gap]:
    """Return the stretches in which the balance is not what the balance must be.

    Without a known degree: the stretches whose balance differs from the most frequent one, each
    without the signs of branches that end on purpose.
    """
    judged = _judged(graph)
    degree = graph.system.degree if graph.system else None
    if degree is None:
        ends = [
            (point.alpha, jump)
            for point, jump in loose_ends(graph).items()
            if is_on_purpose(graph, point) or leaves_upright(graph, point)
        ]
        judged = [
            (value - sum(jump for alpha, jump in ends if alpha < 0.5 * sum(gap)), gap)
            for value, gap in judged
        ]
        values = [value for value, _ in judged]
        degree = max(values, key=values.count, default=None)
    merged: list[Gap] = []
    for lo, hi in (gap for value, gap in judged if value != degree):
        touches = merged and merged[-1][1] == lo
        merged.append((merged.pop()[0] if touches else lo, hi))
    return merged


#: A special point known to fewer digits may hide another special point: then no search keeps a
#: promise.
TOO_FEW_DIGITS = 2.0
#: A piece that stops closer than this part of the interval to an end stops because of that end.
AT_THE_END = 1e-6
#: Most stretches in which, and most unknowns for which, solutions are compared.
MOST_STRETCHES, MOST_SOLVED = 32, 64
#: Where in a stretch solutions are compared: in the middle, and next to the middle.
AMID = (0.5, 0.501)
#: At most this many places of a kind are listed; further places are counted.
MOST_PLACES_LISTED = 3
#: What is said of corners at which only some ways on are known.
IN_PART = "a corner was searched in part (one way on, possibly of several)"
WORDS = {
    Guarantee.NOTHING: "balanced",
    Guarantee.BUT_LOOPS: "complete but for closed loops",
    Guarantee.EVERYTHING: "complete",
    Guarantee.UNIQUE: "complete (unique by the system's promise)",
}


def verdict(graph: ConnectedPieces) -> str:
    """Return what is known of a graph, for :attr:`pwscont.BranchGraph.guarantee`."""
    if spent := graph.searched.spent:
        ended = spent.partition(";")[0]
        stopped = [point for point in graph.special_points(Kind.STOPPED) if ended in point.message]
        places = _listed("open ends", graph, stopped, _accumulation)
        return "; ".join([f"{spent}: there may be more", *places])
    ends = [point for point in loose_ends(graph) if is_on_purpose(graph, point)]
    if gaps := unbalanced(graph) or doubled(graph):
        return f"not balanced: {'; '.join(_causes(graph, gaps))}"
    doubts = list(_doubts(graph))
    promises = graph.searched.promise not in (Guarantee.NOTHING, Guarantee.UNIQUE)
    found = graph.pieces or graph.infinite or any(p.kind != Kind.STOPPED for p in graph.nodes)
    if not found and not promises:
        where = "on" if graph.searched.what == NOT_SEARCHED.what else "by"
        return "; ".join([f"{outcome.NOTHING_FOUND} {where} {graph.searched.what}", *doubts])
    words = "balanced" if doubts else WORDS[graph.searched.promise]
    single = {stretch[0] for stretch in graph.infinite if stretch[0] == stretch[1]}
    single |= {piece.interval[0] for piece in graph.verticals}
    upright = [point for point in _lost(graph) if leaves_upright(graph, point)]  # said of these
    single = {a for a in single if all(abs(a - p.alpha) > _blur(p) for p in upright)}
    infinite = [point for point in graph.nodes if point.alpha in single]
    said = _listed("infinitely many solutions", graph, infinite)
    return "; ".join([words, *doubts, *said, *_listed("a branch ends on purpose", graph, ends)])


def _causes(graph: ConnectedPieces, gaps: list[Gap]) -> Iterator[str]:
    """Yield why the sum is wrong on some stretches of alpha, each kind of cause once."""
    ends = list(loose_ends(graph))
    stopped = [point for point in ends if point.kind == Kind.STOPPED or point.lost]
    on_purpose = [point for point in ends if is_on_purpose(graph, point)]
    twice = [gap for gap in gaps if _stands_twice(graph, gap)]
    known = np.array([point.alpha for point in stopped + on_purpose])
    explained = {gap for gap in gaps if any(graph.same(known, end).any() for end in gap)}
    partial = graph.special_points(Kind.PARTIAL_CORNER)
    missing = [gap for gap in gaps if not partial and gap not in explained and gap not in twice]
    if missing:
        yield f"at least one branch missing in {listed(missing)}{_or_wrong_degree(graph)}"
    if twice:
        yield f"a solution stands twice in {listed(twice)}"
    yield from _stops(graph, stopped)
    yield from _touches(graph)
    yield from _left_out(graph)
    yield from _listed(IN_PART, graph, partial)
    yield from _listed("a branch ends on purpose", graph, on_purpose)


def _or_wrong_degree(graph: ConnectedPieces) -> str:
    """Return the words for one balance everywhere, not the degree, after a complete search."""
    degree = graph.system.degree if graph.system else None
    values = balance_values(graph)
    if degree is None or len(values) > 1 or graph.searched.promise == Guarantee.NOTHING:
        return ""
    promise = f"{type(graph.system).__name__}.degree = {degree}"
    return f", or {promise} is wrong, for the balance is {values[0]} everywhere"


def listed(gaps: Iterable[Gap]) -> str:
    """Return stretches of alpha in words."""
    return ", ".join(f"({', '.join(apart(lo, hi))})" for lo, hi in gaps)


def _stands_twice(graph: ConnectedPieces, gap: Gap) -> bool:
    """Tell whether two solutions amid a stretch agree within the estimated errors.

    Two curves that touch agree at one place; a solution that stands twice agrees next to it, too.
    """
    with suppress(PwscontError):  # the graph was loaded without a system, or is damaged here
        for part in AMID:
            found = queries.solutions_at(graph, gap[0] + part * (gap[1] - gap[0]))
            if not any(are_one(a, b) for a, b in combinations(found, 2)):
                return False
        return True
    return False


def doubled(graph: ConnectedPieces) -> list[Gap]:
    """Return where a solution of a curved system stands twice, among the widest stretches.

    A step that jumped between close branches leaves a piece on both: the balance need not change.
    """
    system = graph.system
    if system is None or isinstance(system, SlicewiseLinearSystem) or system.size > MOST_SOLVED:
        return []
    gaps = sorted((gap for _, gap in _judged(graph)), key=lambda gap: gap[0] - gap[1])
    return [gap for gap in gaps[:MOST_STRETCHES] if _stands_twice(graph, gap)]


def _doubts(graph: ConnectedPieces) -> Iterator[str]:
    """Yield what was found at special points and prevents a search from keeping a promise."""
    of_many = {point for point in graph.nodes if queries.is_beside_infinite(graph, point.alpha)}
    alone = [p for p in _lost(graph) if not (says(p.message, Remark.FILL_CURVES) and p in of_many)]
    yield from _stops(graph, alone)
    yield from _left_out(graph)
    yield from _listed(IN_PART, graph, graph.special_points(Kind.PARTIAL_CORNER))
    if known := [stretch.ends for stretch in graph.infinite if stretch[0] < stretch[1]]:
        yield f"infinitely many solutions for {graph.parameter} in {', '.join(known)}"
    filled = [p for p in graph.nodes if says(p.message, Remark.FILL) and p not in of_many]
    wide = [p for p in filled if not all(piece.is_vertical for piece in graph.pieces_at(p.id))]
    is_straight = isinstance(graph.system, SlicewiseLinearSystem)  # else known to first order only
    fill = "solutions fill" if is_straight else "solutions may fill"
    yield from _listed(f"{fill} more than curves", graph, wide)
    yield from _touches(graph)
    twofold = [point for point in graph.nodes if says(point.message, Remark.TWOFOLD)]
    yield from _listed("two curves may be taken for one on the piece that ends", graph, twofold)
    begun, errors = [], dict(zip((p.id for p in graph.nodes), graph.alpha_errors, strict=True))
    for piece in graph.pieces:  # alpha rises and falls, by more than rounding and the ends' errors
        error = max(errors[piece.start], errors[piece.end])
        clear = GUARD * EPS * np.abs(piece.alpha).max() + CONFIDENCE * error
        steps = np.diff(piece.alpha)
        if steps.min() < -clear and steps.max() > clear:
            begun.append(graph.point(piece.start))
    yield from _listed("a fold was passed over on the piece that begins", graph, begun)
    vague = [point for point in graph.nodes if point.digits < TOO_FEW_DIGITS]
    yield from _listed("hardly a digit is known", graph, vague)


def _left_out(graph: ConnectedPieces) -> Iterator[str]:
    """Yield what a run left out of its search."""
    for what, words in ("the search was", outcome.GIVEN_UP), ("starts were", outcome.IN_VAIN):
        if words in graph.searched.what:
            yield f"{what} {words}"


def _touches(graph: ConnectedPieces) -> Iterator[str]:
    """Yield where only the curves that arrive are known to go on."""
    touching = [point for point in graph.nodes if says(point.message, Remark.TOUCH)]
    yield from _listed("curves touch, or more than two cross,", graph, touching)


def _stops(graph: ConnectedPieces, points: list[SpecialPoint]) -> Iterator[str]:
    """Yield where pieces were stopped, and why: in the numbers, or at the end of the model."""
    groups: dict[str, list[SpecialPoint]] = {}
    for point in points:
        groups.setdefault(_what_happened(graph, point), []).append(point)
    for what, some in groups.items():
        yield from _listed(what, graph, some, _reason)


def _what_happened(graph: ConnectedPieces, point: SpecialPoint) -> str:
    """Return the words for a stopped piece: the model ends there, seems to end, or does not."""
    if says(point.message, FailureReason.NOT_FINITE):
        return "the model ends"
    if leaves_upright(graph, point):
        return "infinitely many solutions"
    near = AT_THE_END * (graph.interval[1] - graph.interval[0])
    domain = graph.system.domain if graph.system else ()
    at_an_end = any(abs(point.alpha - end) <= near for end in (*domain, *graph.interval))
    is_arrived = graph.pieces_at(point.id)  # else a start that could not be followed
    if at_an_end and is_arrived and not queries.is_infinite(graph, point.alpha):
        return "the model seems to end"
    return "a piece was stopped"


def _reason(point: SpecialPoint) -> str:
    """Return why a piece was stopped, without the advice, and where special points accumulate."""
    known = [reason.value for reason in FailureReason if says(point.message, reason)]
    words = (known or point.message.split("; ")[-1:])[0].split(";")[0].split(": ")[0]
    return "; ".join(filter(None, dict.fromkeys([words, _accumulation(point)])))


def _accumulation(point: SpecialPoint) -> str:
    """Return the part of the message about special points that accumulate."""
    _, what, limit = point.message.partition(Remark.ACCUMULATE)
    return f"{what}{limit.split(';')[0]}"


def _listed(
    what: str,
    graph: ConnectedPieces,
    points: Iterable[SpecialPoint],
    why: Callable[[SpecialPoint], str] = lambda _: "",
) -> Iterator[str]:
    """Yield a line for each reason, with the places of the points that share the reason."""
    alphas: dict[str, dict[str, None]] = {}
    for point in points:
        place = number(graph.clean(point.alpha), graph.interval)
        alphas.setdefault(why(point), {})[place] = None
    for reason, found in alphas.items():
        shown, rest = list(found)[:MOST_PLACES_LISTED], len(found) - MOST_PLACES_LISTED
        more = f" and {rest} more" if rest > 0 else ""
        because = f" ({reason})" if reason else ""
        yield f"{what} at {graph.parameter} = {', '.join(shown)}{more}{because}"

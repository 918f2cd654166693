"""What tests of the journal share."""

import numpy as np

from pwscont import InvalidInputError, Journal, explore

ROUNDING = {"rtol": 1e-12, "atol": 1e-13}


def same(a, b):
    assert len(a.pieces) == len(b.pieces)
    for one, other in zip(a.pieces, b.pieces, strict=True):
        assert (one.start, one.end, one.label) == (other.start, other.end, other.label)
        assert one.character == other.character
        assert one.det_sign == other.det_sign
        np.testing.assert_allclose(one.points, other.points, **ROUNDING)
    for one, other in zip(a.special_points(), b.special_points(), strict=True):
        assert (one.kind, one.message) == (other.kind, other.message)
        np.testing.assert_allclose([*one.z, one.alpha], [*other.z, other.alpha], **ROUNDING)


def finished(path):
    if not path.exists():
        return 0
    journal = Journal(path)
    pieces = len(journal)
    journal.close()
    return pieces


# -- damage -------------------------------------------------------------------------------------


def flipped(content, rng):
    return bit_turned(content, rng.integers(len(content)), rng.integers(8))


def overwritten(content, rng):
    at, count = rng.integers(len(content)), rng.integers(1, 40)
    return content[:at] + rng.bytes(count) + content[at + count :]


def zeroed(content, rng):
    """Lose a page, as a disk does."""
    page = 512 * rng.integers(len(content) // 512 + 1)
    return content[:page] + bytes(len(content[page : page + 512])) + content[page + 512 :]


def truncated(content, rng):
    return content[: rng.integers(len(content))]


def cut_out(content, rng):
    at, count = rng.integers(len(content)), rng.integers(1, 600)
    return content[:at] + content[at + count :]


def doubled(content, rng):
    at, count = rng.integers(len(content)), rng.integers(1, 600)
    return content[: at + count] + content[at:]


def lengthened(content, rng):
    """Return the content with zeros behind, as after a failure of the power."""
    return content + bytes(int(rng.integers(1, 5000)))


DAMAGES = (flipped, overwritten, zeroed, truncated, cut_out, doubled, lengthened)


def recorded(path, made, **how):
    journal = Journal(path)
    try:
        return explore(made.system, made.interval, journal=journal, **how)
    finally:
        journal.close()


def bit_turned(content, at, bit):
    return content[:at] + bytes([content[at] ^ (1 << bit)]) + content[at + 1 :]


def damaged(path, made, content, truth):
    """Go on with a damaged journal; returns whether it was refused in words."""
    path.write_bytes(content)
    try:
        graph = recorded(path, made)
    except InvalidInputError as refusal:
        words = str(refusal)
    else:
        same(graph, truth)
        same(recorded(path, made), truth)  # what was written behind the damage is read again
        return False
    assert "remove it, or write elsewhere" in words or "cannot be written" in words
    assert str(path) in words
    return True

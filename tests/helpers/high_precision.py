"""Elementary functions in balls of 256 bits, by python-flint (Arb, on MPFR's arithmetic)."""

from fractions import Fraction

from flint import arb, ctx

BITS = 256
#: Names of numpy's functions that Arb names otherwise.
NAMES = {"arcsin": "asin", "arctan": "atan", "arcsinh": "asinh", "arctanh": "atanh"}


def balls(name, numbers):
    """Return the values of a function of floats, each as a narrow ball."""
    ctx.prec = BITS
    function = getattr(arb, NAMES.get(name, name))
    return [function(arb(x)) for x in numbers.tolist()]


def exact(name, x):
    """Return a function of a float, to about sixty digits."""
    ctx.prec = BITS
    mantissa, exponent = getattr(arb(float(x)), NAMES.get(name, name))().mid().man_exp()
    return Fraction(int(mantissa)) * Fraction(2) ** int(exponent)

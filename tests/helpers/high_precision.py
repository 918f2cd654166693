"""Elementary functions to sixty digits, by the decimal module and series."""

from decimal import Decimal, localcontext

DIGITS = 60


def _sum(first, following):
    """Return the sum of a series from its first term and the rule for the next."""
    total, term, k = Decimal(0), first, 0
    while abs(term) > Decimal(10) ** -DIGITS * max(abs(total), Decimal(10) ** -400):
        total, k = total + term, k + 1
        term = following(term, k)
    return total


def sine(x):
    return _sum(x, lambda term, k: -term * x * x / ((2 * k) * (2 * k + 1)))


def cosine(x):
    return _sum(Decimal(1), lambda term, k: -term * x * x / ((2 * k - 1) * (2 * k)))


def arctangent(x):
    if abs(x) > Decimal("0.1"):
        return 2 * arctangent(x / (1 + (1 + x * x).sqrt()))
    return _sum(x, lambda term, k: -term * x * x * (2 * k - 1) / (2 * k + 1))


def sinh(x):
    return (x.exp() - (-x).exp()) / 2


def cosh(x):
    return (x.exp() + (-x).exp()) / 2


FUNCTIONS = {
    "sqrt": Decimal.sqrt,
    "exp": Decimal.exp,
    "expm1": lambda x: x.exp() - 1,
    "log": Decimal.ln,
    "log1p": lambda x: (1 + x).ln(),
    "sin": sine,
    "cos": cosine,
    "tan": lambda x: sine(x) / cosine(x),
    "arcsin": lambda x: arctangent(x / (1 - x * x).sqrt()),
    "arctan": arctangent,
    "sinh": sinh,
    "cosh": cosh,
    "tanh": lambda x: sinh(x) / cosh(x),
    "arcsinh": lambda x: (x + (1 + x * x).sqrt()).ln(),
    "arctanh": lambda x: ((1 + x) / (1 - x)).ln() / 2,
}


def exact(name, x):
    """Return a function of a float, to about fifty digits."""
    with localcontext() as context:
        context.prec = 2 * DIGITS
        context.Emin, context.Emax = -(10**6), 10**6
        return FUNCTIONS[name](Decimal(float(x)))

"""The derivatives of numpy's functions, and which of them have kinks."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from pwscont.basics.errors import InvalidSystemError

#: Smooth functions of one argument: the derivative from the argument and the value.
SMOOTH: dict[str, Callable[[Any, Any], Any]] = {
    "negative": lambda x, y: -np.ones_like(x),
    "positive": lambda x, y: np.ones_like(x),
    "square": lambda x, y: 2.0 * x,
    "sqrt": lambda x, y: 0.5 / y,
    "cbrt": lambda x, y: y / (3.0 * x),
    "reciprocal": lambda x, y: -y * y,
    "exp": lambda x, y: y,
    "exp2": lambda x, y: np.log(2.0) * y,
    "expm1": lambda x, y: y + 1.0,
    "log": lambda x, y: 1.0 / x,
    "log2": lambda x, y: 1.0 / (np.log(2.0) * x),
    "log10": lambda x, y: 1.0 / (np.log(10.0) * x),
    "log1p": lambda x, y: 1.0 / (1.0 + x),
    "sin": lambda x, y: np.cos(x),
    "cos": lambda x, y: -np.sin(x),
    "tan": lambda x, y: 1.0 + y * y,
    "arcsin": lambda x, y: 1.0 / np.sqrt(1.0 - x * x),
    "arccos": lambda x, y: -1.0 / np.sqrt(1.0 - x * x),
    "arctan": lambda x, y: 1.0 / (1.0 + x * x),
    "sinh": lambda x, y: np.cosh(x),
    "cosh": lambda x, y: np.sinh(x),
    "tanh": lambda x, y: 1.0 - y * y,
    "arcsinh": lambda x, y: 1.0 / np.sqrt(1.0 + x * x),
    "arccosh": lambda x, y: 1.0 / np.sqrt(x * x - 1.0),
    "arctanh": lambda x, y: 1.0 / (1.0 - x * x),
    "deg2rad": lambda x, y: np.full_like(x, np.pi / 180.0),
    "rad2deg": lambda x, y: np.full_like(x, 180.0 / np.pi),
}
#: Smooth functions of two arguments: the derivatives by either, from both and the value.
OF_TWO: dict[str, tuple[Callable[[Any, Any, Any], Any], ...]] = {
    "add": (lambda a, b, y: 1.0, lambda a, b, y: 1.0),
    "subtract": (lambda a, b, y: 1.0, lambda a, b, y: -1.0),
    "multiply": (lambda a, b, y: b, lambda a, b, y: a),
    "divide": (lambda a, b, y: 1.0 / b, lambda a, b, y: -y / b),
    "arctan2": (lambda a, b, y: b / (a * a + b * b), lambda a, b, y: -a / (a * a + b * b)),
    "hypot": (lambda a, b, y: a / y, lambda a, b, y: b / y),
    "power": (lambda a, b, y: b * a ** (b - 1.0), lambda a, b, y: np.log(a) * y),
    "float_power": (lambda a, b, y: b * a ** (b - 1.0), lambda a, b, y: np.log(a) * y),
}
#: Functions with kinks or jumps, and what to write instead.
KINKED = {
    **dict.fromkeys(["absolute", "fabs"], "sw.abs"),
    **dict.fromkeys(["maximum", "fmax", "max", "amax"], "sw.max"),
    **dict.fromkeys(["minimum", "fmin", "min", "amin"], "sw.min"),
    "clip": "sw.clip",
    **dict.fromkeys(["sort", "argsort", "argmax", "argmin", "median", "round", "around"], ""),
    **dict.fromkeys(["sign", "heaviside", "copysign", "signbit"], "sw.where"),
    **dict.fromkeys(["floor", "ceil", "rint", "trunc", "remainder", "fmod"], ""),
    **dict.fromkeys(["floor_divide", "mod", "logical_and", "logical_or", "logical_not"], ""),
    **dict.fromkeys(["less", "less_equal", "greater", "greater_equal"], "sw.where"),
    **dict.fromkeys(["equal", "not_equal"], "sw.where"),
}
#: Questions to which the values alone are the answer.
QUESTIONS = frozenset({"isfinite", "isnan", "isinf"})


class UntraceableError(TypeError):
    """Something is done to a Dual of which the derivative is not known."""


def refuse_kink(name: str) -> InvalidSystemError:
    """Return the error for a kink that no switch announces."""
    better = KINKED.get(name)
    advice = f"write {better} instead" if better else "write it with the switches of sw"
    return InvalidSystemError(
        f"the function decides by numpy's {name!r} of something that depends on (z, alpha), a kink "
        f"that no switch announces: {advice}; if it is smooth all the same, Complementarity takes "
        "its derivatives as jacobian=..., and a PiecewiseSystem any function"
    )

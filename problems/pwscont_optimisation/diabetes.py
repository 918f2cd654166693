"""The diabetes data of Efron, Hastie, Johnstone and Tibshirani (2004): 442 patients, 10 features.

The LASSO needs only products of the data. Features are centred and of unit length, so that the
products are correlations; the response, a measure of the disease a year later, is centred.
"""

from __future__ import annotations

import numpy as np

from pwscont.extending import Array

FEATURES = ("age", "sex", "bmi", "bp", "s1", "s2", "s3", "s4", "s5", "s6")
#: X_j . y
PRODUCTS = (
    304.18307453,
    69.715355678,
    949.43526038,
    714.7382595,
    343.25445189,
    281.78459335,
    -639.14527932,
    696.88303009,
    916.13737455,
    619.22282068,
)
#: X_i . X_j below the diagonal, row by row from the second.
BELOW = (
    (0.173737100564,),
    (0.185084666147, 0.088161399023),
    (0.335427587067, 0.241010486649, 0.395410898718),
    (0.26006082015, 0.035276819176, 0.249777421742, 0.242464022707),
    (0.219243139848, 0.142637257033, 0.261169911164, 0.185548462613, 0.89666295781),
    (
        -0.075180974875,
        -0.379089629227,
        -0.366810978405,
        -0.178761631226,
        0.051519364315,
        -0.196455123744,
    ),
    (
        0.203840899729,
        0.332115093083,
        0.413806601831,
        0.257650053284,
        0.542207280523,
        0.659816888667,
        -0.738492729258,
    ),
    (
        0.270774241418,
        0.149916136496,
        0.446156538573,
        0.393480109045,
        0.515502924369,
        0.318356665142,
        -0.398577293429,
        0.617858973994,
    ),
    (
        0.301731007633,
        0.2081332162,
        0.3886799939,
        0.390430023116,
        0.325716753061,
        0.290600375497,
        -0.273697301476,
        0.417212113712,
        0.464668846691,
    ),
)


def correlations() -> Array:
    """Return X^T X, shape (10, 10)."""
    whole = np.eye(len(FEATURES))
    for i, row in enumerate(BELOW, 1):
        whole[i, :i] = whole[:i, i] = row
    return whole

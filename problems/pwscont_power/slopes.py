"""Derivatives of the power that flows into a network."""

from __future__ import annotations

from typing import final

import numpy as np
import scipy.sparse as sp

from pwscont.extending import Array, Indices


@final
class Slopes:
    """The derivatives of the power into the network by angles and sizes of voltages.

    With T_ik = V_i conj(Y_ik V_k), so that S_i = sum_k T_ik,

        dS_i/dtheta_k = -j T_ik + [i = k] j S_i,
        dS_i/d|V_k| = T_ik / |V_k| + [i = k] S_i / |V_i|,

    written such that nothing is divided by a voltage, which may be zero (Zimmerman, *AC Power
    Flows, Generalized OPF Costs and their Derivatives using Complex Matrix Notation*, MATPOWER
    Technical Note 2, 2010, section 4).

    Parameters
    ----------
    Y : sparse array, shape (buses, buses)
    others : ndarray of int
        The buses whose voltages are unknown; the mismatches of active powers come first, then the
        mismatches of reactive powers, as angles come before sizes.

    Attributes
    ----------
    places : tuple of ndarray
        Rows and columns of the derivatives that a call returns.
    """

    def __init__(self, Y: sp.csr_array, others: Indices) -> None:
        entries = Y.tocoo()
        inner = np.isin(entries.row, others) & np.isin(entries.col, others)
        self._i, self._k = entries.row[inner], entries.col[inner]
        self._Y, self._conj, self._others = Y, entries.data[inner].conj(), others
        n = len(others)
        diagonal = np.arange(n)
        row = np.concatenate([np.searchsorted(others, self._i), diagonal])
        column = np.concatenate([np.searchsorted(others, self._k), diagonal])
        self.places = (
            np.concatenate([row, row, row + n, row + n]),
            np.concatenate([column, column + n, column, column + n]),
        )

    def __call__(self, voltage: Array, unit: Array) -> Array:
        """Return the derivatives at voltages V and directions exp(i theta)."""
        current = (self._Y @ voltage).conj()[self._others]
        by_size = voltage[self._i] * self._conj * unit[self._k].conj()
        by_angle = -1j * voltage[self._i] * self._conj * voltage[self._k].conj()
        by_angle = np.concatenate([by_angle, 1j * voltage[self._others] * current])
        by_size = np.concatenate([by_size, unit[self._others] * current])
        return np.concatenate([by_angle.real, by_size.real, by_angle.imag, by_size.imag])

"""All solutions of a contact problem at one load by Siconos, as a program of its own.

    /usr/bin/python3 -I siconos.py < problem.json > answer.json

The problem is {"A", "N", "T", "F", "loads"}; the answer {"version", "runs": [{"seconds",
"solutions"}]}, or {"missing"} where Siconos is not on the machine. Run isolated (-I): this file
has the name of the package that it imports.

Per node, with r = -lam_nu, a = lam_t + F r, b = F r - lam_t and u_t = u+ - u-, static friction is
the linear complementarity problem gap >= 0 and r, a and u+, b and u-.
"""

import json
import sys
import time

#: Indices of Siconos' integer parameters.
CURRENT, SEED = 8, 9


def problem(np, A, N, T, F, load):
    """Return M and q of the complementarity problem for (r, a, u-)."""
    p, C = len(N), np.vstack([N, T])
    W, u = C @ np.linalg.solve(A, C.T), C @ np.linalg.solve(A, load)
    nn, nt, tn, tt = W[:p, :p], W[:p, p:], W[p:, :p], W[p:, p:]
    one, none = np.eye(p), np.zeros((p, p))
    rows = [[nn + F * nt, -nt, none], [-tn - F * tt, tt, one], [2.0 * F * one, -one, none]]
    return np.block(rows), np.concatenate([-u[:p], u[p:], np.zeros(p)])


def solutions(np, numerics, M, q, F):
    """Return (lam_nu, lam_t, u_t) of every solution, each once."""
    p, found, seed = len(q) // 3, [], 0
    lcp, options = numerics.LCP(M, q), numerics.SolverOptions(numerics.SICONOS_LCP_ENUM)
    while True:
        z, w = np.zeros(3 * p), np.zeros(3 * p)
        options.iparam[SEED] = seed
        if numerics.lcp_enum(lcp, z, w, options) or options.iparam[CURRENT] < seed:
            return found  # no more, or back at the first
        seed = int(options.iparam[CURRENT]) + 1
        r, a, minus = np.split(z, 3)
        new = np.concatenate([-r, a - F * r, w[p : 2 * p] - minus])
        if not any(np.abs(new - old).max() < 1e-6 for old in found):  # its own tolerance
            found.append(new)


def main():
    """Solve the problem on standard input."""
    try:
        import numpy as np  # noqa: PLC0415  the system's Python may have neither
        from siconos import numerics  # noqa: PLC0415
    except ImportError:
        print(json.dumps({"missing": "not on this machine"}))
        return
    given = json.load(sys.stdin)
    A, N, T = (np.array(given[name]) for name in "ANT")
    runs = []
    for load in given["loads"]:
        begin = time.perf_counter()
        M, q = problem(np, A, N, T, given["F"], np.array(load))
        found = solutions(np, numerics, M, q, given["F"])
        seconds = time.perf_counter() - begin
        runs.append({"seconds": seconds, "solutions": [z.tolist() for z in found]})
    print(json.dumps({"runs": runs}))


if __name__ == "__main__":
    main()

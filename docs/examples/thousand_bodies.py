r"""
A thousand bodies on a cluster
==============================

How common is non-uniqueness? No single body tells; a thousand random ones do. This page draws them
from seeds, asks each how many equilibria it has, and says what changes when the cases go to the
processes of one machine or to a cluster. The numbers do not.
"""

# %%
# A body from a seed
# ------------------
#
# A case is one pure call: the same settings must give the same system, on any machine. So a random
# body is made from a seed that is a setting. This one has two contact nodes, a stiffness with
# strong coupling, and a load that turns from pressing to pulling along :math:`\alpha`.
import numpy as np
from pwscont_coulomb import AffineLoad, ContactBody, CoulombLoad

from pwscont import Study, explore

PICK = np.eye(4)


def random_body(seed, friction):
    rng = np.random.default_rng(seed)
    root = rng.normal(size=(4, 4))
    body = ContactBody(root @ root.T + 0.2 * np.eye(4), N=PICK[[0, 2]], T=PICK[[1, 3]])
    start, direction = rng.normal(size=(2, 4))
    return CoulombLoad(body, AffineLoad(start, direction), friction), (-3.0, 3.0)


# %%
# The study
# ---------
#
# 250 seeds under four coefficients of friction are a thousand cases; this page computes the first
# 60 seeds, in a few seconds. Two things are measured of each graph: the largest number of
# equilibria under any load of the path, and over which part of the path there are several.
frictions, seeds = [0.1, 0.3, 1.0, 3.0], range(60)
over = {"seed": seeds, "friction": frictions}
study = Study(random_body, over, ["max-count", "non-unique-length"])
result = study.run()
print(result)
print(f"{len(result.failures())} failed, {int(result.column('proven').sum())} proven")

# %%
# Each row has its settings, its values and what they are worth. A case that cannot be computed is a
# row that says why, and not the end of the study.
#
# Columns are arrays, in the order of the cases; the last setting runs fastest.
largest = result.column("max-count").reshape(len(seeds), 4)
for friction, numbers in zip(frictions, largest.T, strict=True):
    several = np.count_nonzero(numbers > 1)
    print(f"F = {friction}: {several} bodies have several equilibria, at most {numbers.max():.0f}")

# %%
# A picture of how the share grows with friction:
import matplotlib.pyplot as plt

figure, ax = plt.subplots(figsize=(5.5, 3.2), layout="constrained")
for count, style in ((3, "-"), (5, "--")):
    share = (largest >= count).mean(axis=0)
    ax.semilogx(frictions, share, f"{style}ok", label=f"{count} equilibria or more")
ax.set(xlabel="coefficient of friction F", ylabel="share of the bodies")
ax.set_xticks(frictions, [f"{friction:g}" for friction in frictions])
ax.legend()
plt.show()

# %%
# The body with the most equilibria is one call away, for a body follows from its settings alone:
worst = max((row for row in result if not row.failure), key=lambda row: row.values["max-count"])
graph = explore(*random_body(**worst.settings))
print(dict(worst.settings), [(p.kind.value, round(p.alpha, 4)) for p in graph.special_points()][:4])

# %%
# The cores of one machine
# ------------------------
#
# Put the function into a file, say ``bodies.py``, and the study under the usual guard, so that the
# processes can import the one without running the other::
#
#     from bodies import random_body
#     from pwscont import Study
#
#     if __name__ == "__main__":
#         study = Study(random_body, over, ["max-count", "non-unique-length"])
#         result = study.run(workers=8, store="bodies.db")
#         result.write_csv("bodies.csv")
#
# One process a core is best: each keeps its linear algebra to one thread, since threads of small
# matrices only wait for each other. Every row is in the file as soon as its body is finished. After
# Ctrl-C, a power cut or ``kill -9`` add ``resume=True``: finished rows are kept, and one of them is
# run again to see that the function is still the same.
#
# A cluster
# ---------
#
# On several machines the cases go through Dask. It is to be installed on all of them
# (``pip install '.[study]'`` in a checkout), with the same versions of Python, numpy, scipy and
# pwscont: other versions are refused before any work, for they may give other last digits. On the
# machine that the others can reach::
#
#     dask scheduler
#
# which prints its address, and on each of the others, with as many workers as cores and one thread
# each, in a directory that has ``bodies.py`` (or with that directory in ``PYTHONPATH``)::
#
#     dask worker tcp://10.0.0.1:8786 --nworkers 8 --nthreads 1
#
# Under a queueing system the second line is what each task of the job runs; under Slurm::
#
#     srun --ntasks=16 --cpus-per-task=8 dask worker tcp://10.0.0.1:8786 --nworkers 8 --nthreads 1
#
# Then, from anywhere that reaches the scheduler::
#
#     result = study.run(scheduler="tcp://10.0.0.1:8786", store="bodies.db")
#
# or, for a scene, ``pwscont sweep ... --scheduler tcp://10.0.0.1:8786 -o out``. To try it on one
# machine, Dask's own small cluster will do::
#
#     from distributed import LocalCluster
#
#     with LocalCluster(n_workers=2, threads_per_worker=1) as cluster:
#         result = study.run(scheduler=cluster.scheduler_address, store="bodies.db")
#
# What to expect:
#
# - Rows come in any order and are stored by their case; the result is the same, bit for bit.
# - A few hundred cases are sent ahead, whatever the number of all: memory stays flat.
# - A worker that dies is replaced if Dask was told so (its ``--nanny`` is on by default), and its
#   cases run again. A case that ends several workers becomes a failed row.
# - If the scheduler goes away the study ends with an error, what is stored stays, and
#   ``resume=True`` goes on with it.
# - ``graphs="folder"`` writes the graph of each case, by the worker that made it: the folder must
#   be one that all machines see.

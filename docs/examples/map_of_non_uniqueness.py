r"""
A map of non-uniqueness
=======================

One curve answers for one body under one load. Often the question is wider: for which friction and
which direction of the load is the state of rest unique, and how badly does that fail elsewhere? A
study asks the same questions to a problem under many settings, keeps every answer with what it is
worth, and draws the map.
"""

# %%
# A function of settings
# ----------------------
#
# The body is that of Example 1 of Janovský and Ligurský (2012), with two contact nodes and a load
# that grows with :math:`\alpha`. Its direction is turned by an angle. What is varied are the
# parameters of a function; it returns a system with the interval of :math:`\alpha`.
import numpy as np
from pwscont_coulomb import AffineLoad, ContactBody, CoulombLoad

from pwscont import CriticalValue, Study, explore

A = [[1.0, -1, 0, 0], [-1, 2, -1, 0], [0, -1, 2, -1], [0, 0, -1, 2]]
body = ContactBody(A, N=np.eye(4)[[0, 2]], T=np.eye(4)[[1, 3]])


def turned(friction, angle):
    c, s = np.cos(np.radians(angle)), np.sin(np.radians(angle))
    load = AffineLoad([0.4, 0.0, 1.8, 0.0], [s, c, 0.2 * c + s, c])
    return CoulombLoad(body, load, friction), (-8.0, 2.0)


# %%
# The map
# -------
#
# Each combination of values is a case: one exploration, and then whatever is to be measured of its
# graph. The first measure is the largest number of solutions under any load of the path, the second
# where the path folds first.
over = {"friction": np.linspace(0.75, 4.25, 8), "angle": np.linspace(-40.0, 40.0, 9)}
result = Study(turned, over, ["max-count", "first-fold"]).run()
print(result)
figure = result.plot("max-count")

# %%
# Colours are numbers of solutions. A cell would be hatched if its graph were not complete, so that
# its number were a least number only, and a cross would be a case that failed; each row says why:
for row in list(result)[:3]:
    print(dict(row.settings), dict(row.values), row.guarantee)
print(f"{len(result.failures())} failed, {int(result.column('proven').sum())} proven")

# %%
# Any case can be looked at by itself. Here are the loads under which the body has seven states:
graph = explore(*turned(4.25, -20.0))
for stretch in graph.with_count(7):
    print(stretch.ends)

# %%
# The edge of the map
# -------------------
#
# Where does the map change its colour from one solution to three? A map of cells is as fine as its
# cells. :class:`~pwscont.CriticalValue` varies one further setting by bisection, and asks the graph
# at each value whether somewhere there is more than one solution. Nothing is read off a picture,
# and a row is proven only if every graph on the way was complete.
critical = CriticalValue("friction", 0.5, 5.0, tolerance=1e-4)
edge = Study(turned, {"angle": [-20.0, 0.0, 20.0]}, {"critical friction": critical}).run()
for row in edge:
    print(dict(row.settings), dict(row.values), "proven" if row.proven else row.guarantee)

# %%
# Without turning it is 2, the value that :doc:`critical_friction` finds by following a fold. Turned
# by -20 degrees the load lifts node 2 while node 1 slips, for which the formula there gives 4/3.
#
# More cases, more cores
# ----------------------
#
# The same study in two processes, with every row in a file as it comes::
#
#     result = study.run(workers=2, store="map.db")
#
# Functions then stand at the top of a module, and the lines that run the study under
# ``if __name__ == "__main__":``. Ctrl-C, a power cut or ``kill -9`` lose nothing that was finished:
# ``run(..., store="map.db", resume=True)`` goes on, and :meth:`StudyResult.open
# <pwscont.StudyResult.open>` reads what is there. With 100,000 rows in a file the memory of the
# process stays what it was.
#
# On several machines, Dask hands out the cases. Its scheduler and workers are started as its manual
# says, with one thread each (``pip install '.[study]'`` on every machine)::
#
#     dask scheduler
#     dask worker tcp://10.0.0.1:8786 --nworkers 8 --nthreads 1
#
# and ``study.run(scheduler="tcp://10.0.0.1:8786")`` gives the same numbers, bit for bit. A worker
# that dies is replaced, and its cases run again.
#
# From the command line any scene with settings will do; table, pictures and store go to a
# directory::
#
#     pwscont sweep wedge --over friction=0.1:2:20 --over angle=10:40:7 \
#         --measure max-count --measure first-fold -o out --workers 2
#
# For other programs there are ``result.to_dataframe()``, ``result.to_xarray()``,
# ``write_csv`` and ``write_netcdf``.

r"""
Look at a branch
================

A picture on paper shows what its author thought of. A view in the browser answers further
questions: which solutions are there at this load, what does the one under the pointer look like,
how does another unknown change along the same branch? :class:`pwscont.View` makes one page of a
branch graph, a file that needs neither a server nor a network. It takes Bokeh, the extra ``view``:
``pip install '.[view]'`` in a checkout.
"""

# %%
# From a graph to a page
# ----------------------
#
# The two-node problem of the paper, Example 1, has up to five solutions at one load.
import tempfile
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np
from pwscont_coulomb.elastic import ElasticPicture
from pwscont_coulomb.elastic.scenes import wedge_body
from pwscont_coulomb.scenes import example1

from pwscont import View, explore, plot

graph = example1().run()
view = View(graph, "u_t,1", title="Example 1 of the paper")
print(view)

folder = Path(tempfile.mkdtemp())
page = view.save(folder / "example1.html")
print(f"{page.name}: {page.stat().st_size / 1e6:.1f} MB, most of it Bokeh")

# %%
# In a notebook nothing needs to be saved: the view as the last line of a cell shows itself. From
# the command line the page of a scene is written by ``--html``, and that of a graph from an earlier
# run by ``pwscont view``, which builds the scene again that the file names:
#
# .. code-block:: console
#
#    $ pwscont run wedge --html wedge.html
#    $ pwscont run wedge -o out
#    $ pwscont view out/wedge.npz --open
#
# A body
# ------
#
# What a solution looks like on a body, its picture knows. Scenes of elastic bodies bring one along;
# with a body of your own you say it. Here a wedge jams in its slot, with five contact nodes on each
# wall.
problem = wedge_body(nodes=5).condensed()
jam = explore(problem.along_load(), (0.0, 0.2))
shown = View(jam, "u_t,1", title="A wedge that jams", body=ElasticPicture(problem))
print(f"{shown.save(folder / 'wedge.html').stat().st_size / 1e6:.1f} MB")

# %%
# This is the page of the scene ``wedge``. Drag to move and turn the wheel to zoom; click on a
# branch, or move the slider: the list has all solutions at that load, and the body is the one that
# is chosen.
#
# .. raw:: html
#
#    <iframe src="../_static/views/wedge.html" title="the wedge"
#            style="width: 100%; height: 780px; border: 1px solid #ccc"></iframe>
#    <p><a href="../_static/views/wedge.html">the same in a window of its own</a></p>
#
# Colours are branches, line styles modes, thin lines a negative determinant, as in the pictures by
# :func:`pwscont.plot`:
figure, ax = plt.subplots(figsize=(6.5, 4.2), layout="constrained")
plot(jam, "u_t,1", ax=ax)

# %%
# What is exact
# -------------
#
# On straight pieces, and at special points, the numbers of a page are those of the graph. On curved
# pieces the page holds points of the cubics between the computed points; what lies between those is
# interpolated along the curve, marked by ≈ and shown with the digits that two coarser
# interpolations share, four at most. The same holds for recorded quantities along straight pieces,
# unless they are straight, too. What is smaller than the error of its column reads as 0. Ask the
# graph for all digits:
for solution in jam.solutions(0.07):
    print(f"u_t,1 = {solution['u_t,1']:+.8f}, det {solution.det_sign:+d}")

# %%
# The number of solutions below the diagram is the graph's own, with its guarantee: where branches
# may be missing, the page says "at least".
print(jam.guarantee)
print([stretch.ends for stretch in jam.with_count(3)])

# %%
# Bodies of one's own
# -------------------
#
# :class:`pwscont.extending.BodyPicture` has two methods: ``shapes`` returns the body in several
# states (where its nodes are drawn, how elements are coloured, pressure and shear of the contact
# nodes), and ``contact_states`` what each contact node does in a cell. ``ElasticPicture`` is
# the picture of finite element bodies:
picture = ElasticPicture(problem)
middle = jam.solutions(0.07)[1]
shapes = picture.shapes(np.append(middle.z, middle.alpha)[np.newaxis])
print(shapes.positions.shape, shapes.pressure.round(5))
print(picture.contact_states(middle.character))

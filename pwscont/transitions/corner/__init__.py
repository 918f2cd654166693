"""Corners, where several interfaces meet: all rays that leave a corner.

The way in is :func:`pwscont.transitions.corner.cone.tangent_cone`, which takes a
:class:`pwscont.transitions.corner.cells.Corner`.
"""

"""Bounds of the rays that a pixel requests, so that no ray is traced in vain.

Read in this order: `windows` (the aims of rays), `slopes` (a stop, a view or an image bounds slopes by
strips, and two strips cut out a window), `cell_windows` (windows of the cells of an array), `extent` (the extent
of all rays of an aim, from plane to plane), `deflections` (the deviation of rays by elements that are not
affine). `vcc.plan.rays.aim` finds the smallest window with them.
"""

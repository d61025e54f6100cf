"""What bounds the rays that a pixel asks for, so that no ray is traced in vain.

Read in this order: `windows` (what rays are aimed at), `slopes` (a stop, a view or a picture bounds slopes by
strips, and two strips cut out a window), `cell_windows` (windows of the cells of an array), `extent` (all rays
that an aim asks for, from plane to plane), `deflections` (how far elements that are not affine lead rays astray).
`vcc.plan.rays.aim` seeks the smallest window by them.
"""

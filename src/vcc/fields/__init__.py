"""Light fields as data: grids, samples, and disparities between views."""

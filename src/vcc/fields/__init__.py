"""Light fields as data: grids, samples, and what views show of depth."""

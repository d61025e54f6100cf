"""The vocabulary of everything else: errors, units, affine maps, parameters in words; imports nothing of ours."""

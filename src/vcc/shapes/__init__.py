"""Functions of position: transmission of masks, scattering of diffusers, surfaces of plates, lattices of cells."""

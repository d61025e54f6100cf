"""Functions of position: what masks let through, how diffusers scatter, what plates add, where cells lie."""

"""The basis of all packages: errors, units, affine maps, parameters as text; imports no other package here."""

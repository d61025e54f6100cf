"""Pictures by footprints: what each sample adds to which pixels, as plain data, and the compiler that makes it."""

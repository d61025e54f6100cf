"""The plan: the effect of a camera on a light field as plain data, and the compiler that makes it."""

"""The plan: what a camera does to a light field as plain data, and the compiler that makes it."""

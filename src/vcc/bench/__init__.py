"""The optical bench: an interactive side view of a camera next to the image it makes, updated together."""

"""Cameras that learn: parameters by name, and plans that follow them."""

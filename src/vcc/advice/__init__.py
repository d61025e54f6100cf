"""Explanations and warnings as text: the choices of a plan, sampling limits, and what limits an image."""

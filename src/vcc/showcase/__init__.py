"""Shared parts of the demo and the gallery: a built-in scene, a bench, figures and pages."""

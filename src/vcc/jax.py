"""Cameras as differentiable functions for JAX; needs the extra ``jax``."""

from vcc.base import checks

with checks.package("vcc.jax", "jax", "jax"):
    import jax as _jax  # noqa: F401

from vcc.learn.jax_function import CameraFunction as CameraFunction

__all__ = ["CameraFunction"]

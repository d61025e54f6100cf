"""Cameras in TOML: the public face of `vcc.files.camera_file`."""

from vcc.files.camera_file import (
    ELEMENT_KINDS,
    KERNEL_NAMES,
    PATTERN_NAMES,
    SURFACE_NAMES,
    load_camera,
    save_camera,
)

__all__ = ["ELEMENT_KINDS", "KERNEL_NAMES", "PATTERN_NAMES", "SURFACE_NAMES", "load_camera", "save_camera"]

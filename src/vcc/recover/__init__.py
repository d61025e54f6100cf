"""Reconstruct images, views and depth from recordings and light fields.

Refocusing, view interpolation, focal stacks, deblurring, decoding of plenoptic and mask-modulated recordings,
depth.
"""

from __future__ import annotations

from vcc.recover.blur import blurred
from vcc.recover.deblur import Deblurred, richardson_lucy, sparse_gradients, wiener
from vcc.recover.decoding import Decoder
from vcc.recover.defocus_depth import DefocusDepth, defocus_kernels, depth_from_defocus
from vcc.recover.depth import DepthMap, depth_by_plane_sweep, depth_by_structure_tensor, disparity_error
from vcc.recover.focal_stack import AllInFocus, FocalStack, focal_stack, focus_distances
from vcc.recover.heterodyne import HeterodyneGeometry, decode_heterodyne, heterodyne_calibration
from vcc.recover.heterodyne_band import band_limited, true_views
from vcc.recover.lenslet_grid import LensletGrid
from vcc.recover.lenslet_optics import without_aberration
from vcc.recover.photodiodes import PhotodiodeDepth, PhotodiodeDisparity, depth_by_photodiodes
from vcc.recover.plenoptic import decode_plenoptic
from vcc.recover.refocus import ideal_camera, novel_view, refocused
from vcc.recover.stereo import BiprismStereo, StereoDepth, depth_by_biprism
from vcc.recover.white_image import find_lenslets

__all__ = [
    "AllInFocus",
    "BiprismStereo",
    "Deblurred",
    "Decoder",
    "DefocusDepth",
    "DepthMap",
    "FocalStack",
    "HeterodyneGeometry",
    "LensletGrid",
    "PhotodiodeDepth",
    "PhotodiodeDisparity",
    "StereoDepth",
    "band_limited",
    "blurred",
    "decode_heterodyne",
    "decode_plenoptic",
    "defocus_kernels",
    "depth_by_biprism",
    "depth_by_photodiodes",
    "depth_by_plane_sweep",
    "depth_by_structure_tensor",
    "depth_from_defocus",
    "disparity_error",
    "find_lenslets",
    "focal_stack",
    "focus_distances",
    "heterodyne_calibration",
    "ideal_camera",
    "novel_view",
    "refocused",
    "richardson_lucy",
    "sparse_gradients",
    "true_views",
    "wiener",
    "without_aberration",
]

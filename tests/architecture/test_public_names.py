"""What README and docs have told users to import stays importable, wherever it stands."""

from __future__ import annotations

import importlib

import pytest

NAMES = {
    "vcc.affine": "Affine",
    "vcc.analysis": "Refocuser expected_deblurring_error fft4 ifft4 mask_spectrum mtf otf psf sampling_advice",
    "vcc.camera_file": "ELEMENT_KINDS GLASS_NAMES KERNEL_NAMES PATTERN_NAMES SURFACE_NAMES load_camera "
    "save_camera",
    "vcc.demo": "run_demo",
    "vcc.demo.scene": "demo_scene",
    "vcc.errors": "CacheWarning InputError ResultWarning",
    "vcc.formats": "lftoolbox open_light_field open_sparse_views read_ground_truth",
    "vcc.formats.pictures": "read_picture",
    "vcc.formats.writing": "save_light_field",
    "vcc.glasses": "Abbe Catalogue Cauchy Sellmeier Table",
    "vcc.gallery": "ENTRIES entries entry write_entry",
    "vcc.jax": "CameraFunction",
    "vcc.kernels": "Gaussian Radial Samples TopHat",
    "vcc.motion": "Function LightFieldVideo Lines MovingCamera Steps coded",
    "vcc.operators": "masked projected resampled scattered",
    "vcc.patterns": "Bounded Cells Circle CosineSum Polygon mura",
    "vcc.plot": "phase_space_stages plot_camera plot_phase_space_stages",
    "vcc.prescriptions": "Prescription Surface built_in_lenses load_lens qcon read_prescription",
    "vcc.recording": "Recording expose_image photon_transfer PhotonTransfer",
    "vcc.recover": "blurred decode_plenoptic focal_stack novel_view refocused wiener without_aberration",
    "vcc.recover.defocus_depth": "defocus_kernels depth_from_defocus",
    "vcc.recover.depth": "depth_by_plane_sweep depth_by_structure_tensor disparity_error disparity_maps",
    "vcc.recover.heterodyne": "HeterodyneGeometry decode_heterodyne heterodyne_calibration",
    "vcc.recover.plenoptic": "LensletGrid decode_plenoptic find_lenslets",
    "vcc.recover.photodiodes": "PhotodiodeDepth PhotodiodeDisparity depth_by_photodiodes",
    "vcc.recover.stereo": "BiprismStereo depth_by_biprism",
    "vcc.sources": "CameraArray DepthMapScene Lighting PlanesScene TexturedPlane Viewpoint blender_script",
    "vcc.sources.mitsuba": "MitsubaRenderer demo_scene",
    "vcc.sources.synthesis": "synthesize",
    "vcc.sources.textures": "Picture Waves",
    "vcc.store": "create_store open_store save_store",
    "vcc.sweeps": "DeblurringError PSNR contact_sheet grid listed open_sweep random save_sweep sharpness sobol",
    "vcc.surfaces": "Axicon Cubic HeightMap PathMap Quadratic Rough Tilt Zernike",
    "vcc.torch": "CameraModule binary expose levels raw_of sigmoid_mask total_light",
    "vcc.units": "cm deg m mm mrad ms nm rad s um us",
    "vcc.zoo": "TASKS Decoder Recorded Report Scene Task run scene",
}


@pytest.mark.parametrize("module", NAMES)
def test_names_that_users_import_stay(module):
    found = importlib.import_module(module)
    assert [name for name in NAMES[module].split() if not hasattr(found, name)] == []

"""Views kept as pictures: a picture of another size or type is refused before there is memory for it."""

from __future__ import annotations

import imagecodecs
import numpy as np
import pytest

from vcc.store.picture_codec import PictureCodec


@pytest.mark.parametrize("codec", ["jpegxl", "avif"])
def test_a_picture_of_another_size_or_type(codec: str) -> None:
    view = np.random.default_rng(1).integers(0, 256, (16, 24, 3), dtype=np.uint8)
    encode = imagecodecs.jpegxl_encode if codec == "jpegxl" else imagecodecs.avif_encode
    stored = PictureCodec(codec, 90)
    data = encode(view)
    assert stored._decoded(data, np.empty(view.shape, np.uint8)).shape == view.shape
    for shape, kind in (((16, 25, 3), np.uint8), ((16, 24), np.uint8), ((16, 24, 3), np.uint16)):
        with pytest.raises(Exception, match=r"shape|dtype|invalid"):
            stored._decoded(data, np.empty(shape, kind))

from __future__ import annotations

import numpy as np
import pytest

from vcc.base.errors import InputError
from vcc.files import transfer


def test_values_of_the_standard() -> None:
    # IEC 61966-2-1: mid grey 0.5 is 0.2140 in linear light; the straight part has a slope of 12.92.
    np.testing.assert_allclose(transfer.to_linear([0, 0.04045, 0.5, 1]), [0, 0.0031308, 0.2140411, 1], atol=2e-7)
    np.testing.assert_allclose(transfer.from_linear([0, 0.001, 0.2140411, 1]), [0, 0.01292, 0.5, 1], atol=1e-6)


@pytest.mark.parametrize("bits", [8, 16])
def test_every_code_survives_decoding_and_encoding(bits: int) -> None:
    codes = np.arange(2**bits).astype(f"uint{bits}")
    linear = transfer.decode(codes)
    assert linear.dtype == np.float32
    np.testing.assert_array_equal(linear, transfer.to_linear(codes / (2**bits - 1)))
    back = transfer.encode(linear, bits)
    assert back.dtype == codes.dtype
    np.testing.assert_array_equal(back, codes)


def test_encoding_clips_what_is_beyond() -> None:
    np.testing.assert_array_equal(transfer.encode(np.array([-1.0, 2.0]), 8), [0, 255])


def test_floating_point_is_linear_already() -> None:
    samples = np.array([[0.25, 3.0]], np.float64)
    np.testing.assert_array_equal(transfer.decode(samples), samples)


def test_decoding_into_a_given_array() -> None:
    out = np.zeros((2, 2), np.float32)
    assert transfer.decode(np.full((2, 2), 255, np.uint8), out) is out
    assert (out == 1).all()


def test_unknown_samples_are_refused() -> None:
    with pytest.raises(InputError, match="int64"):
        transfer.decode(np.array([1]))
    with pytest.raises(InputError, match="not 12"):
        transfer.encode(np.zeros(1), 12)
    with pytest.raises(InputError, match="not 12"):
        transfer.table(12)

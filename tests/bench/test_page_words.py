"""Messages of the library as the page shows them."""

import pytest

from tests.bench.on_bench import Client
from vcc.bench.page_words import page_words


@pytest.mark.parametrize(
    ("words", "shown"),
    [
        ("give it in metres, such as 550 * nm", "give it, such as 550 nm"),
        ("such as [610 * nm, 540 * nm]", "such as 610 nm, 540 nm"),
        ("give its width in metres, e.g. width=30 * mm", "give its width, e.g. width = 30 mm"),
        (
            'focal_length is "far": a length, written as text, like "50 um"',
            'focal length is "far": a length, like 50 µm',
        ),
        ('the file "my_mask.npy" of 5*5 cells', 'the file "my_mask.npy" of 5*5 cells'),
        ('sum over [0, 1], "2 kinds" of photo_diodes', 'sum over [0, 1], "2 kinds" of photo diodes'),
    ],
)
def test_messages_have_the_names_and_quantities_of_the_page(words, shown):
    assert page_words(words) == shown
    assert page_words(shown) == shown


def test_refusals_come_in_the_language_of_the_page():
    client = Client()
    client.do("set", where=["elements", 0, "design_wavelength"], value="5 mm")
    words = client.until("refused")[0]["words"]
    assert "design wavelength" in words
    assert words.endswith("give the wavelength of light, 100 nm to 50 µm, such as 550 nm")
    client.do("add", kind="lens", z=None)
    client.do("set", where=["elements", 2, "glass"], value={"name": "sellmeier"})
    client.do("set", where=["elements", 2, "glass", "C"], value=3)
    assert client.until("refused")[0]["done"]  # the light field has got wavelengths
    assert client.until("refused")[0]["words"].endswith("C is 3: it is a list, like 1 µm2, 1 µm2")
    client.close()

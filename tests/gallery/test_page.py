"""Pages of entries as Markdown: what is said, what is escaped, and that pictures are the ones given."""

from __future__ import annotations

import re

import markdown
import numpy as np
import pytest
from matplotlib.figure import Figure
from scipy.ndimage import gaussian_filter

import vcc
from vcc.files.pictures import read_picture
from vcc.gallery import Entry, Finding, Picture, Result, write_entry_markdown

RAMP = np.broadcast_to(np.linspace(0, 1, 96, dtype=np.float32)[None, :, None], (64, 96, 3))
NOISE = np.random.default_rng(1).random((64, 96, 3), np.float32)
NUMBERS = (
    Finding("gain |a*b*| <of it>", "5 dB or more", 4.72, "dB", False, "little to\n gain"),
    Finding("con_tra_st", "", 0.123456),
)
RESULT = Result(
    "<p>How it is <b>done</b>.</p>",
    (
        (Picture("ramp", "A [ramp]", "From <i>left</i> to right.", RAMP), Picture("noise", "Noise", "", NOISE)),
        (Picture("figure", "Figure", "", Figure(figsize=(2, 1))),),
    ),
    NUMBERS,
    "Views are assumed 1 mm apart",
)
ENTRY = Entry(
    "some", "Some camera", "Someone & others, *A title*, 1999", "It sees.", lambda bench, progress: RESULT
)


def test_the_page_holds_all_that_the_run_said(tmp_path):
    page = write_entry_markdown(ENTRY, RESULT, tmp_path / "new", note="Made by hand.")
    assert page == tmp_path / "new" / "some.md"
    text = page.read_text(encoding="utf-8")
    assert text.startswith("# Some camera\n")
    # A converter of Markdown that is not ours says what a reader sees.
    html = markdown.markdown(text, extensions=["tables", "md_in_html"])
    rows = [re.findall(r"<td>(.*?)</td>", row, re.S) for row in re.findall(r"<tr>(.*?)</tr>", html, re.S)[1:]]
    assert rows == [
        ["gain |a*b*| &lt;of it&gt;", "5 dB or more", "4.72 dB", "not reached", "little to gain"],
        ["con_tra_st", "–", "0.123", "–", ""],
    ]
    assert "<em>Someone &amp; others, *A title*, 1999</em>" in html
    for words in ("It sees.", "Views are assumed 1 mm apart.", "<p>How it is <b>done</b>.</p>", "Made by hand."):
        assert words in html
    assert "<b>A [ramp].</b> From <i>left</i> to right." in html
    assert re.findall(r'<img alt="(.*?)" src="(.*?)"', html) == [
        ("A [ramp]", "some/ramp.png"),
        ("Noise", "some/noise.jpg"),
        ("Figure", "some/figure.png"),
    ]


def test_pictures_are_those_given(tmp_path):
    write_entry_markdown(ENTRY, RESULT, tmp_path)
    ramp = read_picture(tmp_path / "some" / "ramp.png")[0] / 255
    np.testing.assert_allclose(ramp, RAMP, atol=0.5 / 255 + 1e-6)  # half a step of 8 bits
    noise = read_picture(tmp_path / "some" / "noise.jpg")[0] / 255
    # Quality 88 multiplies the standard's tables by 0.24: steps are at most 0.24·121 = 29 of 255 in brightness and
    # 0.24·99 = 24 in colour. Rounding errs by step/√12 rms, 8.4 and 6.9, and the cosine transform keeps that.
    # From Y, Cb and Cr to the mean of R, G and B variances count 1 and (1.402² + 0.344² + 0.714² + 1.772²)/3.
    assert np.sqrt(np.mean((noise - NOISE) ** 2)) < np.sqrt(8.4**2 + 1.91 * 6.9**2) / 255


def test_figures_of_lines_stay_sharp_and_figures_of_photographs_small(tmp_path):
    lines, photograph = Figure(figsize=(3, 3)), Figure(figsize=(3, 3))
    lines.subplots().plot([0, 1, 0.5])
    grains = gaussian_filter(np.random.default_rng(1).random((300, 300, 3)), (2, 2, 0))
    photograph.figimage((grains - grains.min()) / np.ptp(grains))
    result = Result("", ((Picture("lines", "", "", lines), Picture("photograph", "", "", photograph)),), ())
    write_entry_markdown(ENTRY, result, tmp_path)
    assert sorted(path.name for path in (tmp_path / "some").iterdir()) == ["lines.png", "photograph.jpg"]


def test_pictures_may_stand_elsewhere(tmp_path):
    page = write_entry_markdown(ENTRY, RESULT, tmp_path / "pages", pictures=tmp_path / "images" / "some")
    assert "](../images/some/ramp.png)" in page.read_text(encoding="utf-8")
    assert (tmp_path / "images" / "some" / "ramp.png").exists()


def test_a_folder_that_is_a_file_is_refused(tmp_path):
    (tmp_path / "file").write_text("")
    with pytest.raises(vcc.InputError, match="the gallery cannot write to"):
        write_entry_markdown(ENTRY, RESULT, tmp_path / "file")

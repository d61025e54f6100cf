"""The example that learns a phase plate: what it expects, and that it learns."""

import math
import runpy
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import torch

from vcc.gallery.extended_depth import NOISE, Sizes

ROOT = Path(__file__).parents[2]


@pytest.fixture(scope="module")
def example():
    return runpy.run_path(str(ROOT / "examples" / "learn_phase_plate.py"))


def test_what_is_expected_of_one_sharp_picture_is_wieners_error(example):
    """Of a picture as sharp as the true one, S·N/(S + N) is left of each frequency: no filter can do better."""
    sharp = torch.zeros(16, 16)
    sharp[3, 5] = 1.0
    frequencies = np.fft.fftfreq(16)
    squared = frequencies[:, None] ** 2 + frequencies**2
    power = example["CONTRAST"] ** 2 / squared[squared > 0]
    left = (power * NOISE**2 / (power + NOISE**2)).sum() / 256
    (found,) = example["expected_decibels"](sharp[None], sharp)
    assert float(found) == pytest.approx(-10 * math.log10(left), abs=1e-5)


def test_pictures_that_differ_cost_what_one_filter_cannot_undo(example):
    """Of two places of the same point the mean of their spectra is what a filter gets hold of."""
    sharp = torch.zeros(16, 16, dtype=torch.float64)
    sharp[8, 8] = 1.0
    moved = torch.stack([sharp.roll(1, 1), sharp.roll(-1, 1)])
    frequencies = np.fft.fftfreq(16)
    squared = frequencies[:, None] ** 2 + frequencies**2
    squared[0, 0] = np.inf
    power, alike = example["CONTRAST"] ** 2 / squared, np.cos(2 * np.pi * frequencies) ** 2
    left = (power * (1 - power * alike / (power + NOISE**2))).sum() / 256
    both = example["expected_decibels"](moved, sharp)
    assert both.tolist() == pytest.approx([-10 * math.log10(left)] * 2, abs=1e-9)


def test_the_worst_depth_counts_most(example):
    decibels = torch.tensor([20.0, 24.0, 30.0], dtype=torch.float64, requires_grad=True)
    example["worst"](decibels).backward()
    shares = np.exp(-example["WORST"] * np.array([20.0, 24.0, 30.0]))
    assert decibels.grad.tolist() == pytest.approx((shares / shares.sum()).tolist())


def test_a_plate_is_learned_from_next_to_none(example):
    """Light moves by a fifth of a pixel at most, first; in eight steps it gains 1.5 dB at worst, and more."""
    effort = replace(example["QUICK"], measured=Sizes(depths=3, target=64), frame=20, rays=128, steps=8)
    pair = example["gallery_pair"](effort.measured)
    start = example["next_to_none"](effort.points, 1)
    places = np.linspace(-4.9e-3, 4.9e-3, 40)
    moved = np.abs(start.slopes(places[None], places[:, None])) / pair.comparison.slope
    assert moved.max() < 0.2
    learned = example["learned"](pair.comparison, pair.plain, start, "paths", effort)
    assert min(learned.curve[-1]) > min(learned.curve[0]) + 1.5

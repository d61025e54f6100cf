"""Data sets for training: many recordings with their ground truth, and a card that says how they were made.

::

    pairs = vcc.dataset.make_dataset("pairs", camera, scenes, count=10_000, crop=(256, 256))
    loader = torch.utils.data.DataLoader(pairs, batch_size=8, shuffle=True, num_workers=2)
"""

from __future__ import annotations

from vcc.dataset.loading import Pairs, open_dataset
from vcc.dataset.making import make_dataset

__all__ = ["Pairs", "make_dataset", "open_dataset"]

"""Bombs: small files that claim or unfold into much, or hold what nobody expects. Each is opened once."""

from tests.fuzz.bombs import hdf5, lists, pictures, places, poses, splats, stores, texts

BOMBS = pictures.BOMBS | hdf5.BOMBS | stores.BOMBS | lists.BOMBS | texts.BOMBS | places.BOMBS | splats.BOMBS
BOMBS |= poses.BOMBS

"""Small scenes for tests of the zoo."""

import contextlib

import pytest

from vcc.zoo import scenes


@contextlib.contextmanager
def few_views():
    """Scenes of 9×9 views, and what else is to be patched: the same is kept, in an eighth of the time."""
    with pytest.MonkeyPatch.context() as patched:
        patched.setattr(scenes, "VIEWS", 9)
        scenes.scene.cache_clear()
        yield patched
    scenes.scene.cache_clear()

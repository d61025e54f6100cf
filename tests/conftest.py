"""Settings shared by all tests."""

from hypothesis import settings

# The same examples on every run, and no time limit for any of them: these machines can be slow.
settings.register_profile("repeatable", derandomize=True, deadline=None)
settings.load_profile("repeatable")

"""Tests of `vcc`; what several share is imported from here by its full name."""

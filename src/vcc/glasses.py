"""Glasses, as users import them: the refractive index as a function of the wavelength.

An element accepts one of these as ``glass``, or the name of a catalogue glass such as ``"N-BK7"``. Wavelengths are
in metres.
"""

from vcc.optics.glass import Abbe, Catalogue, Cauchy, Glass, Sellmeier, Table

__all__ = ["Abbe", "Catalogue", "Cauchy", "Glass", "Sellmeier", "Table"]

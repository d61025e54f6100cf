"""Which version this is; files that are written say it."""

VERSION = "0.1.0"

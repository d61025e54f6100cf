"""The version of this package, which is recorded in files."""

VERSION = "0.1.0"

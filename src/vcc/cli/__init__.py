"""The command line, ``vcc``: one module per command, loaded on demand."""

from vcc.cli.app import main

__all__ = ["main"]

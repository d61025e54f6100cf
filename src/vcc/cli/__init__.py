"""The command line, ``vcc``: one command a file, loaded when it is asked for."""

from vcc.cli.app import main

__all__ = ["main"]

"""The command line, ``vcc``. Each command imports what it needs when it runs."""

from __future__ import annotations

__all__ = ["main"]


def main() -> None:
    """Run the command line with the arguments of this process, and end it with an exit code.

    0: done. 1: a fault in the program, with a traceback, or interrupted. 2: unusable input, with a
    message on standard error.
    """
    from vcc.cli.commands import app

    app(prog_name="vcc")

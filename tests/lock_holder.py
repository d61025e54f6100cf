"""A program that holds the lock of what it is told, for tests of what others are told meanwhile."""

LOCKS = """
import sys
from pathlib import Path
from vcc.files.writer_lock import WriterLock
lock = WriterLock(Path(sys.argv[1]))
print("held", flush=True)
sys.stdin.read()
"""

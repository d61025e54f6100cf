"""``python -m vcc`` is ``vcc``."""

from vcc.cli import main

if __name__ == "__main__":
    main()

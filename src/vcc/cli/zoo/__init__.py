"""``vcc zoo``: computational cameras compared by common rules."""

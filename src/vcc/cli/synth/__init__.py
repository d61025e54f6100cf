"""``vcc synth``: light fields rendered from scenes, one command per renderer."""

"""``vcc synth``: light fields made of scenes, each renderer a command of its own."""

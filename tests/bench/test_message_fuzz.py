"""Five thousand messages that no front end sends: each is done or refused in words; the state stays consistent."""

import json
import random
import warnings

import numpy as np
import pytest

import vcc
from tests.bench.hostile import messages
from tests.bench.on_bench import START, offered
from vcc.bench import imaging
from vcc.bench.inbox import CHANGES, Broken, Inbox
from vcc.bench.picture import take
from vcc.bench.session import Session, Superseded
from vcc.bench.sweep import MOST_FRAMES

COUNT = 5000


class Straight:
    """A session whose messages are handled at once, in this thread.

    Images are not made: `tests/bench/test_hostile.py` makes some. One stands for all of them.
    """

    def __init__(self, monkeypatch):
        self.told = []
        there = offered()
        made = take(START.train(there.beside).train, there.fields["noise"], START)
        monkeypatch.setattr(imaging, "take", lambda *given: made)
        monkeypatch.setattr(imaging.Imaging, "notes", lambda *given: [])
        self.session = Session(there, lambda message, buffers: self.told.append((message, buffers)))
        self.handle({"do": "hello"})

    def handle(self, message):
        """What is told of a message."""
        self.told.clear()
        self.session._answer(message, [b"junk"] if message["do"] == "upload" else [])
        if self.session._wanted is not None:
            try:
                self.session._make_picture()
            except Superseded:
                self.session._wanted = None
        return [message for message, _ in self.told]


@pytest.mark.parametrize("seed", [1])
def test_each_is_done_or_refused_in_words(monkeypatch, seed):
    straight = Straight(monkeypatch)
    given = messages(random.Random(seed))
    done, refused = set(), set()
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        warnings.simplefilter("ignore", vcc.ResultWarning)
        for _ in range(COUNT):
            message = next(given)
            if message["do"] in ("ask", "export") and message.get("frames", 0) not in range(MOST_FRAMES):
                continue  # what is computed takes long: tests/bench/test_hostile.py
            if message["do"] in ("ask", "export", "focus") and message.get("what") not in ("profile", "toml"):
                message["what"] = "profile"
            told = straight.handle(message)
            assert told or message["do"] == "look", message
            assert all(each["is"] != "failed" for each in told)
            (refused if any(each["is"] == "refused" for each in told) else done).add(message["do"])
            for each in told:
                if each["is"] == "refused":
                    assert 10 <= len(each["words"]) <= 1500, each
                    assert "/tmp" not in each["words"], each  # no file of ours
            document = straight.session.document
            if message["do"] in CHANGES:  # what is told last is what is so
                states = [each for each in told if each["is"] == "state" and each["document"] is not None]
                json.dumps(states, allow_nan=False)
                assert not states or states[-1]["document"] == document.as_json()
    assert set(CHANGES) - {"focus", "upload", "return"} <= done | refused
    assert {"set", "undo", "redo", "add", "pin", "compare", "unpin"} <= done
    assert {"set", "load", "add", "remove", "unpin", "compare", "return", "upload", "look", "value"} <= refused


def test_bytes_and_numbers_that_no_front_end_sends_end_the_client_and_nothing_else():
    chance, inbox = np.random.default_rng(2), Inbox()
    junk = [None, [], 5, "set", {}, {"do": None}, {"do": "jump"}, {"do": ["set"]}, {"do": "set", "turn": 1.5}]
    for _ in range(1000):
        message = junk[chance.integers(len(junk))]
        with pytest.raises(Broken):
            inbox.put(message, [])
    for _ in range(3):
        inbox.put({"do": "upload"}, [bytes(2**24)])
    with pytest.raises(Broken, match="MiB wait"):
        inbox.put({"do": "upload"}, [bytes(2**24 + 1)])

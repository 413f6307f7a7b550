"""``katana450 arm log``: the exchanges with an arm in words."""

from __future__ import annotations

import time
from argparse import Namespace
from pathlib import Path

import msgspec

from katana450.assembly.log_output import printable
from katana450.errors import InputError
from katana450.extensions.real_arm import link
from katana450.extensions.real_arm.codec.codecs import (
    FirmwareCodec,
    HostCodec,
    OutOfStep,
    ReplyReceived,
    RequestReceived,
    RequestRefused,
)
from katana450.extensions.real_arm.codec.replies import FirmwareError, WireMessage


class ExchangeDecoder:
    """Finds requests and replies in the lines of one log."""

    def __init__(self) -> None:
        self._firmware, self._host = FirmwareCodec(), HostCodec()
        self._sent_at = 0.0

    def words(self, line: str) -> list[str]:
        """Return a line of text for each message that ``line`` completes."""
        parts = line.split(maxsplit=2)
        try:
            t, mark = float(parts[0]), parts[1]
            data = bytes.fromhex(parts[2]) if len(parts) > 2 else b""
        except (IndexError, ValueError):
            return [f"This is not a line of a log: {printable(line.strip())}"]
        shown = time.strftime("%H:%M:%S", time.localtime(t)) + f"{t % 1.0:.3f}"[1:]
        match mark:
            case link.CONNECTED:
                self._firmware, self._host = FirmwareCodec(), HostCodec()
                texts = ["connected"]
            case link.SENT:
                self._sent_at = t
                texts = self._requests(data)
            case link.RECEIVED:
                texts = self._replies(data, t - self._sent_at)
            case _:
                texts = [f"unknown mark {mark}"]
        return [f"{shown} {printable(text)}" for text in texts]

    def _requests(self, data: bytes) -> list[str]:
        texts = []
        for event in self._firmware.receive(data):
            if isinstance(event, RequestReceived):
                self._host = HostCodec()
                self._host.send(event.request)
                texts.append(f"> {message_words(event.request)}")
            else:
                texts.append(f"> invalid request {data.hex(' ')}")
        return texts

    def _replies(self, data: bytes, took: float) -> list[str]:
        if not data:
            return [f"< nothing for {took:.3f} s"]
        texts = []
        for event in self._host.receive(data):
            match event:
                case ReplyReceived(reply=FirmwareError() as error):
                    words = error.sentence
                case ReplyReceived(reply=reply):
                    words = message_words(reply)
                case RequestRefused():
                    words = "refused"
                case OutOfStep(problem=problem):
                    words = problem
            texts.append(f"< {words}  [{1e3 * took:.1f} ms]")
        return texts


def message_words(message: WireMessage) -> str:
    """Return the class of a message and its fields."""
    values = msgspec.structs.asdict(message).items()
    shown = ", ".join(f"{name} {_shown(value)}" for name, value in values)
    return f"{type(message).__name__} {shown}".rstrip()


def _shown(value: object) -> str:
    if isinstance(value, bytes):
        return value.decode("ascii", "replace").strip() if value.isascii() else value.hex(" ")
    if isinstance(value, tuple):
        return " ".join(map(_shown, value)) if not hasattr(value, "_fields") else str(tuple(value))
    return str(value)


def show_log(options: Namespace) -> int:
    """Run ``katana450 arm log`` and return the exit status. Raises InputError."""
    path: Path = options.file
    decoder = ExchangeDecoder()
    try:
        with path.open(encoding="ascii", errors="replace") as file:
            for line in file:
                for words in decoder.words(line):
                    print(words)
    except OSError as error:
        raise InputError(f"{path} cannot be read: {error.strerror}.") from error
    return 0

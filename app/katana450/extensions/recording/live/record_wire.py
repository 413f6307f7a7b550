"""Serialization of tick records for the pipe, in which unchanged values are sent once.

Most parts of a state are the same Python objects as in the state before: the scene, the plan, the
goal, the settings. Both ends remember what was sent, so such a part goes as a reference, and
remains one object at the other end too.
"""

from __future__ import annotations

import io
import pickle
from typing import NamedTuple

from katana450.arm.runtime.tick import TickRecord

MAX_REMEMBERED = 500
"""Number of records after which both ends forget what was sent. It bounds their memory."""

BEGIN, CONTINUATION = b"\x01", b"\x02"
"""First byte of a message: whether it refers to nothing, or to messages before it."""


class LostTicks(NamedTuple):
    """A number of ticks that were lost, until the time ``until`` [s]."""

    ticks: int
    until: float


Sent = list[TickRecord] | LostTicks


class RecordSerializer:
    """Serializer at the end of the arm."""

    def __init__(self) -> None:
        self._file = io.BytesIO()
        self._pickler = pickle.Pickler(self._file, pickle.HIGHEST_PROTOCOL)
        self._remembered = 0

    def dumped(self, records: Sent) -> bytes:
        """Return ``records`` as bytes, for the next message."""
        first = self._remembered == 0
        if first:
            self._pickler.clear_memo()
        self._remembered += 1 if isinstance(records, LostTicks) else len(records)
        if self._remembered >= MAX_REMEMBERED:
            self._remembered = 0
        self._file.seek(0)
        self._file.truncate()
        self._file.write(BEGIN if first else CONTINUATION)
        self._pickler.dump(records)
        return self._file.getvalue()


class RecordDeserializer:
    """Deserializer at the other end. Every message must be loaded, in the order of dumping."""

    def __init__(self) -> None:
        self._file = io.BytesIO()
        self._unpickler = pickle.Unpickler(self._file)

    def loaded(self, data: bytes) -> Sent:
        """Return the records in ``data``, or the number of those that were lost."""
        if data.startswith(BEGIN):
            self._file = io.BytesIO()
            self._unpickler = pickle.Unpickler(self._file)
        self._file.seek(0)
        self._file.truncate()
        self._file.write(data)
        self._file.seek(len(BEGIN))
        records: Sent = self._unpickler.load()
        return records

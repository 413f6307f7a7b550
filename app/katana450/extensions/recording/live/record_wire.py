"""Serialization of tick records for the pipe, in which large unchanged values are sent once.

A plan, and the objects of the scene, are the same Python objects in many records. They are sent at
their first use and then by number, so the other end has one object for each of them too.
"""

from __future__ import annotations

import io
import pickle
from collections import OrderedDict
from typing import Any

from katana450.arm.runtime.tick import TickRecord
from katana450.maths.planning.plan import Plan

MAX_NAMED, MAX_STORED = 8, 32
"""Number of values that the sending end (8) and the receiving end (32) remember. The end that names
values keeps fewer than the end that looks the names up."""


class RecordSerializer:
    """Serializer at the end of the arm."""

    def __init__(self) -> None:
        self._numbers: OrderedDict[int, tuple[int, Any]] = OrderedDict()
        self._count = 0

    def dumped(self, record: TickRecord) -> bytes:
        """Return ``record`` as bytes, for the next message."""
        file = io.BytesIO()
        _Pickler(file, self, record.state.objects).dump(record)
        return file.getvalue()

    def name(self, value: Any) -> tuple[int, bytes | None]:
        """Return the number of ``value``, and its bytes if it is new."""
        found = self._numbers.get(id(value))
        if found is not None:
            self._numbers.move_to_end(id(value))
            return found[0], None
        self._count += 1
        # The value is kept, so that no other one can get its id.
        self._numbers[id(value)] = self._count, value
        while len(self._numbers) > MAX_NAMED:
            self._numbers.popitem(last=False)
        return self._count, pickle.dumps(value, pickle.HIGHEST_PROTOCOL)


class RecordDeserializer:
    """Deserializer at the other end. Every message must be loaded, in the order of dumping."""

    def __init__(self) -> None:
        self._values: OrderedDict[int, Any] = OrderedDict()

    def loaded(self, data: bytes) -> TickRecord:
        """Return the record in ``data``."""
        record: TickRecord = _Unpickler(io.BytesIO(data), self).load()
        return record

    def value(self, number: int, data: bytes | None) -> Any:
        """Return the value of ``number``, whose bytes are ``data`` if it is new."""
        if data is not None:
            self._values[number] = pickle.loads(data)
            while len(self._values) > MAX_STORED:
                self._values.popitem(last=False)
        else:
            self._values.move_to_end(number)
        return self._values[number]


class _Pickler(pickle.Pickler):
    def __init__(self, file: io.BytesIO, names: RecordSerializer, objects: Any) -> None:
        super().__init__(file, pickle.HIGHEST_PROTOCOL)
        self._names = names
        self._objects = objects or None

    def persistent_id(self, value: Any) -> Any:
        if isinstance(value, Plan) or value is self._objects:
            return self._names.name(value)
        return None


class _Unpickler(pickle.Unpickler):
    def __init__(self, file: io.BytesIO, values: RecordDeserializer) -> None:
        super().__init__(file)
        self._values = values

    def persistent_load(self, named: Any) -> Any:
        return self._values.value(*named)

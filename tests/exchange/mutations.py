"""Mutations of files, and the check of what is read from them."""

from __future__ import annotations

import os
import random
import struct
import time

import numpy as np
import pytest

from katana450.errors import InputError
from katana450.extensions.importers.formats.shape_file import (
    MAX_MEMORY_BYTES,
    MAX_SIZE,
    MIN_SIZE,
    SECONDS,
    Format,
    ShapeFile,
    read_shape,
)

MUTATIONS = 1000 if "KATANA450_LONG" in os.environ else 20
"""Number of mutations of each seed."""

NUMBERS = [b"nan", b"-1", b"1e999", b"2147483648", b"4294967295", b"9" * 30, b"[", b"}", b'"', b"0"]


def mutated(data: bytes, chance: random.Random) -> bytes:
    """Return ``data`` with some bytes, pieces or numbers changed, or with its end cut off."""
    changed = bytearray(data)
    for _ in range(chance.randint(1, 4)):
        start = chance.randrange(len(changed))
        piece = slice(start, start + chance.randint(1, 40))
        match chance.randrange(7):
            case 0:
                changed[start] ^= 1 << chance.randrange(8)
            case 1:
                changed[start] = chance.choice((0, 1, 127, 128, 255))
            case 2:
                del changed[start:]
            case 3:
                del changed[piece]
            case 4:
                changed[start:start] = changed[piece] * chance.choice((1, 1, 1000))
            case 5:
                changed[start : start + 4] = struct.pack("<I", chance.choice((0, 2**31, 2**32 - 1)))
            case _:
                changed[start : start + chance.randrange(8)] = b" %s " % chance.choice(NUMBERS)
        if not changed:
            break
    return bytes(changed)


def looked_at(data: bytes, format: Format) -> ShapeFile | None:
    """Return the reading; None if it is refused with a message. Other exceptions fail."""
    try:
        shape = read_shape(data, format, "fuzz.bin", 1e-3)
    except InputError as error:
        said = str(error)
        assert said[0].isalnum()
        assert said[-1] == "."
        assert len(said) < 400
        return None
    assert np.isfinite(shape.vertices).all()
    assert shape.faces.min() >= 0
    assert shape.faces.max() == len(shape.vertices) - 1
    assert shape.colours is None or shape.colours.shape == (len(shape.faces), 4)
    assert MIN_SIZE <= shape.scale * np.ptp(shape.vertices, axis=0).max() <= MAX_SIZE
    return shape


def check_mutations(name: str, data: bytes) -> None:
    """Check that mutations of the file ``name`` are read or refused within time and memory."""
    resource = pytest.importorskip("resource")
    format, chance = Format.of(name), random.Random(name)
    before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    read = 0
    for _ in range(MUTATIONS):
        start = time.process_time()
        read += looked_at(mutated(data, chance), format) is not None
        assert time.process_time() - start < SECONDS
    assert read < MUTATIONS
    assert (resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before) * 1024 < MAX_MEMORY_BYTES

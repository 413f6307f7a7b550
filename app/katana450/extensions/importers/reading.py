"""The subprocess that reads one shape from standard input and writes .npz to standard output.

`read_shape_guarded` starts it as ``python -m katana450.extensions.importers.reading FORMAT NAME
UNIT UP``. It limits its memory and time before it reads its input. Keys of the .npz: vertices,
faces, colours if there are any, unit and text, and corners, off, thickened and volume of the convex
body; or error alone, with a message.
"""

from __future__ import annotations

import io
import sys

import numpy as np

from katana450.errors import InputError
from katana450.extensions.importers.shape_file import (
    MAX_MEMORY_BYTES,
    SECONDS,
    Format,
    Up,
    read_shape,
)
from katana450.maths.collision.convex_body import convex_body
from katana450.platform_support import limit_resources


def main(words: list[str]) -> None:
    """Read one file. The process fails only at the limits of memory and time."""
    bind()
    format, name, unit, up = words
    data = sys.stdin.buffer.read()
    found: dict[str, object] = {}
    try:
        shape = read_shape(
            data,
            Format(format),
            name,
            float(unit) if unit else None,
            Up(up) if up else None,
        )
        body = convex_body(shape.vertices)
    except InputError as error:
        found["error"] = str(error)
    else:
        found = {
            key: getattr(shape, key) for key in ("vertices", "faces", "colours", "unit", "text")
        } | vars(body)
    buffer = io.BytesIO()
    arrays = {key: np.array(value) for key, value in found.items() if value is not None}
    np.savez(buffer, allow_pickle=False, **arrays)
    sys.stdout.buffer.write(buffer.getvalue())


def bind() -> None:
    """Limit the memory and time of this process, as far as the system supports it."""
    limit_resources(MAX_MEMORY_BYTES, round(SECONDS))


if __name__ == "__main__":
    main(sys.argv[1:])

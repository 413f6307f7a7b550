"""The subprocess that reads one shape from standard input and writes .npz to standard output.

`read_shape_guarded` starts it as ``python -m katana450.extensions.importers.reading FORMAT NAME
UNIT UP MAIN``. It limits its memory and time before it reads its input. Keys of the .npz: those of
`ShapeFile`, without colours if there are none, and content in place of file, unless that is the
input itself; corners, off, thickened and volume of the convex body. Or error with a message, and
choices if one of several files must be chosen. Always missing: paths of files that are named and
not there.
"""

from __future__ import annotations

import io
import sys

import numpy as np

from katana450.errors import InputError
from katana450.extensions.convex_body import convex_body
from katana450.extensions.importers.archive import ChoiceError
from katana450.extensions.importers.shape_file import (
    MAX_MEMORY_BYTES,
    SECONDS,
    Format,
    Up,
    read_shape,
)
from katana450.platform_support import limit_resources


def main(arguments: list[str]) -> None:
    """Read one file. The process fails only at the limits of memory and time."""
    bind()
    format, name, unit, up, chosen = arguments
    data = sys.stdin.buffer.read()
    found: dict[str, object] = {}
    missing: list[str] = []
    try:
        shape = read_shape(
            data,
            Format(format),
            name,
            float(unit) if unit else None,
            Up(up) if up else None,
            main=chosen,
            missing=missing,
        )
        body = convex_body(shape.vertices * shape.scale)
    except InputError as error:
        found["error"] = str(error)
        if isinstance(error, ChoiceError):
            found["choices"] = error.choices
    else:
        found = vars(shape) | vars(body) | {"format": shape.format.value}
        found["corners"] = body.corners / shape.scale
        found["off"] = body.off / shape.scale
        found["volume"] = body.volume / shape.scale**3
        del found["file"]
        if shape.file is not data:
            found["content"] = np.frombuffer(shape.file, np.uint8)
    found["missing"] = np.array(missing, dtype=str)
    buffer = io.BytesIO()
    arrays = {key: np.array(value) for key, value in found.items() if value is not None}
    np.savez(buffer, allow_pickle=False, **arrays)
    sys.stdout.buffer.write(buffer.getvalue())


def bind() -> None:
    """Limit the memory and time of this process, as far as the system supports it."""
    limit_resources(MAX_MEMORY_BYTES, round(SECONDS))


if __name__ == "__main__":
    main(sys.argv[1:])

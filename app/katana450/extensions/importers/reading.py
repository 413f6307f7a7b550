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
from dataclasses import replace

import numpy as np

from katana450.errors import KatanaError
from katana450.extensions.convex_body import convex_body
from katana450.extensions.importers.archive import ChoiceError
from katana450.extensions.importers.shape_file import (
    MAX_MEMORY_BYTES,
    SECONDS,
    Format,
    ShapeFile,
    Up,
    read_shape,
)
from katana450.extensions.importers.simplification import coarser
from katana450.extensions.importers.surface import MAX_DRAWN, MeshSurface
from katana450.platform_support import limit_resources


def main(arguments: list[str]) -> None:
    """Read one file. The process fails only at the limits of memory and time."""
    bind()
    format, name, unit, up, chosen = arguments
    found = answer(
        sys.stdin.buffer.read(),
        Format(format),
        name,
        float(unit) if unit else None,
        Up(up) if up else None,
        chosen,
    )
    buffer = io.BytesIO()
    arrays = {key: np.array(value) for key, value in found.items() if value is not None}
    np.savez(buffer, allow_pickle=False, **arrays)
    sys.stdout.buffer.write(buffer.getvalue())


def answer(
    data: bytes, format: Format, name: str, unit: float | None, up: Up | None, main: str
) -> dict[str, object]:
    """Return the content of the .npz for a file; arguments as those of `read_shape`."""
    found: dict[str, object] = {}
    missing: list[str] = []
    try:
        shape = read_shape(data, format, name, unit, up, main=main, missing=missing)
        body = convex_body(shape.vertices * shape.scale)
        shape = drawn(shape)
    except KatanaError as error:
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
    return found


def drawn(shape: ShapeFile) -> ShapeFile:
    """Return the shape with at most MAX_DRAWN triangles, made coarser if it has more."""
    if len(shape.faces) <= MAX_DRAWN:
        return shape
    whole = MeshSurface(shape.vertices, shape.faces, shape.colours)
    surface, moved = coarser(whole, MAX_DRAWN)
    note = (
        f"It is drawn with {len(surface.faces)} triangles, whose corners are up to "
        f"{1e3 * shape.scale * moved:.2g} mm off."
    )
    return replace(
        shape,
        vertices=surface.vertices,
        faces=surface.faces,
        colours=surface.colours,
        text=f"{shape.text} {note}",
    )


def bind() -> None:
    """Limit the memory and time of this process, as far as the system supports it."""
    limit_resources(MAX_MEMORY_BYTES, round(SECONDS))


if __name__ == "__main__":
    main(sys.argv[1:])

"""The subprocess that reads one shape from standard input and writes a ``ShapeReading``.

`read_shape_guarded` starts it as ``python -m katana450.extensions.importers.reading FORMAT NAME
UNIT UP MAIN``. It limits its memory and time before it reads its input.
"""

from __future__ import annotations

import sys

from katana450.disk_cache import encoded
from katana450.errors import KatanaError
from katana450.extensions.convex_body import convex_body
from katana450.extensions.importers.archive import ChoiceError
from katana450.extensions.importers.formats.shape_file import (
    MAX_MEMORY_BYTES,
    SECONDS,
    Format,
    Up,
    read_shape,
)
from katana450.extensions.importers.guarded_reading import ShapeReading
from katana450.platform_support import limit_resources


def main(arguments: list[str]) -> None:
    """Read one file. The process fails only at the limits of memory and time."""
    bind()
    format, name, unit, up, chosen = arguments
    reading = answer(
        sys.stdin.buffer.read(),
        Format(format),
        name,
        float(unit) if unit else None,
        Up(up) if up else None,
        chosen,
    )
    sys.stdout.buffer.write(encoded(reading))


def answer(
    data: bytes, format: Format, name: str, unit: float | None, up: Up | None, main: str
) -> ShapeReading:
    """Return the answer for a file; arguments as those of `read_shape`."""
    missing: list[str] = []
    try:
        shape = read_shape(data, format, name, unit, up, main=main, missing=missing)
        body = convex_body(shape.vertices * shape.scale).scaled(1.0 / shape.scale)
    except KatanaError as error:
        choices = error.choices if isinstance(error, ChoiceError) else ()
        return ShapeReading(error=str(error), choices=choices, missing=tuple(missing))
    return ShapeReading(shape, body, missing=tuple(missing))


def bind() -> None:
    """Limit the memory and time of this process, as far as the system supports it."""
    limit_resources(MAX_MEMORY_BYTES, round(SECONDS))


if __name__ == "__main__":
    main(sys.argv[1:])

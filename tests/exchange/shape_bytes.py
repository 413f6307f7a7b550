"""Small shape files, of which tests replace parts, and archives of files."""

from __future__ import annotations

import io
import zipfile
from collections.abc import Mapping

PLY = """ply
format ascii 1.0
element vertex {vertices}
property float x
property float y
property float z
element face {faces}
property list uchar int vertex_indices
end_header
0 0 0
1 0 0
0 1 0
{rest}"""


def ply(rest: str = "3 0 1 2\n", vertices: object = 3, faces: object = 1) -> bytes:
    return PLY.format(rest=rest, vertices=vertices, faces=faces).encode()


PAINTED = (
    ply()
    .replace(
        b"float z\n",
        b"float z\n"
        + b"".join(b"property uchar %s\n" % part for part in (b"red", b"green", b"blue")),
    )
    .replace(b" 0\n", b" 0 9 9 9\n")
)

OBJ = (
    b"mtllib ../../etc/passwd\no a\nv 0 0 0 1 0 0\nv 1 0 0 \\\n 1 0 0\nv 1 1 0 1 0 0\n"
    b"f -3 -2 -1\nv 0 0 1\nvt 0 0\nvn 0 0 1\nusemtl gold\nf 1/1/1 2//1 3/1 -1 # four\r\nl 1 2\n"
)


def zipped(files: Mapping[str, str | bytes], folder: str = "") -> bytes:
    """Return a .zip as other programs write it, with its files in ``folder``."""
    out = io.BytesIO()
    with zipfile.ZipFile(out, "w", zipfile.ZIP_DEFLATED) as archive:
        for name, content in files.items():
            archive.writestr(folder + name, content)
    return out.getvalue()

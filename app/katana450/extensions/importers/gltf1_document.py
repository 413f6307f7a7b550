"""glTF 1.0 documents, expressed as documents of glTF 2.0.

Source: Khronos Group, The GL Transmission Format, version 1.0 (2015), and KHR_binary_glTF. Version
1.0 names its parts where 2.0 numbers them, has the stride in the accessor, several meshes in a
node, and the colour in the values of a technique.
"""

from __future__ import annotations

import struct
from typing import Any

from katana450.errors import InputError
from katana450.srgb import to_light

KINDS = ("buffers", "bufferViews", "accessors", "meshes", "materials", "nodes", "scenes")
"""Parts of a document that have names in version 1.0."""

BINARY = ("binary_glTF", "KHR_binary_glTF")
"""Names of the buffer that is in a binary file."""

HEADER = struct.Struct("<4sIIII")
"""Header of a binary file: magic, version, length of the file and of its document, and format."""

Part = dict[str, Any]
"""A part of a document as its JSON has it."""


def chunks1(data: bytes, name: str) -> tuple[bytes, bytes]:
    """Return the document and the buffer of a binary file of version 1.0."""
    if len(data) < HEADER.size:
        raise InputError(f"{name} is corrupt: it ends within its header.")
    _, _, _, content, _ = HEADER.unpack_from(data)
    end = HEADER.size + content
    if end > len(data):
        raise InputError(f"{name} is corrupt: it ends within its document.")
    return data[HEADER.size : end], data[end:]


def upgraded(document: Part, name: str) -> Part:
    """Return a document of version 1.0 as one of 2.0, with the parts that are read.

    Raises InputError for parts that are no objects, or that refer to names that are not there.
    """
    try:
        return _Upgrade(document).document()
    except (AttributeError, TypeError, ValueError, IndexError) as error:
        raise InputError(f"{name} is corrupt: a part of it is not as in glTF 1.0.") from error
    except KeyError as error:
        what = str(error)[:60]
        raise InputError(f"{name} is corrupt: it refers to {what}, which is missing.") from error


class _Upgrade:
    """The conversion of one document."""

    def __init__(self, document: Part) -> None:
        self._old = document
        self._named: dict[str, dict[str, Part]] = {}
        for kind in KINDS:
            named = dict(document.get(kind, {}))
            # The buffer of a binary file is the first one.
            self._named[kind] = {key: named[key] for key in sorted(named, key=_is_not_binary)}
        self._numbers = {
            kind: {name: number for number, name in enumerate(named)}
            for kind, named in self._named.items()
        }
        self._meshes = [self._mesh([each]) for each in self._named["meshes"]]

    def document(self) -> Part:
        """Return the new document."""
        old, named = self._old, self._named
        nodes = [self._node(each) for each in named["nodes"].values()]
        scenes = [
            {"nodes": self._all("nodes", each.get("nodes", []))}
            for each in named["scenes"].values()
        ]
        new: Part = {
            "asset": {"version": "2.0"},
            "buffers": [_buffer(key, each) for key, each in named["buffers"].items()],
            "bufferViews": [self._view(each) for each in named["accessors"].values()],
            "accessors": [
                _accessor(number, each) for number, each in enumerate(named["accessors"].values())
            ],
            "meshes": self._meshes,
            "materials": [_material(each) for each in named["materials"].values()],
            "nodes": nodes,
            "scenes": scenes,
            "animations": list(old.get("animations", {})),
            "extensionsRequired": list(old.get("extensionsRequired", [])),
        }
        if "scene" in old:
            new["scene"] = self._numbers["scenes"][old["scene"]]
        return new

    def _all(self, kind: str, names: list[str]) -> list[int]:
        return [self._numbers[kind][each] for each in names]

    def _view(self, accessor: Part) -> Part:
        """Return the view of an accessor: each gets its own, because its stride is there."""
        view = self._named["bufferViews"][accessor["bufferView"]]
        new: Part = {
            "buffer": self._numbers["buffers"][view["buffer"]],
            "byteOffset": view.get("byteOffset", 0),
            "byteLength": view.get("byteLength", 0),
        }
        if accessor.get("byteStride"):
            new["byteStride"] = accessor["byteStride"]
        return new

    def _mesh(self, names: list[str]) -> Part:
        """Return a mesh with the primitives of all ``names``."""
        found: list[Part] = []
        for name in names:
            for old in self._named["meshes"][name].get("primitives", []):
                new: Part = {
                    "attributes": {
                        key: self._numbers["accessors"][value]
                        for key, value in old["attributes"].items()
                    },
                    "mode": old.get("mode", old.get("primitive", 4)),
                }
                if "indices" in old:
                    new["indices"] = self._numbers["accessors"][old["indices"]]
                if "material" in old:
                    new["material"] = self._numbers["materials"][old["material"]]
                found.append(new)
        return {"primitives": found}

    def _node(self, old: Part) -> Part:
        same = ("matrix", "translation", "rotation", "scale")
        new: Part = {key: old[key] for key in same if key in old}
        new["children"] = self._all("nodes", old.get("children", []))
        meshes = list(old.get("meshes", []))
        if "skin" in old:
            new["skin"] = 0
        if len(meshes) == 1:
            new["mesh"] = self._numbers["meshes"][meshes[0]]
        elif meshes:
            new["mesh"] = len(self._meshes)
            self._meshes.append(self._mesh(meshes))
        return new


def _is_not_binary(name: str) -> bool:
    return name not in BINARY


def _buffer(name: str, old: Part) -> Part:
    new: Part = {"byteLength": old.get("byteLength", 0)}
    if name not in BINARY:
        new["uri"] = old["uri"]
    return new


def _accessor(number: int, old: Part) -> Part:
    return {
        "bufferView": number,
        "byteOffset": old.get("byteOffset", 0),
        "componentType": old["componentType"],
        "count": old["count"],
        "type": old["type"],
    }


def _material(old: Part) -> Part:
    """Return the material with the diffuse colour, which is sRGB in version 1.0."""
    common = old.get("extensions", {}).get("KHR_materials_common", {})
    values = old.get("values", {}) | common.get("values", {})
    diffuse = values.get("diffuse", values.get("baseColorFactor"))
    if isinstance(diffuse, str):
        return {"pbrMetallicRoughness": {"baseColorTexture": {}}}
    if not isinstance(diffuse, list) or len(diffuse) != 4:
        return {}
    light = to_light(diffuse[:3]).tolist()
    return {"pbrMetallicRoughness": {"baseColorFactor": [*light, diffuse[3]]}}

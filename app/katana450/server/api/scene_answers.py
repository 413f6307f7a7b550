"""Answers about objects and about nodes of the VRML world."""

from __future__ import annotations

import msgspec

from katana450.server.api.fields import Answer, Numbers


class Value(msgspec.Struct, frozen=True, kw_only=True):
    """Value of a field of a node of the VRML world.

    Attributes:
        node: DEF name of the node.
        field: Name of the field.
        value: One number, or as many as the type of the field has.
    """

    node: str
    field: str
    value: float | Numbers


class SceneObject(msgspec.Struct, frozen=True, kw_only=True):
    """A scene object. See ``place`` for the fields that are not listed here.

    Attributes:
        T: (4, 4) Pose in the base frame.
        held: Whether the fingers hold the object.
        mesh: Key of the mesh; null for another shape.
        colour: Colour such as "#94a3b8"; null for the colour of the file.
        fixed: Whether the object is fixed to the hand.
        overlap: Sentence on the link in which the object stands; "" if it stands in none.
    """

    name: str
    shape: str
    size: Numbers
    T: list[Numbers]
    can_be_held: bool
    held: bool
    mesh: str | None = None
    scale: float = 1.0
    colour: str | None = None
    opacity: float = 1.0
    hidden: bool = False
    fixed: bool = False
    zone: str = "none"
    overlap: str = ""


class Objects(Answer, frozen=True, kw_only=True):
    """All scene objects."""

    objects: list[SceneObject]


class Values(Answer, frozen=True, kw_only=True):
    """Values of the requested fields, in the order of the request."""

    values: list[Value]


class Field(msgspec.Struct, frozen=True, kw_only=True):
    """A field of a node.

    Attributes:
        field: Name of the field.
        type: Name of its type in VRML97.
        value: Present value.
        settable: Whether ``set`` can set the field.
    """

    field: str
    type: str
    value: float | Numbers
    settable: bool


class Node(msgspec.Struct, frozen=True, kw_only=True):
    """A node of the VRML world.

    Attributes:
        node: DEF name of the node.
        kind: Type of the node.
        of: Joint, link or object to which the node belongs.
        fields: Fields of the node.
    """

    node: str
    kind: str
    of: str
    fields: list[Field]


class World(Answer, frozen=True, kw_only=True):
    """All nodes of the VRML world. Lengths in m, angles in rad, z up."""

    nodes: list[Node]


class Mesh(Answer, frozen=True, kw_only=True):
    """An uploaded mesh.

    Attributes:
        key: Key for ``place``.
        name: Name of the file, changed if an object already has it.
        text: Summary of the file's content in words.
        size: Size along x, y, z [m].
        triangles: Number of triangles.
        scale: Scale for ``place`` that gives an allowed size; 1 if its size is allowed already.
    """

    key: str
    name: str
    text: str
    size: Numbers
    triangles: int
    scale: float = 1.0


class Scene(Answer, frozen=True, kw_only=True):
    """An uploaded scene, which can now be loaded.

    Attributes:
        key: Key for ``load``.
        objects: Names of its objects.
        text: Summary of the scene in words.
    """

    key: str
    objects: list[str]
    text: str

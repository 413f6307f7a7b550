"""Answers about objects and about nodes of the VRML world."""

from __future__ import annotations

import msgspec

from katana450.server.api.fields import Answer, Numbers


class Value(msgspec.Struct, frozen=True, kw_only=True):
    """Value of a field of a node of the VRML world: a number, or as many as its type has."""

    node: str
    field: str
    value: float | Numbers


class SceneObject(msgspec.Struct, frozen=True, kw_only=True):
    """An object that stands around or is carried; ``T`` (4, 4) in the base frame. See ``place``.

    ``fixed``: whether it is fixed to the hand. ``colour``: null for the colour of its file.
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


class Objects(Answer, frozen=True, kw_only=True):
    """All objects."""

    objects: list[SceneObject]


class Values(Answer, frozen=True, kw_only=True):
    """Values of the requested fields, in the order of the request."""

    values: list[Value]


class Field(msgspec.Struct, frozen=True, kw_only=True):
    """A field of a node. ``type``: its name in VRML97. ``settable``: whether ``set`` can set it."""

    field: str
    type: str
    value: float | Numbers
    settable: bool


class Node(msgspec.Struct, frozen=True, kw_only=True):
    """A node of the VRML world. ``node``: its DEF name. ``of``: its joint, link or object."""

    node: str
    kind: str
    of: str
    fields: list[Field]


class World(Answer, frozen=True, kw_only=True):
    """All nodes of the VRML world. Lengths in m, angles in rad, z up."""

    nodes: list[Node]


class Link(msgspec.Struct, frozen=True, kw_only=True):
    """Pose of a link: ``T`` (4, 4) in the base frame."""

    name: str
    T: list[Numbers]


class Links(Answer, frozen=True, kw_only=True):
    """All links, the base first."""

    links: list[Link]


class Mesh(Answer, frozen=True, kw_only=True):
    """An uploaded mesh. ``key``: for ``place``. ``name``: the file's, changed if an object has it.

    ``text``: a summary of what was read. ``size``: along x, y, z [m].
    """

    key: str
    name: str
    text: str
    size: Numbers
    triangles: int


class Scene(Answer, frozen=True, kw_only=True):
    """A scene that was uploaded and can now be loaded. ``key``: for ``load``."""

    key: str
    objects: list[str]
    text: str

"""Answers about objects and about nodes of the VRML world."""

from __future__ import annotations

import msgspec

from katana450.server.api.fields import Answer, Numbers


class Value(msgspec.Struct, frozen=True, kw_only=True):
    """What a field of a node of the VRML world is: a number, or as many as its type has."""

    node: str
    field: str
    value: float | Numbers


class Thing(msgspec.Struct, frozen=True, kw_only=True):
    """Something that stands around or is carried; ``T`` (4, 4) in the base frame. See ``place``.
    ``fixed``: to the hand. ``colour``: null for its own."""

    name: str
    form: str
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


class Things(Answer, frozen=True, kw_only=True):
    """All of them."""

    things: list[Thing]


class Values(Answer, frozen=True, kw_only=True):
    """What the fields are that were asked for, in that order."""

    values: list[Value]


class Field(msgspec.Struct, frozen=True, kw_only=True):
    """One of a node's; ``type`` as VRML97 calls it. ``settable``: by ``set``, else only read."""

    field: str
    type: str
    value: float | Numbers
    settable: bool


class Node(msgspec.Struct, frozen=True, kw_only=True):
    """A node of the VRML world by its DEF name, and what it is of: a joint, link or thing."""

    node: str
    kind: str
    of: str
    fields: list[Field]


class World(Answer, frozen=True, kw_only=True):
    """All that can be set and got by name. Lengths in m, angles in rad, z up."""

    nodes: list[Node]


class Link(msgspec.Struct, frozen=True, kw_only=True):
    """Where a link is: ``T`` (4, 4) in the base frame."""

    name: str
    T: list[Numbers]


class Links(Answer, frozen=True, kw_only=True):
    """All of them, the base first."""

    links: list[Link]


class Mesh(Answer, frozen=True, kw_only=True):
    """An uploaded file. ``key``: for ``place``. ``name``: its own, and of no thing there is.
    ``said``: what was read. ``size``: along x, y, z [m]."""

    key: str
    name: str
    said: str
    size: Numbers
    triangles: int


class Scene(Answer, frozen=True, kw_only=True):
    """A scene that was uploaded and can now be loaded. ``key``: for ``load``."""

    key: str
    things: list[str]
    said: str

"""Requests about scene objects, water, and nodes of the VRML world."""

from __future__ import annotations

from typing import Annotated, ClassVar

import msgspec
from msgspec import Meta

from katana450.arm.control.act import MotionRequest, Name, Request, Traits
from katana450.arm.control.checked import Transform
from katana450.arm.control.scene_objects import Shape
from katana450.arm.control.tool_commands import Frame
from katana450.server.api.fields import FieldValue, Key, NodeName


class Place(Request, frozen=True, kw_only=True, eq=False):
    """Create an object, or change one. Fields that are not given keep their values.

    Attributes:
        name: Name of the object.
        T: (4, 4) Pose in ``frame``; the object's own frame is in the middle of its underside. A new
            object without ``T`` is placed where there is room in front of the arm. An object that
            can be held, vessels and the basin are refused where nothing carries them: they stand
            on the table or on another object.
        near: (2,) Point of the table [m] in the base frame. A new object without ``T`` is placed
            there or near it, where there is room beside other objects and the arm in its ready
            posture.
        frame: Frame of ``T``: {S} at the shoulder, or the base frame on the table.
        shape: Shape that is checked for contacts.
        size: Size of the shape [m]: box (x, y, z), cylinder and vessel (radius, height), sphere
            (radius). The size of a mesh is that of its file.
        mesh: Key of the mesh, from the answer to its upload.
        can_be_held: Whether the fingers may touch the object; they hold it between both sides.
        scale: Factor on the size.
        colour: Colour such as "#94a3b8", or "own" for the colour of the file.
        opacity: Opacity, 1 for an opaque object.
        hidden: Whether the object is not drawn. It is checked for contacts nevertheless.
    """

    traits: ClassVar[Traits] = Traits(extension=True)

    name: Name
    T: Transform | None = None
    near: tuple[float, float] | None = None
    frame: Frame = Frame.BASE
    shape: Shape | None = None
    size: Annotated[list[float], Meta(min_length=1, max_length=3)] | None = None
    mesh: Key | None = None
    can_be_held: bool | None = None
    scale: Annotated[float, Meta(ge=1e-3, le=1e3)] | None = None
    colour: Annotated[str, Meta(pattern="^(own|#[0-9a-f]{6})$")] | None = None
    opacity: Annotated[float, Meta(ge=0.05, le=1.0)] | None = None
    hidden: bool | None = None


class Load(Request, frozen=True, kw_only=True):
    """Replace all objects and the water by those of an uploaded scene. The arm does not move.

    Attributes:
        scene: Key of the scene, from the answer to its upload.
    """

    traits: ClassVar[Traits] = Traits(extension=True)

    scene: Key


class FieldName(msgspec.Struct, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """A field of a node of the VRML world.

    Attributes:
        node: DEF name of the node.
        field: Name of the field.
    """

    node: NodeName
    field: NodeName


class FieldSetting(FieldName, frozen=True, kw_only=True):
    """A field of a node of the VRML world, and its new value.

    Attributes:
        node: DEF name of the node.
        field: Name of the field.
        value: New value; null restores the original one.
    """

    value: FieldValue


class Set(MotionRequest, frozen=True, kw_only=True):
    """Set fields of the VRML world by the DEF names of their nodes, as VR Sink does.

    If one field cannot be set, none is. The names are those of `katana450 export vrml`; ``query``
    with ``world`` lists them. A ``rotation`` of a joint does not place the joint: it is a command
    to move there, under the rules of ``joints``.

    Attributes:
        node: DEF name of the node.
        field: Name of the field.
        value: New value. Null restores the original colour, transparency or choice.
        more: Further fields to set at the same time.
    """

    traits: ClassVar[Traits] = Traits()

    node: NodeName
    field: NodeName
    value: FieldValue
    more: tuple[FieldSetting, ...] = ()


class Get(Request, frozen=True, kw_only=True):
    """Read fields of the VRML world by the DEF names of their nodes, as VR Source does.

    Attributes:
        node: DEF name of the node.
        field: Name of the field.
        more: Further fields to read at the same time.
    """

    traits: ClassVar[Traits] = Traits(question=True, answered=True)

    node: NodeName
    field: NodeName
    more: tuple[FieldName, ...] = ()

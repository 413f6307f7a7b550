"""The requests about what there is to be seen: objects, water, and nodes of the VRML world."""

from __future__ import annotations

from typing import Annotated, ClassVar

import msgspec
from msgspec import Meta

from katana450.server.api.fields import (
    COMMAND,
    Attachment,
    FieldValue,
    Frame,
    Key,
    Matrix4,
    Name,
    NodeName,
    Request,
    RequestTraits,
    Shape,
)


class Place(Request, frozen=True, kw_only=True):
    """Put an object somewhere: a new one, or one that is there, of which what is not given stays.

    ``shape`` and ``size`` [m] are what it counts as where contacts are looked for: box (x, y, z),
    cylinder (radius, height) or sphere (radius); of a mesh ``mesh`` is its key, as the upload told
    it, and the size is the file's. Its frame is in the middle of its underside. A new object
    without ``T`` stands in front of the arm where there is room. ``can_be_held``: the fingers may
    touch it, and hold it when both do. Such an object, cup and basin are refused where nothing
    carries them: they stand on the table or on another thing. ``colour``: as "#94a3b8", or "own"
    for that of the file. ``hidden``: it is not drawn, and counts for contacts even so.
    """

    traits: ClassVar[RequestTraits] = COMMAND

    name: Name
    T: Matrix4 | None = None
    frame: Frame = Frame.BASE
    shape: Shape | None = None
    size: Annotated[list[float], Meta(min_length=1, max_length=3)] | None = None
    mesh: Key | None = None
    can_be_held: bool | None = None
    scale: Annotated[float, Meta(ge=1e-3, le=1e3)] | None = None
    colour: Annotated[str, Meta(pattern="^(own|#[0-9a-f]{6})$")] | None = None
    opacity: Annotated[float, Meta(ge=0.05, le=1.0)] | None = None
    hidden: bool | None = None


class Attach(Request, frozen=True, kw_only=True):
    """Fix an object to the hand, as a camera or another tool, or to the world again.

    ``T``: where on the hand, in the frame of the arm's default tool; without it, it stays where it
    is.
    """

    traits: ClassVar[RequestTraits] = COMMAND

    name: Name
    to: Attachment
    T: Matrix4 | None = None


class Load(Request, frozen=True, kw_only=True):
    """Have the objects of a scene that was uploaded, in place of all there are, and its water.

    The arm stays where it is.
    """

    traits: ClassVar[RequestTraits] = COMMAND

    scene: Key


class Remove(Request, frozen=True, kw_only=True):
    """Take an object away."""

    traits: ClassVar[RequestTraits] = COMMAND

    name: Name


class Fill(Request, frozen=True, kw_only=True):
    """Fill the cup with so many ml of water, and wipe up what is elsewhere."""

    traits: ClassVar[RequestTraits] = COMMAND

    ml: Annotated[float, Meta(ge=0.0, le=1000.0)]


class FieldName(msgspec.Struct, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """A field of a node of the VRML world, by its DEF name."""

    node: NodeName
    field: NodeName


class FieldSetting(FieldName, frozen=True, kw_only=True):
    """What such a field is to be; null for how it is made."""

    value: FieldValue


class Set(Request, frozen=True, kw_only=True):
    """Set a field of the VRML world by the DEF name of its node, as VR Sink does; ``more`` at once.

    Either all are set or, where one cannot be, none. The names are those of `katana450 export
    vrml`; ``look`` at ``world`` lists them. A joint is never put anywhere: its ``rotation`` is an
    order to go there, by the rules of ``joints``. ``value`` null: a colour, a transparency or a
    choice as it is made.
    """

    traits: ClassVar[RequestTraits] = COMMAND

    node: NodeName
    field: NodeName
    value: FieldValue
    more: tuple[FieldSetting, ...] = ()


class Get(Request, frozen=True, kw_only=True):
    """Tell what a field of the VRML world is now, as VR Source does, and ``more`` of them."""

    traits: ClassVar[RequestTraits] = RequestTraits(question=True, answered=True)

    node: NodeName
    field: NodeName
    more: tuple[FieldName, ...] = ()

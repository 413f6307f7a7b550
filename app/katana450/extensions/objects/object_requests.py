"""Commands for the requests about scene objects and water."""

from __future__ import annotations

from argparse import Namespace
from dataclasses import replace

import numpy as np

from katana450.arm.control.commands import commands as cmd
from katana450.arm.control.objects.loose_objects import check_carried, check_mounted, is_loose
from katana450.arm.control.objects.pouring import BASIN, CUP, MAX_VESSELS, is_vessel
from katana450.arm.control.state.scene_objects import (
    MAX_OBJECTS,
    Attachment,
    SceneObject,
    Shape,
    Zone,
    named,
)
from katana450.arm.control.state.solid import PLAIN, ObjectAppearance
from katana450.errors import InputError
from katana450.extensions.free_place import free_place
from katana450.extensions.objects.scenes import scenes_of
from katana450.maths.geometry import se3
from katana450.server.api import requests
from katana450.server.service.hub import Hub
from katana450.server.service.participants import Participant
from katana450.server.service.runner import RequestHandler


class ObjectRequests(RequestHandler):
    """Translates requests about scene objects and water into commands.

    Raises InputError or LeaseError with the reason for a refusal.
    """

    request_types = (
        *(requests.Place, requests.Attach, requests.Load, requests.Fill, requests.Remove),
    )

    def __init__(self, hub: Hub, _options: Namespace) -> None:
        self.hub = hub

    def handle(self, _participant: Participant, request: requests.Request) -> cmd.Command:
        """Return the command of ``request``."""
        match request:
            case requests.Place():
                return cmd.PlaceObject(self._object(request))
            case requests.Attach():
                return self._attached(request)
            case requests.Load(scene=key):
                return scenes_of(self.hub).load_command(key, self.hub.present())
            case requests.Fill():
                return request
            case requests.Remove(name=name):
                self._known(name)
                return request
        raise AssertionError(request)

    def _object(self, request: requests.Place) -> SceneObject:
        """Return the requested object at its place; fields that are not given keep their values."""
        arm = self.hub.present()
        known = self._known(request.name)
        if known is None and len(arm.state.objects) >= MAX_OBJECTS:
            raise InputError(f"There are {MAX_OBJECTS} objects already: remove one first.")
        fields = request.T, request.near, request.shape, request.size, request.scale, request.zone
        if (
            known is not None
            and known.joint is not None
            and any(item is not None for item in fields)
        ):
            raise InputError(
                f"{request.name!r} is on a joint: it moves only by it. Change its place, size and "
                "joint in the scene file."
            )
        scene_object = self._shaped(request, known)
        others = [other for other in arm.state.objects if other.name != request.name]
        if is_vessel(scene_object) and sum(map(is_vessel, others)) >= MAX_VESSELS:
            raise InputError(f"There are {MAX_VESSELS} vessels already: remove one first.")
        if request.T is None:
            if known is not None:
                return scene_object
            table = arm.environment.table_height
            T = free_place(scene_object, arm.state.objects, table, near=request.near)
        else:
            T = se3.validated(request.T, f"The pose of {request.name!r}")
            if request.frame is requests.Frame.SHOULDER:
                T = arm.arm.T_base_shoulder @ T
        if scene_object.fixed:
            T = arm.environment.into_hand(T, arm.state.x)
        placed = replace(scene_object, T=T)
        if is_loose(placed) and (request.T is not None or request.near is not None):
            check_carried(arm.environment.table, arm.state.objects, placed, may_fall=True)
        return placed

    def _shaped(self, request: requests.Place, known: SceneObject | None) -> SceneObject:
        """Return the requested object, not moved yet. ``known``: the object of that name."""
        shape = None if known is None else known.shape
        size = None if known is None else known.size
        solid = None if known is None else known.solid
        if request.shape is not None:
            shape = request.shape
        if request.mesh is not None:
            solid = self.hub.meshes.need(request.mesh).solid
        if request.size is not None:
            size = tuple(request.size)
        if shape is Shape.MESH:
            if solid is None:
                raise InputError(
                    f"{request.name!r} needs `mesh`: the key in the answer to its upload."
                )
            size = solid.size
        elif request.mesh is not None:
            raise InputError(f"{request.name!r} can have `mesh` only with the shape `mesh`.")
        else:
            solid = None
        if shape is None or size is None:
            raise InputError(f"There is no {request.name!r} yet: give its `shape` and `size`.")
        scale = 1.0 if known is None else known.scale
        if request.scale is not None:
            scale = request.scale
        if scale != 1.0 and request.name in (CUP, BASIN):
            raise InputError(
                f"The {request.name} cannot be scaled: the water model depends on its size."
            )
        can_be_held = known is not None and known.can_be_held
        if request.can_be_held is not None:
            can_be_held = request.can_be_held
        zone = Zone.NONE if known is None else known.zone
        if request.zone is not None:
            zone = request.zone
        return SceneObject(
            request.name,
            shape,
            size,
            np.eye(4) if known is None else known.T,
            can_be_held,
            solid=solid,
            scale=scale,
            appearance=_appearance(request, PLAIN if known is None else known.appearance),
            fixed=known is not None and known.fixed,
            zone=zone,
            joint=None if known is None else known.joint,
            crush_force=None if known is None else known.crush_force,
        )

    def _attached(self, request: requests.Attach) -> cmd.Command:
        """Return the command that fixes the object where it is, or at a pose on the hand."""
        arm = self.hub.present()
        scene_object = self._known(request.name)
        if scene_object is None:
            raise InputError(f"There is no object {request.name!r}.")
        to = request.to
        hand = arm.environment.hand
        if request.T is None or hand is None:
            check_mounted(arm.environment, arm.state.objects, scene_object, to, arm.state.x)
            return request
        if to is not Attachment.HAND:
            raise InputError("`T` is a pose on the hand. Use `place` for a pose elsewhere.")
        T = hand.T_palm_tool @ se3.validated(request.T)
        return cmd.PlaceObject(replace(scene_object, T=T, fixed=True))

    def _known(self, name: str) -> SceneObject | None:
        """Return the object of ``name``; None without one. Raises InputError while it is held."""
        arm = self.hub.present()
        if any(link.name == name for link in arm.robot.links) or name == "table":
            raise InputError(f"{name!r} is not an object that can be moved.")
        known = named(arm.state.objects, name)
        if known is not None and known.held:
            raise InputError(f"{name!r} is held: open the gripper first.")
        return known


def _appearance(request: requests.Place, known: ObjectAppearance) -> ObjectAppearance:
    """Return the requested appearance; fields that are not given are those of ``known``."""
    colour = known.colour
    if request.colour is not None:
        colour = None
        if request.colour != "own":
            red, green, blue = bytes.fromhex(request.colour[1:])
            colour = (red, green, blue)
    return ObjectAppearance(
        colour,
        known.opacity if request.opacity is None else request.opacity,
        known.hidden if request.hidden is None else request.hidden,
    )

"""What is asked of the things around: put, fixed to the hand, taken away, filled."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from katana450.arm.control import commands as cmd
from katana450.arm.control.placement import free_place
from katana450.arm.control.pouring import BASIN, CUP
from katana450.arm.control.solid import PLAIN, Look
from katana450.arm.control.support import check_carried, check_mounted, is_loose
from katana450.arm.control.things import MOST, Form, Mount, Thing, named
from katana450.errors import InputError
from katana450.maths.geometry import se3
from katana450.maths.water.units import ML
from katana450.server.api import requests
from katana450.server.service.hub import Hub


class ObjectRequests:
    """Makes commands of it, or raises the InputError or LeaseError that says why not."""

    def __init__(self, hub: Hub) -> None:
        self._hub = hub

    def command(self, request: requests.Request) -> cmd.Command | None:
        """What the arm is told; None for a request about something else."""
        match request:
            case requests.Place():
                return cmd.Place(self._thing(request))
            case requests.Attach():
                return self._attached(request)
            case requests.Load(scene=key):
                return self._hub.scenes.furnishing(key, self._hub.present())
            case requests.Fill(ml=ml):
                return cmd.Fill(ML * ml)
            case requests.Remove(name=name):
                self._out_of_the_hand(name)
                return cmd.Remove(name)
        return None

    def _thing(self, asked: requests.Place) -> Thing:
        """What is to be put where; what is not said of it stays as it is."""
        arm = self._hub.present()
        known = self._out_of_the_hand(asked.name)
        if known is None and len(arm.state.things) >= MOST:
            raise InputError(f"There are {MOST} things already: take one away.")
        thing = self._shaped(asked, known)
        if asked.T is None:
            return (
                thing
                if known is not None
                else replace(thing, T=free_place(thing, arm.state.things))
            )
        T = se3.printed(asked.T, f"The pose of {asked.name!r}")
        if asked.frame is requests.Frame.SHOULDER:
            T = arm.arm.T_base_shoulder @ T
        if thing.fixed:
            T = arm.surroundings.into_hand(T, arm.state.x)
        placed = replace(thing, T=T)
        if is_loose(placed):
            check_carried(arm.surroundings.table, arm.state.things, placed)
        return placed

    def _shaped(self, asked: requests.Place, known: Thing | None) -> Thing:
        """What it is, wherever that is."""
        form = None if known is None else known.form
        size = None if known is None else known.size
        solid = None if known is None else known.solid
        if asked.form is not None:
            form = Form(asked.form.value)
        if asked.mesh is not None:
            solid = self._hub.meshes.need(asked.mesh).solid
        if asked.size is not None:
            size = tuple(asked.size)
        if form is Form.MESH:
            if solid is None:
                raise InputError(f"Say the mesh of {asked.name!r}: the key that the upload told.")
            size = solid.size
        elif asked.mesh is not None:
            raise InputError(f"{asked.name!r} has a mesh when its form is mesh.")
        else:
            solid = None
        if form is None or size is None:
            raise InputError(f"There is no {asked.name!r} yet: say its form and size.")
        scale = 1.0 if known is None else known.scale
        if asked.scale is not None:
            scale = asked.scale
        if scale != 1.0 and asked.name in (CUP, BASIN):
            raise InputError(f"The {asked.name} is as large as the water in it counts on.")
        can_be_held = known is not None and known.can_be_held
        if asked.can_be_held is not None:
            can_be_held = asked.can_be_held
        return Thing(
            asked.name,
            form,
            size,
            np.eye(4) if known is None else known.T,
            can_be_held,
            solid=solid,
            scale=scale,
            look=_look(asked, PLAIN if known is None else known.look),
            fixed=known is not None and known.fixed,
        )

    def _attached(self, asked: requests.Attach) -> cmd.Command:
        """Where it is, or where on the hand it is to be."""
        arm = self._hub.present()
        thing = self._out_of_the_hand(asked.name)
        if thing is None:
            raise InputError(f"There is no {asked.name!r}.")
        to = Mount(asked.to.value)
        hand = arm.surroundings.hand
        if asked.T is None or hand is None:
            check_mounted(arm.surroundings, arm.state.things, thing, to, arm.state.x)
            return cmd.Attach(asked.name, to)
        if to is not Mount.HAND:
            raise InputError("T is where on the hand it is to be; to put it elsewhere, `place` it.")
        T = hand.T_palm_tool @ se3.printed(asked.T)
        return cmd.Place(replace(thing, T=T, fixed=True))

    def _out_of_the_hand(self, name: str) -> Thing | None:
        """The thing of that name, if there is one. Raises InputError when it is held."""
        arm = self._hub.present()
        if any(link.name == name for link in arm.robot.links) or name == "table":
            raise InputError(f"{name!r} is no thing that can be put elsewhere.")
        known = named(arm.state.things, name)
        if known is not None and known.held:
            raise InputError(f"{name!r} is held: open the gripper first.")
        return known


def _look(asked: requests.Place, known: Look) -> Look:
    """How it is to be drawn."""
    colour = known.colour
    if asked.colour is not None:
        colour = None
        if asked.colour != "own":
            red, green, blue = bytes.fromhex(asked.colour[1:])
            colour = (red, green, blue)
    return Look(
        colour,
        known.opacity if asked.opacity is None else asked.opacity,
        known.hidden if asked.hidden is None else asked.hidden,
    )

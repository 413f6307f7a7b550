"""Transfer of meshes and scenes between files and the server."""

from __future__ import annotations

import hashlib

from katana450.arm.control import commands as cmd
from katana450.arm.robot.object_meshes import Mesh
from katana450.errors import LeaseError
from katana450.extensions.importers.scene_file import StoredScene, scene_zip
from katana450.extensions.objects.scenes import free_name, scenes_of, used_in
from katana450.extensions.programs.scene_draft import Scene
from katana450.maths.water.units import MILLILITRE, ML
from katana450.server.api import answers
from katana450.server.service.arm_handle import ArmHandle
from katana450.server.service.hub import Hub


def keep_mesh(hub: Hub, mesh: Mesh) -> answers.Mesh:
    """Store ``mesh``, so that it can be placed. Raises InputError if there is no room for it."""
    state = None if hub.arm is None else hub.arm.state
    hub.meshes.put([mesh], used_in(state))
    names = {scene_object.name for scene_object in state.objects} if state is not None else set()
    return answers.Mesh(
        key=mesh.key,
        name=free_name(mesh.name, names),
        text=mesh.text,
        size=list(mesh.solid.size),
        triangles=len(mesh.faces),
        scale=mesh.scale,
    )


def keep_scene(hub: Hub, data: bytes, stored: StoredScene, arm: ArmHandle) -> answers.Scene:
    """Store ``stored``, read from ``data``, so that it can be loaded. Raises InputError."""
    key = hashlib.sha256(data).hexdigest()[:32]
    scene = stored.scene
    scenes_of(hub).keep(key, cmd.ReplaceScene(scene.objects, scene.water), stored.meshes, arm)
    names = [scene_object.name for scene_object in scene.objects]
    text = f"{len(names)} object{'' if len(names) == 1 else 's'}: {', '.join(names) or 'none'}."
    if scene.joints is not None:
        text += " The arm does not move."
    return answers.Scene(key=key, objects=names, text=text)


def zipped(hub: Hub, arm: ArmHandle) -> bytes:
    """Return the present scene as a .zip. Raises InputError or LeaseError if it cannot be saved."""
    hand = arm.environment.hand
    return scene_zip(_stored(hub, arm), None if hand is None else hand.T_palm_tool)


def _stored(hub: Hub, arm: ArmHandle) -> StoredScene:
    state = arm.state
    held = state.held
    if held is not None:
        raise LeaseError(
            f"{held.name!r} is held. Set it down first: a scene cannot have held objects."
        )
    water = None
    if state.poured is not None:
        water = ML * state.poured.water.cup.kept / MILLILITRE
    keys = dict.fromkeys(t.solid.key for t in state.objects if t.solid is not None)
    meshes = tuple(hub.meshes.need(key) for key in keys)
    return StoredScene(Scene(state.objects, water, state.q), meshes)

"""The scene that a script needs, and its differences from the present one."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from katana450.arm.control import commands as cmd
from katana450.arm.control.pouring import CUP
from katana450.arm.control.scene_objects import SceneObject, Shape
from katana450.arm.control.session import Session
from katana450.arm.control.state import State
from katana450.errors import InputError
from katana450.extensions.programs.language.attached_files import attached_file, is_file_name
from katana450.extensions.programs.language.declaration import Kind, record
from katana450.extensions.programs.language.kinds import TEXT, any_of, bound
from katana450.extensions.programs.language.scope import ScriptContext
from katana450.extensions.programs.language.source import ScriptError, YamlValue
from katana450.extensions.programs.script.scene_draft import (
    OBJECTS,
    Scene,
    SceneDraft,
    SceneEntry,
    parsed,
)
from katana450.maths.geometry.arrays import FloatArray
from katana450.maths.water.units import MILLILITRE, ML

SAME_PLACE = 1e-4
"""[m] Distance up to which an object is at the place that a script expects."""

SAME_TURN = 1e-3
"""[1] Maximum difference of the elements of two rotation matrices that count as equal."""

SAME_VOLUME = 0.1
"""[ml] Difference up to which the cup has the water that a script expects."""


@dataclass(frozen=True, eq=False)
class ScriptScene:
    """The scene of a script.

    Attributes:
        at: its place in the script.
        draft: the scene, without its meshes.
        file: name of its file in the folder of the script; "" if the script has it inline.
    """

    at: YamlValue
    draft: SceneDraft
    file: str = ""

    def begin(self, session: Session) -> State:
        """Return the state of an arm at rest in the scene. Raises InputError for a mesh.

        The meshes of a scene are files, which are read by ``katana450 run``.
        """
        for entry in self.draft.entries:
            if entry.mesh is not None:
                raise entry.source.wrong(
                    f"{entry.name} is a mesh, whose file is not read here. Use `katana450 run`."
                )
        scene = self.draft.scene({}, _T_palm_tool(session))
        try:
            return begun(session, scene)
        except ScriptError:
            raise
        except InputError as error:
            raise self.at.wrong(str(error)) from error

    def check_present(self, session: Session, state: State) -> None:
        """Raise ScriptError with the first difference if ``state`` is not in this scene.

        The forms of meshes are not compared.
        """
        if difference := self._difference(session, state):
            raise self.at.wrong(
                f"The scene is not that of the script: {difference}. Load the "
                "scene on the page, start the server with it, or simulate the script alone. "
                "Without `scene` it runs in any."
            )

    def _difference(self, session: Session, state: State) -> str:
        """Return a clause that names the first difference of ``state`` from this scene."""
        present = {each.name: each for each in state.objects}
        T_palm_tool = _T_palm_tool(session)
        for entry in self.draft.entries:
            if entry.name not in present:
                return f"there is no {entry.name}"
            found = _object_difference(entry, present[entry.name], T_palm_tool)
            if found:
                return found
        expected = {entry.name for entry in self.draft.entries}
        for name in present:
            if name not in expected:
                return f"there is also {name}"
        wanted, poured = (self.draft.water or 0.0) / ML, state.poured
        cup = 0.0 if poured is None else poured.water.cup.kept / MILLILITRE
        if abs(wanted - cup) > SAME_VOLUME:
            return f"the cup has {cup:.1f} ml of water, not {wanted:.1f} ml of water"
        return ""


def _scene(value: YamlValue, context: ScriptContext) -> ScriptScene | None:
    """Read the name of a file, a list of objects, or a mapping like that of a scene file."""
    if value.kind == "nothing":
        return None
    if value.kind == "list":
        return ScriptScene(value, SceneDraft(entries=bound(OBJECTS)(value, context)))
    if value.kind == "mapping" and not any(is_file_name(name) for name, _ in value.fields):
        return ScriptScene(value, bound(record(SceneDraft))(value, context))
    file = attached_file(value)
    return ScriptScene(value, parsed(file.text, file.name), file.name)


SCENE = Kind(
    _scene,
    any_of(
        "The scene that the script needs: a file in its folder, or the objects",
        TEXT.schema,
        OBJECTS.schema,
        SceneDraft.schema(),
        {
            "description": "A file, with its text",
            "type": "object",
            "patternProperties": {r"\.ya?ml$": TEXT.schema},
            "additionalProperties": False,
            "minProperties": 1,
        },
        {"type": "null"},
    ),
)


def begun(session: Session, scene: Scene) -> State:
    """Return the state of an arm at rest in ``scene``. Raises InputError if it is impossible."""
    check_scene(session, scene)
    q = session.ready if scene.joints is None else scene.joints
    start = session.begin(q, session.require_arm().gripper.clamp(0.0), 0.0)
    return session.step(start, (cmd.ReplaceScene(scene.objects, scene.water),), start.t)


def check_scene(session: Session, scene: Scene) -> None:
    """Raise InputError if the arm of ``session`` cannot begin in ``scene``."""
    if scene.joints is not None:
        if session.arm is None:
            raise InputError(
                "`joints` are the angles of an arm, and this robot is driven joint by joint. Leave "
                "them out."
            )
        chain = session.arm.chain
        if not chain.within_limits(chain.check_q(scene.joints)):
            raise InputError("The joints lie outside the limits of this arm.")
    if scene.water is not None and all(each.name != CUP for each in scene.objects):
        raise InputError("There is water, but no cup.")
    session.check(cmd.ReplaceScene(scene.objects, scene.water))


def _object_difference(
    entry: SceneEntry, found: SceneObject, T_palm_tool: FloatArray | None
) -> str:
    """Return a clause that names how ``found`` differs from ``entry``; "" for not at all."""
    same_size = entry.shape is Shape.MESH or np.allclose(entry.size, found.size, rtol=1e-6)
    if entry.shape is not found.shape or not same_size:
        return f"{entry.name} has another shape or size"
    if abs(entry.scale - found.scale) > 1e-6 * entry.scale:
        return f"{entry.name} has the scale {found.scale:g}, not {entry.scale:g}"
    if found.held or entry.fixed is not found.fixed:
        return f"{entry.name} is {'' if found.carried else 'not '}in the hand"
    if entry.can_be_held is not found.can_be_held:
        return f"{entry.name} can{'' if found.can_be_held else 'not'} be held"
    T = entry.T if T_palm_tool is None or not entry.fixed else T_palm_tool @ entry.T
    if float(np.linalg.norm(T[:3, 3] - found.T[:3, 3])) > SAME_PLACE:
        return f"{entry.name} is at {_point(found.T)}, not at {_point(T)}"
    if float(np.abs(T[:3, :3] - found.T[:3, :3]).max()) > SAME_TURN:
        return f"{entry.name} is turned"
    return ""


def _point(T: FloatArray) -> str:
    x, y, z = (1e3 * T[:3, 3]).tolist()
    return f"({x:.1f}, {y:.1f}, {z:.1f}) mm"


def _T_palm_tool(session: Session) -> FloatArray | None:
    hand = session.environment.hand
    return None if hand is None else hand.T_palm_tool

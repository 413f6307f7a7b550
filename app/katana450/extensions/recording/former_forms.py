"""Forms of older versions, which recorded only the cup, with a liquid of several.

They named commands by the classes of their time, which counted axes from 0. Their files are read,
and their setpoints verify; so do the digests of their states without water.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

from katana450.arm.control.commands.act import tag_of
from katana450.arm.control.commands.commands import Batch
from katana450.arm.control.commands.object_commands import Attach
from katana450.arm.control.objects.pouring import CUP
from katana450.arm.control.state.modes import Following, Positioning, Target
from katana450.arm.control.state.scene_objects import Attachment
from katana450.arm.control.state.state import State
from katana450.extensions.recording.forms import FormError, shown
from katana450.maths.kinematics.tool import ToolTarget
from katana450.maths.water.flow import MotionWithWater, VesselWater
from katana450.maths.water.units import ML

FORMER: Mapping[str, Any] = {"liquid": ["water", 998.2, 1.0016e-3, 72.74e-3, [74, 148, 192]]}
"""Fields that are not written any more, each with the only form that is read."""

OF_CUP = ("volume", "T", "slosh", "film", "wetted")
"""Fields of the cup, which had the names WRITTEN among those of all water."""

WRITTEN = ("cup", "T_base_cup", "slosh", "film", "wetted")
OF_MOTION = ("course", "middle", "velocity")


CLASSES: Mapping[str, str] = {"ToolPose": "ToolTarget", "PoseLines": "ToolLines"}
"""Present names of classes that had another one."""

COMMANDS: Mapping[str, str] = {
    **{"SetJoint": "joint", "SetJoints": "joints", "MoveTool": "position", "SetPose": "pose"},
    **{"TurnTool": "turn", "OrientTool": "orient", "SetGripper": "gripper", "SetTool": "tool"},
    **{"SpeedScale": "speed", "TakeBranch": "branch"},
}
"""Present names of the commands whose former class had another name."""


def command_form(form: Mapping[str, Any], detours: list[Any]) -> Mapping[str, Any]:
    """Return ``form`` of a command as it is written now.

    Older versions offered a detour after a drag, which a command of its own took. ``detours`` has
    the forms of the plans that were offered so far, the newest last. They also painted links.
    """
    former = form.get("is")
    match form:
        case {"is": "OfferDetour" | "offer_detour" | "SetAppearance" | "set_appearance"}:
            detours += filter(None, [form.get("plan")])
            return {"is": "batch", "commands": []}
        case {"is": "Go" | "go"} if detours:
            return {"is": "follow", "plan": detours[-1], "tau": 0.0}
        case {"is": "branch", "shoulder": shoulder, "elbow": elbow, "name": name}:
            return {"is": "branch", "name": name or f"{shoulder}-{elbow}"}
    if not isinstance(former, str) or not former[:1].isupper():
        return form
    now = dict(form) | {"is": COMMANDS.get(former, tag_of(former))}
    match former, now:
        case "SetJoint" | "Nudge", {"axis": int(axis)}:
            now["axis"] = axis + 1
        case "SetAxes", {"values": list(values)}:
            now["values"] = [
                [row[0] + 1, *row[1:]] if _is_axis_value(row) else row for row in values
            ]
        case "MoveTool", {"position": _}:
            now["p"] = now.pop("position")
        case "TakeBranch", {"branch": {"shoulder": shoulder, "elbow": elbow}}:
            now["name"] = f"{shoulder}-{elbow}"
            del now["branch"]
        case "TakeBranch", {"branch": _}:
            now["name"] = now.pop("branch")
        case "Fill", {"volume": int(volume) | float(volume)}:
            now["ml"] = _millilitres(volume)
            del now["volume"]
        case "Servo", {"t": t}:
            now |= {"is": "servo"} if t is None else {"is": "timed_servo"}
            if t is None:
                del now["t"]
        case "Hold" | "Pause", {"finding": finding}:
            now["is"] += "" if finding is None else "_for"
            if finding is None:
                del now["finding"]
    return now


def _is_axis_value(row: Any) -> bool:
    return isinstance(row, list) and bool(row) and isinstance(row[0], int)


def _millilitres(volume: float) -> float:
    """Return the number of millilitres of which ``volume`` [m^3] was made, exact to the bit."""
    ml = volume / ML
    near = (round(ml, 9), ml, math.nextafter(ml, 0.0), math.nextafter(ml, math.inf))
    return next((number for number in near if ML * number == volume), ml)


def upgraded(kind: type, form: Mapping[str, Any], detours: list[Any]) -> Mapping[str, Any]:
    """Return ``form`` of a value of ``kind`` as it is written now. Raises FormError.

    detours: see `command_form`.
    """
    if kind is ToolTarget and "R" in form:
        return {"position": form.get("position"), "rotation": form["R"]}
    if kind is Attach and form.get("to") == "TABLE":
        return dict(form) | {"to": Attachment.WORLD.name}
    if kind is Following:
        return {name: content for name, content in form.items() if name != "towards"}
    if kind is Positioning:
        detours += filter(None, [form.get("detour")])
        return {name: content for name, content in form.items() if name != "detour"}
    if kind is State and "appearance" in form:
        return {name: content for name, content in form.items() if name != "appearance"}
    if kind is Batch and isinstance(form.get("commands"), list):
        return dict(form) | {"commands": _without_paint(form["commands"])}
    if kind is VesselWater and "film" in form:
        return _without_film(form)
    if kind is not MotionWithWater:
        return form
    whole, water = dict(form), form.get("water")
    whole.pop("waited", None)
    if "motions" in form:
        return whole
    if not isinstance(water, dict):
        raise FormError(f"{shown(water)} is not the water of a cup")
    water = dict(water)
    cup = {now: water.pop(name) for name, now in zip(WRITTEN, OF_CUP, strict=True) if name in water}
    motion = {name: whole.pop(name) for name in OF_MOTION if name in whole}
    return whole | {"water": water | {"vessels": [{"name": CUP} | cup]}, "motions": [motion]}


def _without_paint(commands: list[Any]) -> list[Any]:
    """Return the forms of ``commands`` but for those that painted or hid a link or an object."""
    tags = ("SetAppearance", "set_appearance")
    return [form for form in commands if not (isinstance(form, dict) and form.get("is") in tags)]


def _without_film(form: Mapping[str, Any]) -> Mapping[str, Any]:
    """Return ``form`` of the water in a vessel, a part of which once clung to the wall."""
    film, volume = form["film"], form.get("volume")
    if not (isinstance(film, int) and isinstance(volume, int)):
        raise FormError(f"{shown(film)} is not the film of a vessel")
    rest = {name: content for name, content in form.items() if name not in ("film", "wetted")}
    return rest | {"volume": volume + film}


def target_content(target: Target) -> tuple[str, Any]:
    """Return the content of a target for a digest, with the classes of older versions."""
    if not isinstance(target, ToolTarget):
        return type(target).__name__, target
    if target.is_pitched:
        position, pitch, roll = target.position, target.pitch, target.roll
        return "ToolTarget", {"position": position, "pitch": pitch, "roll": roll}
    return "ToolPose", {"position": target.position, "R": target.R}

"""Kinds of values in scripts and scenes: numbers with units, texts, lists, vectors and places."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Annotated, TypeVar

import numpy as np

from katana450.extensions.general_arms.branch_words import BRANCH_NAMES
from katana450.extensions.programs.language import expression
from katana450.extensions.programs.language.declaration import Declared, Fields, Group, Kind, Schema
from katana450.extensions.programs.language.expression import PLAIN, with_article
from katana450.extensions.programs.language.scope import Angles, ScriptContext, StepTarget
from katana450.extensions.programs.language.source import Problem, ScriptError, YamlValue
from katana450.maths.geometry.arrays import FloatArray, frozen
from katana450.maths.kinematics.branch import AnyBranch
from katana450.maths.water.units import ML

T = TypeVar("T")

MAX_COORDINATE = 2000.0
"""[mm] Maximum magnitude of a coordinate."""

MAX_ANGLE = 3600.0
"""[deg] Maximum magnitude of an angle."""

LEAST_JOINTS, MAX_JOINTS = 3, 32
"""Numbers of joints of an arm."""

XYZ = ("x", "y", "z")

QUANTITIES = {
    "mm": (expression.LENGTH,),
    "deg": (expression.ANGLE,),
    "s": (expression.TIME,),
    "deg or mm": (expression.ANGLE, expression.LENGTH),
}
"""The kinds of quantities that can be given where a number in a unit is expected."""


DEFINITIONS: dict[str, Schema] = {}
"""Schemas of the kinds that are used often, by their names."""


def defined(name: str, kind: Kind[T]) -> Kind[T]:
    """Return ``kind``, whose schema is in DEFINITIONS as ``name``."""
    DEFINITIONS[name] = kind.schema
    return Kind(kind.read, reference(name))


def reference(name: str) -> Schema:
    """Return the schema that refers to a definition."""
    return {"$ref": f"#/$defs/{name}"}


def any_of(about: str, *options: Schema) -> Schema:
    """Return the schema of one of ``options``."""
    return {"description": about, "anyOf": list(options)}


def mapping(about: str, required: str, properties: Mapping[str, Schema]) -> Schema:
    """Return a mapping with these fields only; ``required``: names of those that must be there."""
    return {
        "description": about,
        "type": "object",
        "properties": dict(properties),
        "required": required.split(),
        "additionalProperties": False,
    }


def list_of(schema: Schema, low: int, high: int) -> Schema:
    """Return a list of ``low`` to ``high`` values of the kind ``schema``."""
    return {"type": "array", "items": schema, "minItems": low, "maxItems": high}


def number(
    low: float,
    high: float,
    unit: str = "",
    about: str = "",
    convert: Callable[[float], float] = float,
) -> Kind[float]:
    """Return the kind of a finite number from ``low`` to ``high``, or of a text that has one.

    ``about`` describes it if its unit does not; ``convert`` gives its value in the code.
    """
    suffix = f" {unit}" if unit else ""

    def read(value: YamlValue, _context: ScriptContext) -> float:
        # YAML takes a number such as 1e-3 for a text.
        is_number = value.kind in ("whole", "number", "text")
        amount = value.number if is_number else None
        if amount is None or not math.isfinite(amount):
            why = f": {value.why}." if value.why else "."
            raise value.wrong(
                f"Expected a number from {low:g} to {high:g}{suffix}, not {value}{why}"
            )
        if value.unit != PLAIN and value.unit not in QUANTITIES.get(unit, ()):
            wanted = f"a number in {unit}" if unit else "a number without a unit"
            raise value.wrong(f"Expected {wanted}, not {with_article(value.unit)}: {value}.")
        if not low <= amount <= high:
            raise value.wrong(f"{amount:g} is not between {low:g} and {high:g}{suffix}.")
        return convert(amount)

    bounds: Schema = {"type": "number", "minimum": low, "maximum": high}
    if unit:
        bounds["unit"] = unit
    return Kind(read, any_of(about or unit, bounds, {"type": "string"}))


def whole(low: int, high: int, about: str) -> Kind[int]:
    """Return the kind of a whole number from ``low`` to ``high``."""
    any_number = number(low, high, about=about)

    def read(value: YamlValue, _context: ScriptContext) -> int:
        amount = any_number(value)
        if amount != int(amount):
            raise value.wrong(f"Expected a whole number from {low} to {high}, not {value}.")
        return int(amount)

    return Kind(read, any_number.schema)


def millimetres(low: float, high: float, about: str = "") -> Kind[float]:
    """Return the kind of a length in mm; its value is in m."""
    return number(low, high, "mm", about, lambda length: 1e-3 * length)


def volume(low: float, high: float, about: str) -> Kind[float]:
    """Return the kind of a volume in ml; its value is in m^3."""
    return number(low, high, "ml", about, lambda amount: ML * amount)


def degrees(low: float, high: float, about: str = "") -> Kind[float]:
    """Return the kind of an angle in degrees; its value is in rad."""
    return number(low, high, "deg", about, math.radians)


def angle(low: float = -MAX_ANGLE, high: float = MAX_ANGLE, about: str = "") -> Kind[float]:
    """Return the kind of an angle as people write it, refused if it looks like radians."""
    about = about or "deg, or a text such as 0.5 rad"
    any_angle = degrees(low, high, about)

    def read(value: YamlValue, context: ScriptContext) -> float:
        radians = any_angle(value, context)
        _refuse_radians((value,))
        return radians

    return Kind(read, any_angle.schema)


def _refuse_radians(values: tuple[YamlValue, ...]) -> None:
    """Raise ScriptError if the angles ``values`` look like radians."""
    numbers = [value.number or 0.0 for value in values]
    if any(value.unit != PLAIN for value in values) or max(map(abs, numbers)) >= math.tau + 0.01:
        return
    for value, amount in zip(values, numbers, strict=True):
        if _is_fraction_of_pi(value, abs(amount)):
            text = str(value.held)
            text = f"({text}) * 1" if _decimals(text) is None else text
            raise value.wrong(
                f"{value.held} looks like radians, and angles are in degrees. Give its "
                f"unit: `{text} rad`, or `{text} deg` if that is meant."
            )


def _is_fraction_of_pi(value: YamlValue, amount: float) -> bool:
    """Return whether ``amount`` > 0 is a multiple of pi / 12 to all digits that ``value`` has."""
    digits = _decimals(str(value.held))
    digits = 9 if digits is None else digits
    steps = round(amount * 12.0 / math.pi)
    # Two decimals are enough only for quarters of a turn.
    exact = digits >= 3 or (digits == 2 and steps % 6 == 0)
    return exact and steps > 0 and abs(steps * math.pi / 12.0 - amount) <= 0.51 * 10.0**-digits


def _decimals(text: str) -> int | None:
    """Return the number of decimal places of a number; None for an expression."""
    digits, _, decimals = text.lstrip("+-").partition(".")
    return len(decimals) if (digits + decimals).isdigit() else None


def _text(value: YamlValue, _context: ScriptContext) -> str:
    """Read a text that is not blank; a number is not a text."""
    if value.kind != "text" or not isinstance(value.held, str) or not value.held.strip():
        raise value.wrong(f"Expected a text, not {value}.")
    return value.held


def known(names: str) -> Kind[str]:
    """Return the kind of a name; ``names`` tells editors which: objects, poses or tools."""
    return Kind(_text, {"type": "string", "names": names})


def choice(*names: str) -> Kind[str]:
    """Return the kind of one of ``names``."""

    def read(value: YamlValue, _context: ScriptContext) -> str:
        if value.held not in names:
            raise value.wrong(f"Expected one of `{'`, `'.join(names)}`, not {value}.")
        return str(value.held)

    return Kind(read, {"enum": list(names)})


def listed(kind: Kind[T], low: int, high: int) -> Kind[tuple[T, ...]]:
    """Return the kind of a list of ``low`` to ``high`` values of ``kind``."""

    def read(value: YamlValue, context: ScriptContext) -> tuple[T, ...]:
        if value.kind != "list":
            raise value.wrong(f"Expected a list, not {value}.")
        if not low <= len(value.items) <= high:
            many = f"{low}" if low == high else f"{low} to {high}"
            raise value.wrong(f"Expected a list of {many} values, not of {len(value.items)}.")
        values: list[T] = []
        problems: list[Problem] = []
        for item in value.items:
            try:
                values.append(kind(item, context))
            except ScriptError as error:
                problems += error.problems
        if problems:
            raise ScriptError(tuple(problems))
        return tuple(values)

    return Kind(read, list_of(kind.schema, low, high))


def vector(kind: Kind[float], about: str, *, partly: bool = False) -> Kind[FloatArray]:
    """Return the kind of {x, y, z} or [x, y, z], (3,). ``partly``: absent components are 0."""
    components = listed(kind, 3, 3)

    def read(value: YamlValue, context: ScriptContext) -> FloatArray:
        if value.kind == "list":
            return frozen(components(value, context))
        fields = Fields(value, "a vector")
        take = fields.take if partly else fields.need
        values = [take(name, kind, 0.0) for name in XYZ]
        fields.done()
        return frozen(values)

    by_name = mapping("x, y, z", "" if partly else " ".join(XYZ), dict.fromkeys(XYZ, kind.schema))
    return Kind(read, any_of(about, components.schema, by_name, {"type": "string"}))


def _direction(value: YamlValue, context: ScriptContext) -> FloatArray:
    """Read a unit vector (3,); x, -x, y, -y, z or -z stand for the axes."""
    if isinstance(value.held, str):
        sign, name = (-1.0, value.held[1:]) if value.held[:1] == "-" else (1.0, value.held)
        if name not in XYZ:
            raise value.wrong(f"Expected x, y, z, -x, -y, -z or three numbers, not {value}.")
        return frozen(sign * np.eye(3)[XYZ.index(name)])
    components = _COMPONENTS(value, context)
    length = math.hypot(*components)
    if length < 1e-9:
        raise value.wrong("A direction must not be zero.")
    return frozen(components / length)


def _joints(value: YamlValue, context: ScriptContext) -> FloatArray:
    """Read the angles (n,) [rad] of all joints, refused if they look like radians."""
    angles = _JOINT_ANGLES(value, context)
    _refuse_radians(value.items)
    return np.array(angles)


def bound(kind: Kind[T]) -> Kind[T]:
    """Return the kind of a value in which names may stand for values."""
    return Kind(lambda value, context: kind(context.scope.bound(value), context), kind.schema)


def one_of(kinds: Mapping[str, Kind[T]]) -> Group[T | None]:
    """Return the group of exactly one of the fields ``kinds``; None after a mistake."""

    def take(fields: Fields, context: ScriptContext) -> T | None:
        names = [
            fields.take(name, kind.within(context), None)
            for name, kind in kinds.items()
            if fields.has(name)
        ]
        if len(names) == 1:
            return names[0]
        fields.refuse(f"{fields.what.capitalize()} needs exactly one of {', '.join(kinds)}.")
        return None

    return Group(take, {name: kind.schema for name, kind in kinds.items()})


RAW: Kind[YamlValue] = Kind(lambda value, _: value, {})
"""Any value, as it is."""

TEXT: Kind[str] = Kind(_text, {"type": "string"})
NAME = known("objects").about("Name of an object")
POSE_NAME = known("poses").schema
LENGTH = millimetres(-MAX_COORDINATE, MAX_COORDINATE, "mm, or a text such as 4 cm or 2 * radius")
ANGLE = angle(-360.0, 360.0)
TURN = angle()
_AXIS_NUMBER = whole(1, MAX_JOINTS, "Number of the joint, from 1")
AXIS = Kind(lambda value, _: _AXIS_NUMBER(value) - 1, _AXIS_NUMBER.schema)
FINGER_PLACE = number(-180.0, 180.0, "deg or mm")
BRANCH: Kind[AnyBranch] = choice(*BRANCH_NAMES).about("Branch of the arm")

_COMPONENTS = vector(
    number(-MAX_COORDINATE, MAX_COORDINATE, about="Component"), "x, y, z", partly=True
)
_JOINT_ANGLES = listed(degrees(-720.0, 720.0), LEAST_JOINTS, MAX_JOINTS)
OFFSET = vector(LENGTH, "Motion of the tool point, mm; what is absent is 0", partly=True)
DIRECTION = defined(
    "direction",
    Kind(
        _direction,
        any_of(
            "A direction: x, -y and so on, or three numbers",
            _COMPONENTS.schema,
            {"enum": [sign + name for name in XYZ for sign in ("", "-")]},
        ),
    ),
)
JOINTS = defined(
    "joints",
    Kind(_joints, any_of("Angles of all joints, deg", _JOINT_ANGLES.schema, {"type": "string"})),
)

ORIENTATION = {
    "pitch": ANGLE.about("Pitch of the tool, deg: 0 is level, 90 points down"),
    "roll": ANGLE.about("Roll of the tool about its own axis, deg"),
    "yaw": ANGLE.about("Yaw of the tool, deg, of arms with six or more axes"),
}
ANGLES = Group(
    lambda fields, _: Angles(*(fields.take(name, ORIENTATION[name], None) for name in ORIENTATION)),
    {name: kind.schema for name, kind in ORIENTATION.items()},
)

ObjectName = Annotated[str, NAME]
Object = Annotated[str, NAME.named("object")]
"""The name of the object that a step or a condition is about."""
Length = Annotated[float, LENGTH]
Angle = Annotated[float, TURN]
Axis = Annotated[int, AXIS]
"""Index of a joint, from 0; from 1 in a script."""
Branch = Annotated[AnyBranch | None, BRANCH]
Offset = Annotated[FloatArray, OFFSET]
Direction = Annotated[FloatArray, DIRECTION]
Joints = Annotated[FloatArray, JOINTS]
Orientation = Annotated[Angles, ANGLES]


ROOMIEST = "roomiest"
"""The word for the pitch that keeps the joints farthest from their limits along an arc."""

MIN_BLEND = 0.01
"""[1] Minimum rounding of a corner that is rounded."""

MAX_VIAS = 50
"""Maximum number of places of one step."""


def _place(value: YamlValue, context: ScriptContext) -> StepTarget:
    """Read the name of a pose, {joints: [...]}, or {x, y, z, pitch, roll, yaw, branch}."""
    if value.kind == "text":
        if value.held not in context.poses:
            known = ", ".join(context.poses) or "none"
            raise value.wrong(f"There is no pose {value}. Under `poses:` are: {known}.")
        return context.poses[str(value.held)]
    fields = Fields(value, "a place")
    if fields.has("joints"):
        target = StepTarget(joints=fields.take("joints", JOINTS, None))
    else:
        position = np.array([fields.need(name, LENGTH, 0.0) for name in XYZ])
        angles, branch = ANGLES.take(fields, context), fields.take("branch", BRANCH, None)
        target = StepTarget(None, position, angles, branch, context.in_base)
    fields.done()
    return target


def _point(value: YamlValue, context: ScriptContext) -> FloatArray:
    """Read a point (3,) [m]: {x, y, z}, [x, y, z], or the name of a pose that has one."""
    if value.kind != "text":
        return _COORDINATES(value, context)
    pose = _place(value, context)
    if pose.position is None:
        raise value.wrong(
            f"The pose {value} is given by joint angles, so it is no point. Use it in `move`, or "
            "give it by x, y and z."
        )
    return pose.position


def _pose(value: YamlValue, context: ScriptContext) -> StepTarget:
    """Read a point; a named pose also gives its orientation."""
    point = _point(value, context)
    if value.kind == "text":
        return _place(value, context)
    return StepTarget(None, point, in_base=context.in_base)


def _arc_pitch(value: YamlValue, context: ScriptContext) -> float | str | None:
    """Read a pitch: an angle [rad], ROOMIEST, or None for ``keep``."""
    if value.number is not None:
        return ANGLE(value, context)
    word = choice("keep", ROOMIEST)(value)
    return None if word == "keep" else word


def _blend(value: YamlValue, _context: ScriptContext) -> float:
    blend = number(0.0, 1.0)(value)
    if 0.0 < blend < MIN_BLEND:
        raise value.wrong(f"A blend is 0, or {MIN_BLEND:g} to 1: {blend:g} is too small to drive.")
    return blend


_COORDINATES = vector(LENGTH, "A point, mm: {x, y, z}, [x, y, z], or the name of a pose")
POINT = defined(
    "point",
    Kind(_point, {**_COORDINATES.schema, "anyOf": [*_COORDINATES.schema["anyOf"][:2], POSE_NAME]}),
)
POSE = Kind(_pose, POINT.schema)
PLACE = defined(
    "place",
    Kind(
        _place,
        any_of(
            "A place: the name of a pose, angles of the joints, or a point with its orientation",
            POSE_NAME,
            mapping("Angles of the joints", "joints", {"joints": JOINTS.schema}),
            mapping(
                "A point with its orientation; what is absent stays",
                " ".join(XYZ),
                {
                    **dict.fromkeys(XYZ, LENGTH.schema),
                    **ANGLES.schemas,
                    "branch": BRANCH.schema,
                },
            ),
        ),
    ),
)
_PLACES = listed(PLACE, 2, MAX_VIAS)
THROUGH = defined(
    "through",
    Kind(_PLACES.read, any_of("Places in their order", _PLACES.schema, {"type": "string"})),
)
ARC_PITCH = Kind(
    _arc_pitch,
    any_of(
        "Pitch of the tool, deg; roomiest is farthest from the limits",
        ANGLE.schema,
        {"enum": ["keep", ROOMIEST]},
    ),
)
BLEND = Kind(
    _blend,
    number(
        0.0, 1.0, about="Fraction of half a leg that a corner cuts off; 0 rests in each corner"
    ).schema,
)

Point = Annotated[FloatArray, POINT]
Pose = Annotated[StepTarget, POSE]
Places = Annotated[tuple[StepTarget, ...], THROUGH]
"""Places that a step moves through."""
Blend = Annotated[float, BLEND]
"""Fraction of half a leg that a rounded corner cuts off; with 0 the tool rests in each corner."""


@dataclass(frozen=True)
class Spot(Declared):
    """Where an object is put down: its underside and its angle about the vertical.

    Attributes:
        x, y: [m].
        z: height of the underside [m]; NaN for that of whatever is below.
        yaw: angle about the vertical [rad]; None for any.
    """

    noun = "the place of an object"

    x: Length
    y: Length
    z: Annotated[float, LENGTH.about("Height of its underside, mm")] = math.nan
    yaw: Annotated[float | None, ANGLE.about("Angle about the vertical, deg")] = None


def _spot(value: YamlValue, context: ScriptContext) -> Spot:
    """Read {x, y, z, yaw}, or a point. Raises ScriptError."""
    if value.kind == "mapping":
        return Spot.read(value, context)
    return Spot(*POINT(value, context).tolist())


SPOT = Kind(
    _spot,
    any_of(
        "Its place: the name of a pose, [x, y, z], or x, y and, if wanted, z, yaw",
        POSE_NAME,
        POINT.schema,
        Spot.schema(),
    ),
)

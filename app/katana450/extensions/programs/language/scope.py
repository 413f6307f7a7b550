"""The names at one place of a script, the targets that they stand for, and the frame of points."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import NamedTuple

import numpy as np

from katana450.caching import cached_property
from katana450.extensions.programs.language.expression import (
    FUNCTIONS,
    UNITS,
    ExpressionError,
    Quantity,
    evaluate,
)
from katana450.extensions.programs.language.source import YamlValue
from katana450.maths.geometry import se3
from katana450.maths.geometry.arrays import FloatArray
from katana450.maths.kinematics.branch import AnyBranch

METRES = 2.0
"""[mm] Coordinates that are all smaller look like metres."""


class Angles(NamedTuple):
    """Angles of the tool [rad]; None to keep one.

    They are pitch and roll of a five-axis arm. Of other arms they are the roll, pitch and yaw of
    the page: those of the tool frame in the frame of the script.
    """

    pitch: float | None = None
    roll: float | None = None
    yaw: float | None = None

    def or_else(self, other: Angles) -> Angles:
        """Return it with those of ``other`` where it has None."""
        return Angles(*(b if a is None else a for a, b in zip(self, other, strict=True)))


KEPT = Angles()
"""No angles: the orientation stays."""


@dataclass(frozen=True, eq=False)
class StepTarget:
    """The target of a step, by joints or by the pose of the tool.

    Attributes:
        joints: (n,) [rad]; None if the target is a pose.
        position: (3,) [m], in {S} or, with ``in_base``, in the base frame; None to keep it.
        angles: the orientation of the tool.
        branch: None for any, the present one first.
        in_base: whether ``position`` and ``angles`` are in the base frame.
    """

    joints: FloatArray | None = None
    position: FloatArray | None = None
    angles: Angles = KEPT
    branch: AnyBranch | None = None
    in_base: bool = False


@dataclass(frozen=True, eq=False)
class ScriptFrame:
    """The frame in which a script gives points [mm].

    Attributes:
        name: its name in a script.
        T: (4, 4) pose of the shoulder frame {S} in it [m].
    """

    name: str
    T: FloatArray

    @classmethod
    def of(cls, T_base_shoulder: FloatArray, *, in_base: bool) -> ScriptFrame:
        """Return the base frame, or the shoulder frame {S}."""
        return cls("base", T_base_shoulder) if in_base else cls("shoulder", np.eye(4))

    def shown(self, p: FloatArray) -> FloatArray:
        """Return the point (3,) [m] of {S} in this frame [mm]."""
        return 1e3 * (self.T[:3, :3] @ p + self.T[:3, 3])

    def point(self, shown: FloatArray) -> FloatArray:
        """Return the point (3,) [m] in {S} that is ``shown`` (3,) [mm] in this frame."""
        T = se3.inverse(self.T)
        return T[:3, :3] @ (1e-3 * shown) + T[:3, 3]

    def looks_like_metres(self, p: FloatArray) -> bool:
        """Return whether somebody seems to have given the point (3,) [m] of {S} in metres."""
        return float(np.abs(self.shown(p)).max()) < METRES

    def words(self, p: FloatArray) -> str:
        """Return the point (3,) [m] of {S} in words."""
        # Rounded first, and 0 added, so that there is no -0.0.
        x, y, z = (np.round(self.shown(p), 1) + 0.0).tolist()
        return f"({x:.1f}, {y:.1f}, {z:.1f}) mm in the {self.name} frame"


NAME = re.compile(r"[A-Za-z][A-Za-z0-9_]*")
"""Pattern of a name."""

ITEM = re.compile(r"\[(\d+)\]")
"""Pattern of the number of an item of a list, as in ``corner[0]``."""

RESERVED = frozenset(
    {*UNITS, *FUNCTIONS, "x", "y", "z", "pi", "open", "closed", "keep", "roomiest"}
)
"""Words with a meaning of their own."""


@dataclass(frozen=True)
class Scope:
    """The values that names stand for at one place of a script.

    Attributes:
        values: all values by their names, and the parts of mappings and lists by names such as
            ``box.name`` and ``corner.0``.
    """

    values: Mapping[str, YamlValue] = field(default_factory=dict)

    @cached_property
    def numbers(self) -> Mapping[str, Quantity]:
        """The values that are numbers."""
        return {
            name: Quantity(value.number, value.unit)
            for name, value in self.values.items()
            if value.number is not None
        }

    def having(self, name: YamlValue, value: YamlValue) -> Scope:
        """Return the scope with one more value, in which the names so far may be used.

        Raises ScriptError if ``name`` is no name for a value.
        """
        word = str(name.held)
        if name.kind != "text" or not NAME.fullmatch(word):
            raise name.wrong(f"Expected a name of letters, digits and _, not {name}.")
        if word in RESERVED:
            raise name.wrong(f"{word!r} has a meaning of its own. Choose another name.")
        bound = self.bound(value)
        values = {
            name: other
            for name, other in self.values.items()
            if name != word and not name.startswith(f"{word}.")
        }
        if bound.kind == "mapping":
            values |= {f"{word}.{part.held}": inner for part, inner in bound.fields}
        elif bound.kind == "list":
            values |= {f"{word}.{number}": inner for number, inner in enumerate(bound.items)}
        return Scope({**values, word: bound})

    def bound(self, value: YamlValue) -> YamlValue:
        """Return ``value`` with names and expressions in it replaced by what they stand for."""
        match value.kind:
            case "mapping":
                pairs = tuple((name, self.bound(inner)) for name, inner in value.fields)
                return replace(value, held=pairs)
            case "list":
                return replace(value, held=tuple(self.bound(inner) for inner in value.items))
            case "text":
                return self._bound_text(value)
        return value

    def _bound_text(self, value: YamlValue) -> YamlValue:
        text = str(value.held)
        name = ITEM.sub(r".\1", text)
        if name in self.values:
            # Errors are reported where the name is used.
            return replace(self.values[name], line=value.line, column=value.column)
        try:
            quantity = evaluate(text, self.numbers)
        except ExpressionError as error:
            return replace(value, why=str(error))
        return replace(value, kind="number", number=quantity.value, unit=quantity.kind)


@dataclass(frozen=True)
class ScriptContext:
    """The names at one place of a script.

    Attributes:
        in_base: whether points are in the base frame, not in {S}.
        scope: named values.
        poses: named places.
    """

    in_base: bool = False
    scope: Scope = field(default_factory=Scope)
    poses: Mapping[str, StepTarget] = field(default_factory=dict)

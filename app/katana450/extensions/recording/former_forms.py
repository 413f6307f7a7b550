"""Forms of older versions, which recorded only the cup, with a liquid of several.

Their files are read, and the digests of their states are still made, so that they verify.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from katana450.arm.control.pouring import CUP, MotionWithWater
from katana450.extensions.recording.forms import FormError, shown

FORMER: Mapping[str, Any] = {"liquid": ["water", 998.2, 1.0016e-3, 72.74e-3, [74, 148, 192]]}
"""Fields that are not written any more, each with the only form that is read."""

OF_CUP = ("volume", "T", "slosh", "film", "wetted")
"""Fields of the cup, which had the names WRITTEN among those of all water."""

WRITTEN = ("cup", "T_base_cup", "slosh", "film", "wetted")
OF_MOTION = ("course", "middle", "velocity")


def upgraded(kind: type, form: Mapping[str, Any]) -> Mapping[str, Any]:
    """Return ``form`` of a value of ``kind`` as it is written now. Raises FormError."""
    if kind is not MotionWithWater or "motions" in form:
        return form
    whole, water = dict(form), form.get("water")
    if not isinstance(water, dict):
        raise FormError(f"{shown(water)} is not the water of a cup")
    water = dict(water)
    cup = {now: water.pop(name) for name, now in zip(WRITTEN, OF_CUP, strict=True) if name in water}
    motion = {name: whole.pop(name) for name in OF_MOTION if name in whole}
    return whole | {"water": water | {"vessels": [{"name": CUP} | cup]}, "motions": [motion]}


def poured_content(poured: MotionWithWater | None) -> dict[str, Any] | None:
    """Return the content of the water for a digest, in the order of older versions."""
    if poured is None:
        return None
    water, cup, others = poured.water, poured.water.cup, poured.water.others
    content = {
        "water": {
            "cup": cup.volume,
            **{name: getattr(water, name) for name in ("basin", "parcels", "puddles")},
            **{"slosh": cup.slosh, "T_base_cup": cup.T, "film": cup.film, "wetted": cup.wetted},
            **FORMER,
        },
        **vars(poured.motions[0]),
        "waited": poured.waited,
    }
    return content | ({"others": (others, poured.motions[1:])} if others else {})

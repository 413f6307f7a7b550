"""Form of a plan, in which a segment that the arm follows several times is written once.

The session remembers by identity which segment it has checked, so a plan that is read must have the
same object in the same places.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

from katana450.extensions.recording.form_error import FormError
from katana450.extensions.recording.record_forms import ClassCoder
from katana450.extensions.recording.simple_forms import MAX_ITEMS, Coder
from katana450.maths.planning.plan import Plan, Segment

ORDER = "order"
"""Name of the item with the number of each segment in the list of different segments."""


class PlanCoder(ClassCoder):
    """Coder of plans."""

    def __init__(self, coders: Callable[[type], Mapping[str, Coder]]) -> None:
        """Code plans with the ``coders`` of the fields of a class."""
        super().__init__(Plan, None, coders)

    def encode(self, value: Any) -> Any:
        """Return the form of a plan."""
        different: dict[int, Segment] = {id(each): each for each in value.segments}
        numbers = {key: number for number, key in enumerate(different)}
        order = [numbers[id(each)] for each in value.segments]
        once = Plan(tuple(different.values()), value.clear_of, value.fingers, value.nearest)
        return {**super().encode(once), ORDER: order}

    def decode(self, form: Any) -> Any:
        """Return the plan of ``form``."""
        if not isinstance(form, dict) or not isinstance(order := form.get(ORDER), list):
            raise FormError("a plan is an object with the order of its segments")
        once = super().decode({name: each for name, each in form.items() if name != ORDER})
        count = len(once.segments)
        if not 0 < len(order) <= MAX_ITEMS:
            raise FormError("a plan has at least one segment", (ORDER,))
        if not all(type(number) is int and 0 <= number < count for number in order):
            raise FormError(f"the numbers of segments are from 0 to {count - 1}", (ORDER,))
        segments = tuple(once.segments[number] for number in order)
        return Plan(segments, once.clear_of, once.fingers, once.nearest)

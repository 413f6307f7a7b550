"""Nodes of a running world for the pads of the gripper."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from katana450.arm.control.state import State
from katana450.extensions.export.vrml_named import FieldValue, NamedField, NamedNode
from katana450.extensions.export.vrml_node import Type
from katana450.extensions.touch.foundation import PadPressure
from katana450.extensions.touch.pad import COLUMNS, ROWS
from katana450.extensions.touch.touch_model import TouchModel


def gripper_nodes(model: TouchModel) -> dict[str, NamedNode]:
    """Return the nodes of the pads of the gripper, which the files lack."""

    def pad(number: int) -> NamedNode:
        def value(state: State, of: Callable[[PadPressure], FieldValue], none: FieldValue) -> Any:
            squeeze = model.squeeze(state)
            return none if squeeze is None else of(squeeze.pads[number])

        no_pressure = [0.0] * (ROWS * COLUMNS)
        fields = {
            "force": NamedField(Type.FLOAT, lambda state: value(state, lambda at: at.force, 0.0)),
            "centre": NamedField(
                Type.PAIR,
                lambda state: value(state, lambda at: [*(at.centre or (0.0, 0.0))], [0.0, 0.0]),
            ),
            "pressure": NamedField(
                Type.FLOAT_LIST,
                lambda state: value(state, lambda at: at.pressure.ravel().tolist(), no_pressure),
            ),
        }
        return NamedNode("Touch", f"link {model.pads[number].finger}", fields)

    return {f"touch_{each.finger.split('_')[1]}": pad(n) for n, each in enumerate(model.pads)}

"""The JSON Schema of scripts, with which an editor completes, explains and checks their fields."""

from __future__ import annotations

from katana450.extensions.programs.language.declaration import Schema
from katana450.extensions.programs.language.kinds import DEFINITIONS, any_of
from katana450.extensions.programs.script.blocks import BLOCKS, STEP_LIST
from katana450.extensions.programs.script.script import Script
from katana450.extensions.programs.steps.place import Stack
from katana450.extensions.programs.steps.steps import STEPS

DIALECT = "https://json-schema.org/draft/2020-12/schema"

STEP_VALUES: dict[str, Schema] = {
    **{name: STEPS[name].schema() for name in sorted(STEPS)},
    "stack": Stack.schema(),
    **{name: block.schema() for name, block in BLOCKS.items()},
}
"""Schemas of the values of all steps, by the names of the steps."""

WITHOUT_VALUE = tuple(name for name, value in STEP_VALUES.items() if value.get("type") == "null")
"""Steps that take no value."""


def script_schema() -> Schema:
    """Return the JSON Schema of a script.

    It accepts every valid script. What it cannot express, such as limits of the arm or the value of
    a computed number, only the reader of scripts refuses.
    """
    step = any_of(
        "A step",
        {"enum": list(WITHOUT_VALUE)},
        {
            "type": "object",
            "properties": STEP_VALUES,
            "additionalProperties": False,
            "minProperties": 1,
            "maxProperties": 1,
        },
    )
    return {
        "$schema": DIALECT,
        "title": "Script of katana450",
        **Script.schema(),
        "$defs": {**DEFINITIONS, "steps": STEP_LIST, "step": step},
    }

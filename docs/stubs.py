"""Write the ``.pyi`` files of the methods that are derived from classes.

Run it with ``python -m docs.stubs``.
"""

from __future__ import annotations

import inspect
import textwrap
from collections.abc import Callable
from pathlib import Path
from types import NoneType, UnionType
from typing import Any, Literal, Union, get_args, get_origin, get_type_hints

import msgspec
import numpy as np

import katana450
from katana450.arm.control.commands.act import Request
from katana450.client import acts
from katana450.extensions.programs.language.declaration import Schema
from katana450.library import step_methods
from katana450.server.api.episode_requests import EpisodeRequest

PACKAGE = Path(katana450.__file__).parent

ACTS_HEAD = """\
# Written by `python -m docs.stubs` from the classes of the requests.
from typing import Any, Generic, Literal, TypeVar

import msgspec
import numpy.typing as npt

{imports}
AtRest = TypeVar("AtRest")
Answered = TypeVar("Answered")
Sent = TypeVar("Sent")

OWN: tuple[type[Request], ...]
METHODS: dict[str, type[Request]]
EPISODE_METHODS: dict[str, type[EpisodeRequest]]

def way_of(kind: type[Request]) -> str: ...
def signature_of(kind: type[msgspec.Struct]) -> Any: ...
def documentation_of(kind: type[msgspec.Struct]) -> str: ...
def add_method(owner: type, name: str, kind: type[msgspec.Struct], way: str) -> None: ...

class Acts(Generic[AtRest, Answered, Sent]):
"""

RESULTS = {"go": "AtRest", "ask": "Answered", "send": "Sent"}
"""Type of the result of each way in which a client executes an act."""


def acts_stub() -> str:
    """Return the content of ``client/acts.pyi``."""
    named: set[type] = {Request, EpisodeRequest}
    methods = [
        request_method(name, kind, RESULTS[acts.way_of(kind)], named)
        for name, kind in acts.METHODS.items()
    ]
    about_episodes = [
        request_method(name, kind, "int", named) for name, kind in acts.EPISODE_METHODS.items()
    ]
    modules: dict[str, list[str]] = {}
    for kind in sorted(named, key=lambda kind: kind.__name__):
        modules.setdefault(kind.__module__, []).append(kind.__name__)
    imports = "".join(
        f"from {module} import {', '.join(names)}\n" for module, names in sorted(modules.items())
    )
    head = ACTS_HEAD.format(imports=imports)
    return head + "\n".join(methods) + "\nclass EpisodeActs:\n" + "\n".join(about_episodes)


def request_method(name: str, kind: type[msgspec.Struct], result: str, named: set[type]) -> str:
    """Return the stub of the method that makes a request of ``kind``.

    The classes of its parameters are added to ``named``.
    """
    hints = get_type_hints(kind)
    parameters = ["self"]
    for parameter in list(acts.signature_of(kind).parameters.values())[1:]:
        default = "" if parameter.default is inspect.Parameter.empty else " = ..."
        parameters.append(f"{parameter.name}: {type_text(hints[parameter.name], named)}{default}")
    return method_text(name, parameters, result, acts.documentation_of(kind))


def method_text(name: str, parameters: list[str], result: str, about: str) -> str:
    """Return the stub of a method, with its docstring ``about``."""
    line = f"    def {name}({', '.join(parameters)}) -> {result}:\n"
    if len(line) > 101:
        rows = "".join(f"        {parameter},\n" for parameter in parameters)
        line = f"    def {name}(\n{rows}    ) -> {result}:\n"
    if "\n" in about:
        about += "\n"
    return line + textwrap.indent(f'"""{about}"""', "        ") + "\n"


def type_text(hint: Any, named: set[type]) -> str:
    """Return the type ``hint`` of a field as text, and add the classes in it to ``named``.

    Arrays can be given as any sequence.
    """
    if hint is NoneType:
        return "None"
    origin, arguments = get_origin(hint), get_args(hint)
    if origin in (Union, UnionType):
        return " | ".join(dict.fromkeys(type_text(argument, named) for argument in arguments))
    if origin is Literal:
        return f"Literal[{', '.join(repr(argument) for argument in arguments)}]".replace("'", '"')
    if origin is np.ndarray:
        return "npt.ArrayLike"
    if origin is not None:
        inner = ", ".join("..." if part is ... else type_text(part, named) for part in arguments)
        return f"{origin.__name__}[{inner}]"
    if hint.__module__ == "builtins":
        return str(hint.__name__)
    named.add(hint)
    return str(hint.__name__)


STEPS_HEAD = """\
# Written by `python -m docs.stubs` from the classes of the steps.
from collections.abc import Mapping, Sequence
from typing import Any

import numpy.typing as npt

from katana450.extensions.programs.building.step import Step
from katana450.extensions.programs.language.declaration import Schema

METHODS: dict[str, type[Step]]

class StepField:
    name: str
    schema: Schema
    parameter: Any

def fields_of(step: type[Step]) -> list[StepField]: ...
def documentation_of(step: type[Step]) -> str: ...
def resolved(schema: Schema) -> Schema: ...

class StepMethods:
    def write(self, step: str, content: Any) -> None: ...
"""

VALUES = {
    "string": "str",
    "number": "float",
    "array": "Sequence[Any] | npt.NDArray[Any]",
    "object": "Mapping[str, Any]",
}
"""Type of a value of a script by the type in its JSON Schema."""


def steps_stub() -> str:
    """Return the content of ``library/step_methods.pyi``."""
    methods: list[str] = []
    for word, step in step_methods.METHODS.items():
        parameters = ["self"]
        for field in step_methods.fields_of(step):
            parameter, text = field.parameter, " | ".join(value_types(field.schema))
            if parameter.kind is inspect.Parameter.KEYWORD_ONLY and "*" not in parameters:
                parameters.append("*")
            is_required = parameter.default is inspect.Parameter.empty
            text += "" if is_required else " | None = ..."
            parameters.append(f"{parameter.name}: {text}")
        methods.append(method_text(word, parameters, "None", step_methods.documentation_of(step)))
    return STEPS_HEAD + "\n".join(methods)


def value_types(schema: Schema) -> list[str]:
    """Return the types of Python in which a value of ``schema`` can be given, each once."""
    schema = step_methods.resolved(schema)
    if "anyOf" in schema and "type" not in schema:
        options = [text for option in schema["anyOf"] for text in value_types(option)]
        return [*dict.fromkeys(options)]
    return [VALUES[schema.get("type", "string")]]


STUBS: dict[Path, Callable[[], str]] = {
    PACKAGE / "client" / "acts.pyi": acts_stub,
    PACKAGE / "library" / "step_methods.pyi": steps_stub,
}
"""Content of each file."""


if __name__ == "__main__":
    for file, content in STUBS.items():
        file.write_text(content(), encoding="utf-8")

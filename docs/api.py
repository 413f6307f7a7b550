"""Write ``docs/api.md``, the reference of all messages, from the classes of the API.

``python -m docs.api``
"""

from __future__ import annotations

import inspect
import re
import sys
from pathlib import Path
from typing import Any

import msgspec

from katana450.extension import extensions
from katana450.server.api import answers, requests, schema
from katana450.server.api.fields import Request, tag_of

PAGE = Path(__file__).with_name("api.md")

PREFACE = """\
# The API, version {version}

<!-- Written by `python -m docs.api` from the classes in app/katana450/server/api. -->

Programs can send the same requests as the page, by the same rules: one participant drives the arm
at a time, everybody may stop it, and the driver sends ten heartbeats a second. Each message is a
JSON object. The field `do` names the kind of a request. A request with an `id` (a number or a text
of your choice) gets an answer with the same `id`. Lengths are in m, angles in rad, times in s.

## Channels

| | |
|---|---|
| **WebSocket** `/api/v{version}/socket?name=NAME` | requests to the server, answers and states from it |
| **TCP**, one JSON object per line | `katana450 serve --lines PORT`, for programs on the same machine; the first line is a `hello` |
| **HTTP** `POST /api/v{version}/do` | one request; the header `X-Program`, a secret key of 16 to 64 letters and digits that the program chooses, distinguishes programs; `X-Name` is the name that others see |
| **HTTP** `GET /api/v{version}/state`, `arm`, `event_log`, `branches`, `loop`, `objects`, `world`, `links` | the answers of `query` |
| **HTTP** `POST /api/v{version}/mesh?name=FILE&unit=UNIT` | uploads a .wrl, .stl, .obj, .ply, .off, .glb, .gltf, .dae or .3mf file; `place` uses the key in the answer |
| **HTTP** `GET`, `POST /api/v{version}/scene` | the scene as a .zip ([scenes](scenes.md)); an uploaded scene takes effect with `load` |
| **HTTP** `POST /api/v{version}/stop` | STOP |
| **HTTP** `GET /api/v{version}/openapi.json` | this reference as OpenAPI |

Every request is a heartbeat. If the server requires access links ([access](access.md)), send the token
behind the `#` of a link as `Authorization: Bearer TOKEN`, or in the `hello`. A moving arm is stopped
when its driver sends nothing or disconnects. After a stop nothing moves before a `clear_stop` and a new
command. A script that the server runs for a program ends at rest when nothing is received from that
program for 1 s (`--owner-silence`).

The answer to a command comes after the arm's process has taken it, one or two ticks later. The answer
to a later query can overtake it. It reports the result: `done` with the `outcome` `accepted`, or
`limited` with the findings that name the limits; or `refused` with the reason. If a request is several
commands (`set` with `more`) and some are refused, the answer is `limited` and lists the refused parts
with their reasons. Three kinds of requests are answered at once as `accepted`: samples of a stream
(`servo`, `jog`), `branch`, whose path is planned first, and a `steer` that gives the arm no command
yet. `stop` waits for nothing: its answer is `requested`.

A stop can be cleared before a program sees it. A program that must not continue after a stop, such as
one that streams joint angles, adds to each command the `revocations` of the state in which it began.
The server refuses the command if there was a stop or a change of driver since. The answer to a command
has the number too.

In a state, `stop` is `requested` until a state that is newer than the request shows that the arm is
stopped, and `confirmed` then. `age` is the time since the arm's process last answered. From 0.3 s on
the rest of the state is out of date, and `GET /health` answers with status 503.

## From Python

```python
from katana450.server.api import answers, requests
from katana450.client import connect

with connect("http://127.0.0.1:8080", name="My script") as arm:
    print(arm.query(answers.State).q)
    there = arm.joints([0.3, -1.0, 1.4, 0.3, 0.0])  # waits until the arm is there
    there = arm.go(requests.Position(p=(0.45, 0.1, 0.0)))  # pitch and roll stay the same
    print(there.why or "at the target")
    done = arm.ask(requests.Joint(axis=5, value=4.0))
    print(done.outcome, [found.text for found in done.findings])  # limited, axis 5 at its limit
```

`arm.upload(Path("bracket.stl"))` uploads a mesh. `arm.ask(requests.Place(name="bracket",
shape=requests.Shape.MESH, mesh=key))` places it in front of the arm. `arm.save_scene()` and
`arm.load_scene(data)` save and load the scene.

`connect` sends the heartbeats by itself. `aconnect` is the same for asyncio. A refused request
raises `RefusedError` with the reason and what to do. No call waits for ever: if the server does not
answer, it raises `LostError`.

Queries cost processor time, and each identity has a [budget](access.md#limits). A query beyond it is
refused with `retry`, the seconds until there is time again; over HTTP with status 429 and `Retry-After`.

## From GNU Octave

[examples/octave](../examples/octave/README.md) has the functions (`katana_open`, `katana_say`,
`katana_hear`, `katana_go`), kinematics in m-code, and the paper's circle streamed as joint angles.
`circle_by_name.m` sets rotations of the VRML world by DEF name instead, as VR Sink does. LabVIEW and
Simulink connect in the same way: [simulink](simulink.md).

## By hand

```sh
KEY=$(openssl rand -hex 16)  # a secret: everybody who knows it can act as this program
curl -H "X-Program: $KEY" -H 'X-Name: By hand' -d '{{"do": "joint", "axis": 1, "value": 0.4}}' http://127.0.0.1:8080/api/v{version}/do
curl http://127.0.0.1:8080/api/v{version}/state
```

A moving arm is stopped a quarter of a second after the last request of its driver, so a single `curl`
starts a motion and does not finish a long one.
"""


def page() -> str:
    """Return the text of the page."""
    parts = [PREFACE.format(version=requests.VERSION)]
    for title, union, tag in (
        ("Requests", requests.AnyRequest, "do"),
        ("Answers", answers.AnyAnswer, "is"),
    ):
        parts.append(f"## {title}\n")
        parts += [_kind(kind, tag) for kind in schema.kinds(union)]
        if tag == "do":
            for name, kinds in added_requests().items():
                module = kinds[0].__module__
                parts.append(f"## Requests of the extension `{name}`\n")
                parts.append(
                    f"A server without that extension refuses them. From Python: `{module}`.\n"
                )
                parts += [_kind(kind, tag) for kind in kinds]
    parts.append("### In requests\n")
    parts += [_kind(kind, None) for kind in (requests.FieldName, requests.FieldSetting)]
    parts.append("### In answers\n")
    parts += [
        _kind(kind, None)
        for kind in (
            *(
                answers.Finding,
                answers.PartRefusal,
                answers.Water,
                answers.LogLine,
                answers.BranchOption,
                answers.SceneObject,
            ),
            *(answers.Value, answers.Node, answers.Field, answers.Link),
        )
    ]
    return "\n".join(parts)


def added_requests() -> dict[str, tuple[type[Request], ...]]:
    """Return the requests of extensions, by the name of the extension."""
    return {
        each.name: each.serve.runner().request_types
        for each in extensions()
        if each.serve is not None and each.serve.runner is not None
    }


def _kind(kind: type[msgspec.Struct], tag: str | None) -> str:
    heading = kind.__name__ if tag is None else f'`"{tag}": "{tag_of(kind.__name__)}"`'
    lines = [f"### {heading}\n", _docstring(kind), ""]
    described = msgspec.json.schema_components([kind])[1][kind.__name__]
    for field in msgspec.structs.fields(kind):
        if field.name == "id" or (tag == "do" and field.name == "revocations"):
            continue
        shape = _shape(described["properties"][field.name])
        default = "" if field.required else f", default `{_json(field.default)}`"
        lines.append(f"- `{field.encode_name}`: {shape}{default}")
    return "\n".join(lines).rstrip() + "\n"


def _docstring(kind: type) -> str:
    """Return the docstring of a class as Markdown, its attributes as a list."""
    text = (inspect.getdoc(kind) or "").replace("``", "`")
    return re.sub(r"^ {4}(?=\S)", "- ", text.replace("Attributes:\n", ""), flags=re.MULTILINE)


def _json(value: Any) -> str:
    return msgspec.json.encode(value).decode()


def _shape(schema: dict[str, Any]) -> str:
    if "$ref" in schema:
        name: str = schema["$ref"].rpartition("/")[2]
        added = (sys.modules[kinds[0].__module__] for kinds in added_requests().values())
        places = (requests, answers, *added)
        kind: Any = next((vars(each)[name] for each in places if name in vars(each)), None)
        if hasattr(kind, "__members__"):
            return " or ".join(f'`"{each.value}"`' for each in kind)
        return name
    if "anyOf" in schema:
        return " or ".join(_shape(each) for each in schema["anyOf"])
    if "enum" in schema:
        return " or ".join(f'`"{each}"`' for each in schema["enum"])
    if schema.get("type") == "array":
        if "prefixItems" in schema:
            items = [_shape(each) for each in schema["prefixItems"]]
            return f"{len(items)} of {items[0]}"
        return f"list of {_shape(schema['items'])}"
    if schema.get("type") == "object":
        return f"by name, {_shape(schema['additionalProperties'])}"
    low, high = schema.get("minimum"), schema.get("maximum")
    within = (
        ""
        if low is None and high is None
        else f" from {low:g}" + ("" if high is None else f" to {high:g}")
    )
    return f"{schema.get('type')}{within}"


if __name__ == "__main__":
    PAGE.write_text(page(), encoding="utf-8")

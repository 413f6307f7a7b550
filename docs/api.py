"""Write ``docs/api.md``: every message of the API, from the message classes.

Run it with ``python -m docs.api``.
"""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Any

import msgspec

from katana450.arm.control.commands.act import Act, Request, tag_of
from katana450.arm.control.commands.checked import field_schema
from katana450.assembly.gateway import RUNNER
from katana450.extension import extensions, load
from katana450.extensions.api_description import documentation
from katana450.server.api import answers, requests

PAGE = Path(__file__).with_name("api.md")

PREFACE = """\
# The API, version {version}

<!-- Written by `python -m docs.api` from the message classes in app/katana450/server/api. -->

Programs can send the same requests as the page, under the same rules. One client at a time holds
the lease, the right to drive, and sends ten heartbeats a second. Every client may stop the arm.
Each message is a JSON object. The field `do` of a request names it. A request may have an `id`, a
number or a text of your own; its answer has the same `id`. Without an `id` only questions such as
`query` are answered, and refusals are sent. Lengths are in m, angles in rad, times in s.

## Connections

| | |
|---|---|
| **websocket** `/api/v{version}/socket?name=NAME` | Requests from the client; answers and states from the server. |
| **TCP**, one JSON object per line | `katana450 serve --lines PORT`, for programs on the same machine. The first line is a `hello`. STOP also has a [port of its own](access.md#the-port-of-stop), which `stop_port` in the `welcome` names. |
| **HTTP** `POST /api/v{version}/do` | One request. The header `X-Program` identifies the program by a secret key of 16 to 64 letters and digits that the program chooses. `X-Name` is the name that others see. |
| **HTTP** `GET /api/v{version}/state`, `arm`, `branches`, `loop`, `objects`, `world` | The answers of `query`. |
| **HTTP** `POST /api/v{version}/mesh?name=FILE&unit=UNIT` | Upload of a .wrl, .stl, .obj, .ply, .glb, .gltf or .3mf file. `place` uses it by the key in the answer. |
| **HTTP** `GET`, `POST /api/v{version}/scene` | Download and upload of the scene as a .zip ([scenes](scenes.md)). An uploaded scene waits for a `load`. |
| **HTTP** `GET /api/v{version}/scripts`, `scripts/NAME` | The names of the scripts of the folder of `--programs`, and of those of the library that the arm can do, and an example of each step; the text of one, such as `Pour`, for `program`. |
| **HTTP** `GET /api/v{version}/script.schema.json` | The [JSON Schema](programs.md#in-an-editor) of scripts. |
| **HTTP** `POST /api/v{version}/scripts`, `scripts/NAME` | The problems of the text in the body, line by line, its steps as blocks of lines, and its poses if it has only [these](programs.md#teaching); saves a valid text in the folder, with `?replace` over an old one. |
| **HTTP** `POST /api/v{version}/stop?press=NAME` | `stop`, on the main port and on the [port of STOP](access.md#the-port-of-stop), which answers with the stage. `press` makes copies on both count once. |
| **HTTP** `GET`, `POST /api/v{version}/episodes`, `GET episodes/NUMBER` | The list of [episodes](recording.md#episodes); starts, ends and judges them; the file of one. |
| **HTTP** `GET /api/v{version}/openapi.json` | Description of this API for programs: OpenAPI 3.1. It describes `do`, `stop`, the answers of `query` and each message with its units, including those of extensions; the messages on the websocket and the TCP port are the same. |

Every request is a heartbeat. If the server requires an access link ([access](access.md)), send the
token behind its `#` as `Authorization: Bearer TOKEN` or in the `hello`. The server stops a moving arm
when the holder of the lease falls silent or disconnects. After a stop nothing moves before a
`clear_stop` and a new command. A script that the server runs for a program ends at rest once nothing
is received from that program for 1 s (`--owner-silence`). A request with `wait` counts as a heartbeat
[until its motion has ended](#one-line-one-motion).

On a connection that has become slow, samples would still move the arm after a person has let go. So
each request may have `made`, the time of its making [s] on the client's own clock. The server compares
both clocks by the least delay of the connection. A `jog`, `step_tool`, `nudge`, `servo` or other target
that took 0.15 s more than that is refused with the reason and with `retry`, and a heartbeat counts as
that much older. The end of a motion is never late: a `jog` with zero rates, `end_drag`, `hold`, `stop`. A
longer delay counts as usual after 10 s without a late command. The page sends `made` with everything,
and the Python client with heartbeats and with samples sent by `send`. A request without `made` counts
from its receipt, whatever its delay.

The answer to a command comes once the arm's process has taken it, a tick or two later. The answer to
a later question can come first. A command is answered with one of these:

- `done` with the `outcome` `accepted`;
- `done` with the `outcome` `limited`, and the findings that limit it;
- `done` with the `outcome` `unknown`, if the arm's process does not report it within 1 s;
- `refused` with the reason.

If a request is several commands (`set` with `more`) and some of them are refused, the outcome is
`limited`, and the answer lists those parts with their reasons. Samples of a stream (`servo`, `jog`)
are answered at once, as `accepted`. So are acts whose
path is planned first ({planned}), and a `steer` that gives the arm no command yet. A `stop` is answered at once, as `requested`.

A stop is cleared at the earliest when the arm is at rest, and 1 s after the newest STOP; until then
`clear_stop` is refused with the reason. `clearable` in a state says when.

A stop can be cleared before a program sees it. A program that must not continue then, such as one that
streams joint angles, adds to each command the `revocations` of the state in which it began. The server
refuses the command if there was a stop or a change of driver since then. The answer to a command has
this number too.

In a state, `stop` is `requested` until a state newer than the request is stopped; then it is
`confirmed`. `age` is the time since the arm's process last answered. From 0.3 s the rest of the state
is out of date, and `GET /health` answers with status 503.

## From Python

```python
from katana450.server.api import answers, requests
from katana450.client import connect

with connect("http://127.0.0.1:8080", name="My script") as arm:
    print(arm.query(answers.State).q)
    there = arm.joints([0.3, -1.0, 1.4, 0.3, 0.0])  # waits until the arm is there
    there = arm.position((0.45, 0.1, 0.0))  # the tool point, pitch and roll kept
    print(there.why or "target reached")
    done = arm.ask(requests.Joint(axis=5, value=4.0))  # not waited for
    print(done.outcome, [found.text for found in done.findings])  # limited, axis 5 at its limit
```

The client has a method for each motion, and for nearly every other request below, with its fields. A motion
is waited for, and the method returns the state then; a sample of a stream is only sent; any other request
returns its answer. `arm.go`, `arm.send` and `arm.ask` do the same with any request.

`arm.upload(Path("bracket.stl"))` uploads a mesh. `arm.place("bracket", shape=requests.Shape.MESH, mesh=key)`
places it in front of the arm. `arm.save_scene()` returns the
scene, and `arm.load_scene(data)` restores it.

`connect` sends the heartbeats by itself. `aconnect` is the same for asyncio. A refused request
raises `RefusedError`, whose text has the reason and what to do. `arm.stop()` sends STOP on all paths at
once and returns `confirmed` or `requested`. `arm.clear_stop()` waits until the stop can be cleared. If the
server does not answer, a call raises `LostError`.

Questions cost processor time, of which each person has a [budget](access.md#limits). A question beyond
the budget is refused with `retry`, the seconds until there is time again. Over HTTP the status is 429,
with `Retry-After`.

## From GNU Octave

[examples/octave](../examples/octave/README.md) has the functions for a connection (`katana_open`,
`katana_say`, `katana_hear`, `katana_go`), kinematics in m-code, and the paper's circle streamed as joint
angles. They need Octave's package `instrument-control`, which has `tcpclient` (Debian: octave-instrument-control).
`circle_by_name.m` sets rotations of the VRML world by DEF name instead, as VR Sink does. LabVIEW
and Simulink connect in the same manner: [simulink](simulink.md).

## One line, one motion

A motion request with `wait`, the maximum duration of its motion in seconds (0.1 to 600), is answered when
the motion has ended. So one curl command makes one complete motion:

```sh
KEY=$(openssl rand -hex 16)  # a secret that identifies this program
curl -H "X-Program: $KEY" -H 'X-Name: By hand' -d '{{"do": "joint", "axis": 1, "value": 0.4, "wait": 20}}' http://127.0.0.1:8080/api/v{version}/do
curl -H "X-Program: $KEY" -d '{{"do": "position", "p": [0.45, 0.1, 0.0], "wait": 20}}' http://127.0.0.1:8080/api/v{version}/do
curl -H "X-Program: $KEY" -d '{{"do": "gripper", "angle": 0.2, "wait": 10}}' http://127.0.0.1:8080/api/v{version}/do
curl -H "X-Program: $KEY" -d '{{"do": "program", "text": "name: Nod\\nsteps:\\n  - joints: [0, -68, 85, 30, 0]\\n"}}' http://127.0.0.1:8080/api/v{version}/do
curl -H "X-Program: $KEY" -d '{{"do": "steer", "order": "run", "wait": 60}}' http://127.0.0.1:8080/api/v{version}/do
curl -H "X-Program: $KEY" -d '{{"do": "home", "wait": 20}}' http://127.0.0.1:8080/api/v{version}/do
curl http://127.0.0.1:8080/api/v{version}/state
```

The field `end` of the answer says how the motion ended, and where the arm is then:

| `how` | the motion | HTTP status |
|---|---|---|
| `reached` | reached its target; of `steer`: the program is done | 200 |
| `limited` | ended as near to the target as the arm can go; `why` and the findings say what limits it | 200 |
| `contact` | ended before a contact; the target is dropped | 409 |
| `paused` | waits on its path. So does `steer` with `step` after its step | 409 |
| `stopped` | was ended by a stop, of any client or of the server itself | 409 |
| `superseded` | was replaced by another command of the same program | 409 |
| `lease lost` | ended because another client drives now | 409 |
| `timeout` | did not end within `wait`. The arm is at rest and has no target any more; a program is ended | 409 |
| `failed` | was not possible: no path was found, or the program failed | 409 |

With `curl --fail-with-body` a status of 409 becomes the exit status 22, so a sequence of commands joined by `&&` ends there.

- While the request is open, its connection counts as the heartbeat. If it closes before the end, for
  example by Ctrl-C, the arm stops and the stop is latched, as when any driver disconnects. A client whose
  machine vanishes without closing is noticed within 3 s. A suspended client is not noticed; `wait` bounds that time.
- A lease that the request has acquired is released at the end, and nothing moves later. A lease that the
  client held before is kept.
- `wait` works on the WebSocket and the TCP port too, and needs no heartbeats until the answer. A request with
  `wait` is answered even without an `id`. At most 8 such requests of a client can be open.
- Streams (`servo`, `jog`), queries and requests about the lease have no `wait`; with it they are refused.

Without `wait` the answer comes at once. Then a moving arm stops, or pauses if it is simulated, 0.25 s
(`--silence`) after the last message of its program, because the driver fell silent.
"""


def page() -> str:
    """Return the text of the page."""
    planned = sorted(tag_of(kind.__name__) for kind in requests.EVERY if kind.traits.planned)
    names = ", ".join(f"`{name}`" for name in planned)
    parts = [PREFACE.format(version=requests.VERSION, planned=names)]
    for title, listed, tag in (
        ("Requests", sorted(requests.CORE, key=lambda kind: kind.__name__), "do"),
        ("Answers", answers.EVERY, "is"),
    ):
        parts.append(f"## {title}\n")
        parts += [_kind(kind, tag) for kind in listed]
        if tag == "do":
            for name, added in added_requests().items():
                ours = added[0] in requests.EVERY
                module = requests.__name__ if ours else added[0].__module__
                parts.append(f"## Requests of the extension `{name}`\n")
                parts.append(
                    f"A server without this extension refuses them. The Python module is `{module}`.\n"
                )
                parts += [_kind(kind, tag) for kind in added]
    for title, room in (("requests", requests), ("answers", answers)):
        parts.append(f"### In {title}\n")
        kinds = [kind for kind in vars(room).values() if isinstance(kind, type(msgspec.Struct))]
        named = [kind for kind in kinds if not issubclass(kind, (Act, answers.Answer))]
        parts += [_kind(kind, None) for kind in named if kind.__name__[0] != "_"]
    return "\n".join(parts)


def added_requests() -> dict[str, tuple[type[Request], ...]]:
    """Return the requests of extensions, by the name of the extension, as a server has them."""
    handlers = {part.name: part.handler for part in extensions() if part.handler}
    classes = {"programs": RUNNER, **handlers}
    return {name: load(target).request_types for name, target in classes.items()}


def _kind(kind: type[msgspec.Struct], tag: str | None) -> str:
    heading = kind.__name__ if tag is None else f'`"{tag}": "{tag_of(kind.__name__)}"`'
    text, fields = documentation(kind)
    lines = [f"### {heading}\n", text, ""]
    described = msgspec.json.schema_components([kind], schema_hook=field_schema)[1][kind.__name__]
    for field in msgspec.structs.fields(kind):
        if field.name == "id" or (tag == "do" and field.name in ("revocations", "made", "wait")):
            continue
        shape = _shape(described["properties"][field.name])
        default = "" if field.required else f", default `{_json(field.default)}`"
        about = f". {fields[field.name]}" if field.name in fields else ""
        lines.append(f"- `{field.encode_name}`: {shape}{default}{about}")
    if issubclass(kind, requests.MotionRequest):
        lines.append("- `wait`: see [one line, one motion](#one-line-one-motion).")
    return "\n".join(lines).rstrip() + "\n"


def _json(value: Any) -> str:
    return msgspec.json.encode(value).decode()


def _shape(schema: dict[str, Any]) -> str:
    if "$ref" in schema:
        name: str = schema["$ref"].rpartition("/")[2]
        added = (sys.modules[parts[0].__module__] for parts in added_requests().values())
        places = (requests, answers, *added)
        kind: Any = next((vars(place)[name] for place in places if name in vars(place)), None)
        if hasattr(kind, "__members__"):
            return " or ".join(f'`"{member.value}"`' for member in kind)
        return name
    if "anyOf" in schema:
        return " or ".join(_shape(choice) for choice in schema["anyOf"])
    if "enum" in schema:
        return " or ".join(f'`"{value}"`' for value in schema["enum"])
    if schema.get("type") == "array":
        item = schema["items"] or schema["prefixItems"][0]
        length = schema.get("minItems")
        alike = length is not None and length == schema.get("maxItems")
        return f"{length if alike else 'list'} of {_shape(item)}"
    if schema.get("type") == "object" and "additionalProperties" in schema:
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

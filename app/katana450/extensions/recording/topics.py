"""The topics of a recording and the JSON schemas of their messages."""

from __future__ import annotations

from typing import Any, Final, NamedTuple

COMMANDS: Final = "/commands"
CHECKPOINTS: Final = "/checkpoints"
PLANS: Final = "/plans"
SOLIDS: Final = "/solids"
STATE: Final = "/state"
JOINT_STATES: Final = "/joint_states"
TF: Final = "/tf"
EVENTS: Final = "/events"
EPISODES: Final = "/episodes"

SHARED_TOPICS: Final = {"Plan": PLANS, "Solid": SOLIDS}
"""Topic of each class of shared values."""


class Topic(NamedTuple):
    """A topic: its name, the name of its schema, and the schema."""

    name: str
    schema_name: str
    schema: dict[str, Any]


def _object(
    about: str, required: tuple[str, ...] = (), /, **properties: dict[str, Any]
) -> dict[str, Any]:
    return {
        "type": "object",
        "description": about,
        "properties": properties,
        "required": list(required),
    }


def _array(items: dict[str, Any], about: str) -> dict[str, Any]:
    return {"type": "array", "items": items, "description": about}


def _number(about: str) -> dict[str, Any]:
    return {"type": "number", "description": about}


def _numbers(about: str) -> dict[str, Any]:
    return _array({"type": "number"}, about)


def _text(about: str) -> dict[str, Any]:
    return {"type": "string", "description": about}


T = _number("time [s] on the clock of the recording, as log_time")
TIME = _object("time", ("sec", "nsec"), sec={"type": "integer"}, nsec={"type": "integer"})
FORM = {"description": "exact form of a value; see docs/recording.md"}
VECTOR = _object("[m]", ("x", "y", "z"), x=_number("x"), y=_number("y"), z=_number("z"))
QUATERNION = _object(
    "unit quaternion",
    ("x", "y", "z", "w"),
    **{name: _number(name) for name in ("x", "y", "z", "w")},
)

TOPICS: Final = (
    Topic(
        COMMANDS,
        "katana450.Tick",
        _object(
            "one tick of the control loop: its commands as the loop took them, with who gave each",
            ("t",),
            t=T,
            t_before=_number("time [s] of the state before it, unless that of the last tick"),
            commands=_array(_object("command", ("command", "actor"), command=FORM, actor=FORM), ""),
            sent=_object("answer of the driver, unless it is the setpoint", q=FORM, gripper=FORM),
            failed={"type": "boolean", "description": "whether an error made the arm hold"},
            digest=_text("digest of the state after it"),
            missing=_text("why this tick, and `ticks` before the next, cannot be simulated"),
            ticks={"type": "integer", "description": "number of missing ticks"},
        ),
    ),
    Topic(
        CHECKPOINTS,
        "katana450.Checkpoint",
        _object("complete state after a tick", ("t", "state"), t=T, state=FORM),
    ),
    *(
        Topic(
            name,
            f"katana450.{kind}",
            _object("a value with its key", ("key", "value"), key=_text("key"), value=FORM),
        )
        for kind, name in SHARED_TOPICS.items()
    ),
    Topic(
        STATE,
        "katana450.State",
        _object(
            "what changed in a tick",
            ("t", "setpoint"),
            t=T,
            q=_numbers("joints as the driver reported them [rad or m], unless these are setpoints"),
            qd=_numbers("rates of the setpoints [rad/s or m/s]"),
            setpoint=_numbers("setpoints of the joints [rad or m]"),
            gripper=_number("finger joint [rad or m]"),
            gripper_setpoint=_number("its setpoint [rad or m]"),
            tool=_text("tool frame"),
            position=_numbers("(3,) tool point in the base frame [m]"),
            target=_object(
                "target as given: of the joints, or of the tool in the frame {S}",
                q=_numbers("[rad or m]"),
                position=_numbers("[m]"),
                pitch=_number("[rad]"),
                roll=_number("[rad]"),
                T=_array(_numbers("row"), "pose (4, 4)"),
            ),
            mode=_text("mode of the session"),
            status=_text("status"),
            findings=_array(_text("reason in words"), "why the goal is not the target"),
            speed=_number("fraction of the maximum speed"),
            objects=_array(
                _object(
                    "object that changed",
                    ("name", "position", "orientation"),
                    name=_text("name"),
                    position=_numbers("(3,) in the base frame [m]"),
                    orientation=_numbers("(4,) x, y, z, w in the base frame"),
                    held={"type": "boolean", "description": "whether the fingers hold it"},
                ),
                "objects that were moved, added or taken",
            ),
            removed=_array(_text("name"), "objects that were removed"),
            water=_object(
                "volumes [ml]",
                **{name: _number(name) for name in ("cup", "basin", "air", "spilled")},
                lean=_numbers("(3,) normal of the surface in the cup, unless it is upright"),
                vessels=_array(
                    _object(
                        "other vessel",
                        ("name", "volume"),
                        name=_text("name"),
                        volume=_number("volume [ml]"),
                        lean=_numbers("(3,) as of the cup"),
                    ),
                    "other vessels",
                ),
                left=_array({}, "what left a vessel in this tick: ml, place, velocity, time [s]"),
            ),
        ),
    ),
    Topic(
        JOINT_STATES,
        "foxglove.JointStates",
        _object(
            "joints of the URDF",
            ("timestamp", "joints"),
            timestamp=TIME,
            joints=_array(
                _object("joint", ("name",), name=_text("name"), position=_number("[rad or m]")),
                "joints",
            ),
        ),
    ),
    Topic(
        TF,
        "foxglove.FrameTransforms",
        _object(
            "frames of the tool and the objects",
            ("transforms",),
            transforms=_array(
                _object(
                    "pose of a frame in its parent",
                    ("timestamp", "parent_frame_id", "child_frame_id", "translation", "rotation"),
                    timestamp=TIME,
                    parent_frame_id=_text("parent"),
                    child_frame_id=_text("frame"),
                    translation=VECTOR,
                    rotation=QUATERNION,
                ),
                "poses",
            ),
        ),
    ),
    Topic(
        EVENTS,
        "katana450.Event",
        _object("something that happened", ("t", "kind"), t=T, kind=_text("kind")),
    ),
    Topic(
        EPISODES,
        "katana450.Episode",
        _object(
            "description of an episode; the last one of each number counts",
            ("t", "kind", "number", "start", "outcome"),
            t=T,
            kind=_text("begun, ended, judged, noted, trimmed, discarded, restored or unfinished"),
            number={"type": "integer", "description": "number of the episode, from 1"},
            task=_text("task in words"),
            start=_number("first moment [s]"),
            end={"type": ["number", "null"], "description": "last moment [s]; null while it runs"},
            outcome=_text("running, unjudged, success, failure or unfinished"),
            note=_text("remarks"),
            by=_object(
                "person who began it",
                name=_text("name"),
                role=_text("role"),
                key=_text("pseudonym, as in the commands"),
            ),
        ),
    ),
)
"""All topics of a recording, in the order of their channels."""

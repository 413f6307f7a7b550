"""Texts about the state of the arm for people, keyed by the enums of the core."""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Sequence

from katana450.arm.control.state.state import CAUSES, Finding, Reason, State, Status
from katana450.maths.collision.clearance import MIN_CLEARANCE
from katana450.maths.kinematics.priority import Priority

AXIS_NAMES = ("base turn", "shoulder", "elbow", "wrist bend", "wrist roll")


def degrees(angle: float, digits: int = 1) -> str:
    """Return an angle [rad] as text in degrees, with a true minus sign and never "−0"."""
    return signed(math.degrees(angle), digits) + "°"


def millimetres(length: float, digits: int = 1) -> str:
    """Return a length [m] as text in millimetres."""
    return signed(1e3 * length, digits) + " mm"


def joint_unit(*, slides: bool) -> tuple[float, str]:
    """Return how many units of people one rad or m of a joint has, and their name in scripts."""
    return (1e3, "mm") if slides else (math.degrees(1.0), "deg")


def signed(value: float, digits: int) -> str:
    """Return a number with ``digits`` decimals, a true minus sign and no negative zero."""
    text = f"{abs(value):.{digits}f}"
    return "−" + text if value < 0 and float(text) != 0.0 else text


def axis(number: int | None) -> str:
    """Return the name of an axis; ``number`` counts from 0, the name from 1."""
    return "an axis" if number is None else f"axis {number + 1}"


def axis_names(names: Sequence[str]) -> Sequence[str]:
    """Return the names of the joints of an arm for people; ``names`` are those of its description.

    Joints that the description only numbers have the names of a five-axis arm. A beginning that
    all names share, as that of the robot, is left out.
    """
    numbered = all(re.fullmatch(r"(axis_?)?\d+", name) for name in names)
    if numbered and len(names) == len(AXIS_NAMES):
        return AXIS_NAMES
    shared = ""
    for underscore in re.finditer("_", names[0]):
        prefix = names[0][: underscore.end()]
        if all(re.match(rf"{re.escape(prefix)}[^\W\d]", name) for name in names):
            shared = prefix
    words = [name.removeprefix(shared).removesuffix("_joint").replace("_", " ") for name in names]
    return [re.sub(r"^(joint|axis)(\d+)$", r"\1 \2", name) for name in words]


def axis_label(number: int, name: str) -> str:
    """Return the label of the joint ``number``, from 1, with this name for people."""
    return name if name.endswith(f" {number}") else f"{number} {name}"


PARTS = {
    "base_link": "control box",
    "arm_base_link": "base",
    "pan_link": "shoulder",
    "finger_left_link": "left finger",
    "finger_right_link": "right finger",
}
"""Names for people of links whose names in the robot description are different."""

UNCHECKED = "No collision checking: the robot description gives the links no shapes."


def part(name: str) -> str:
    """Return the name for people of a link or an object."""
    return PARTS.get(name, name.removesuffix("_link").replace("_", " "))


def _contact(finding: Finding) -> str:
    one, other = finding.parts or ("a link", "another")
    # Parts that stand close at rest keep less, and parts in a contact may only part.
    why = (
        f"the arm stops at {short(1e3 * MIN_CLEARANCE)} mm"
        if finding.amount >= MIN_CLEARANCE
        else "they must not come nearer"
    )
    return f"{part(one)} and {part(other)} are {short(1e3 * finding.amount)} mm apart: {why}"


def _within(finding: Finding) -> str:
    if not finding.time:
        return ""
    return f" within {short(1e3 * finding.amount)} mm and {finding.time:.2f} s"


def _lopsided(finding: Finding) -> str:
    finger, item = finding.parts or ("a finger", "something")
    return (
        f"{part(finger)} is {short(1e3 * finding.amount)} mm from {part(item)}, which the other "
        "touches: open the gripper, centre it on the object, close it again"
    )


def _in_hand(finding: Finding, fingers: str, cup: str) -> str:
    """Return the text of ``fingers`` or a ``cup``, with an object, its load and the limit."""
    item, numbers = (finding.parts or ("the object",))[0], (finding.amount, finding.limit)
    return (cup if finding.limit else fingers).format(part(item), *map(short, numbers))


REASONS: dict[Reason, Callable[[Finding], str]] = {
    Reason.STOPPED: lambda f: f"stopped{_within(f)}: press Clear stop, then give a new target",
    Reason.PAUSED: lambda _: "press Resume to continue",
    Reason.CONTACT: _contact,
    Reason.ACROSS_GAP: lambda f: (
        f"{axis(f.axis)} would have to leap {short(math.degrees(f.amount))}° to follow: "
        "drag along another path, or choose the pose under Branches"
    ),
    Reason.OUT_OF_REACH: lambda f: f"{short(1e3 * f.amount)} mm out of reach",
    Reason.POSITION_CHANGED: lambda f: f"position gives way by {short(1e3 * f.amount)} mm",
    Reason.AXIS_1: lambda _: (
        "axis 1 is in the way: drag around it, or choose another pose under Branches"
    ),
    Reason.LINKS: lambda _: "its links reach no farther that way",
    Reason.SINGULAR: lambda _: (
        "no joint moves the tool in that direction from here: move in another direction first"
    ),
    Reason.ELBOW_END: lambda _: (
        "the elbow turns no farther while the tool rests: move the tool first"
    ),
    Reason.AXIS_LIMIT: lambda f: f"{axis(f.axis)} at its limit of {degrees(f.amount, 2)}",
    Reason.SLIDE_LIMIT: lambda f: f"{axis(f.axis)} at its limit of {millimetres(f.amount)}",
    Reason.GRIPPER_LIMIT: lambda f: f"the gripper at its limit of {degrees(f.amount)}",
    Reason.GRIPPER_SLIDE_LIMIT: lambda f: f"the gripper at its limit of {millimetres(f.amount)}",
    Reason.YAW_FIXED: lambda f: (
        f"wrist yaw is fixed by position: {short(math.degrees(f.amount))}° off"
    ),
    Reason.PITCH_CHANGED: lambda f: f"pitch gives way by {short(math.degrees(f.amount))}°",
    Reason.ROLL_CHANGED: lambda f: f"roll stops {short(math.degrees(f.amount))}° short",
    Reason.ORIENTATION_CHANGED: lambda f: (
        f"orientation gives way by {short(math.degrees(f.amount))}°"
    ),
    Reason.LOPSIDED: _lopsided,
    Reason.LEAKING: lambda f: (
        "{} leaks on {}: its rim is ".format(*map(part, f.parts or ("the cup", "the object")))
        + f"{short(1e3 * f.amount)} mm from a flat face; switch it off, and set it on a flat face"
    ),
    Reason.SLIDING: lambda f: _in_hand(
        f,
        "{} slides in the fingers under a load of {} N: grip it with more force, or move more "
        "slowly",
        "{} slides on the suction cup under a load of {} N, and at most {} N are held: move more "
        "slowly, or tilt it less",
    ),
    Reason.SLIPPED: lambda f: _in_hand(
        f,
        "{} slipped out of the fingers under a load of {} N: open the gripper, then grip it with "
        "more force",
        "{} came off the suction cup under a load of {} N, and at most {} N are held: take it at "
        "its middle, or move more slowly",
    ),
    Reason.CRUSHED: lambda f: (
        f"{part((f.parts or ('the object',))[0])} was crushed: {short(f.amount)} N, and it bears "
        f"{short(f.limit)} N; grip it with less force"
    ),
    Reason.SLOW_ZONE: lambda f: (
        "{} is in or near the zone {}: the tool moves with at most ".format(
            *map(part, f.parts or ("a part", "of reduced speed"))
        )
        + f"{short(1e3 * f.amount)} mm/s"
    ),
    Reason.NOT_AT_START: lambda f: (
        f"the plan begins at another posture: {axis(f.axis)} is "
        f"{short(math.degrees(f.amount))}° off, or the arm still moves; go to its start first"
    ),
    Reason.INTERNAL: lambda _: "internal error: the arm holds; see the server's log",
    Reason.RESTARTED: lambda _: "the arm's process was started again; see the server's log",
    Reason.WAITING: lambda _: "paused: the next command moves the arm",
    Reason.DRIVER_SILENT: lambda f: (
        f"the driver fell silent: the newest message is {f.amount:.2f} s old"
    ),
    Reason.DRIVER_LEFT: lambda _: "the driver's window was closed",
    Reason.SERVER_SILENT: lambda f: (
        f"the page's server was silent for {f.amount:.2f} s: it hangs, or this machine is too busy"
    ),
    Reason.LOOP_LATE: lambda f: (
        f"the control loop was {f.amount:.2f} s late: this machine is too busy"
    ),
    Reason.MACHINE_BUSY: lambda f: (
        f"the server was {f.amount:.2f} s late: this machine is too busy"
    ),
    Reason.NOT_FOLLOWING: lambda _: "the arm does not follow its setpoints",
    Reason.ARM_SILENT: lambda f: (
        f"the arm sent no measurement for {f.amount:.2f} s and may still move"
    ),
    Reason.TRACKING_ERROR: lambda f: (
        f"{axis(f.axis)} is {degrees(f.amount)} from where it should be: look for what holds it"
    ),
    Reason.MEASURED_CONTACT: lambda f: "{} and {} touch, as measured".format(
        *map(part, f.parts or ("a link", "another"))
    ),
    Reason.MEASURED_STOP: lambda f: (
        f"the arm came to rest after {f.time:.2f} s and {degrees(f.amount)}, as measured"
    ),
}

STATUS: dict[Status, str] = {
    Status.OK: "On target",
    Status.LIMITED: "As near as it can",
    Status.GAP: "Held at the edge",
    Status.BLOCKED: "Contact ahead",
    Status.PAUSED: "Paused",
    Status.STOPPED: "Stopped",
    Status.FAULT: "Fault",
}

# What comes first is named first. Longer texts are cut in the panel.
PRIORITIES: dict[Priority, str] = {
    Priority.POSE: "Position, orientation",
    Priority.PITCH: "Pitch, position",
    Priority.POSITION: "Position, pitch",
}

PRIORITY_HINTS: dict[Priority, str] = {
    Priority.POSE: "The tool point goes to the target, with the nearest orientation it can have.",
    Priority.PITCH: "The tool keeps the pitch of the target, and stops where it cannot.",
    Priority.POSITION: "The tool point goes to the target, with the nearest pitch it can have.",
}

MOVING = "Moving to the target"

UNDER_WAY: dict[Status, str] = {
    Status.OK: MOVING,
    Status.LIMITED: "Moving as near as it can",
    Status.GAP: "Moving to the edge",
    Status.PAUSED: "Pausing…",
    Status.STOPPED: "Stopping…",
}
"""Headlines of an arm that still moves, where they differ from ``STATUS``."""

ABOUT_NOW = (
    *CAUSES,
    Reason.STOPPED,
    Reason.PAUSED,
    Reason.WAITING,
    Reason.CONTACT,
    Reason.LOPSIDED,
    Reason.LEAKING,
    Reason.SLIPPED,
    Reason.CRUSHED,
    Reason.SLOW_ZONE,
    Reason.INTERNAL,
)
"""Reasons whose numbers are present ones. Those of all others belong to the goal."""


def mood(state: State) -> str:
    """Return the class name for ``state`` in the style sheets."""
    moves = state.moving and state.status is Status.OK
    return "moving" if moves else state.status.value


def title(robot: str) -> str:
    """Return the title of the page for the robot of this name."""
    words = robot.replace("_", " ").strip()
    return words[:1].upper() + words[1:]


def headline(state: State) -> str:
    """Return the state of the arm in two to four words."""
    if state.moving:
        return UNDER_WAY.get(state.status, STATUS[state.status])
    return STATUS[state.status]


def sentence(state: State) -> str:
    """Return one sentence on why the arm does not reach its target; empty if it does.

    While the arm moves, reasons that concern its goal begin with "At the goal".
    """
    if not state.findings:
        return ""
    # A pause by a person lasts, also if the server has paused the arm besides.
    findings = [f for f in state.findings if not (state.paused and f.reason is Reason.WAITING)]
    now = [_reason(state, finding) for finding in findings if finding.reason in ABOUT_NOW]
    goal = [_reason(state, finding) for finding in findings if finding.reason not in ABOUT_NOW]
    if goal and state.moving:
        goal[0] = f"at the goal: {goal[0]}"
    return _capital("; ".join((*now, *goal))) + "."


def _reason(state: State, finding: Finding) -> str:
    """Return the text of one finding of ``state``."""
    if finding.reason is Reason.NOT_FOLLOWING and state.report is not None and state.report.note:
        return state.report.note.removesuffix(".")
    return REASONS[finding.reason](finding)


def overlap_text(link: str, name: str, distance: float) -> str:
    """Return a sentence on a link that stands ``-distance`` [m] deep in the object ``name``."""
    return f"{name} overlaps the {part(link)} by {short(-1e3 * distance)} mm: move it, or undo."


def finding_text(finding: Finding) -> str:
    """Return the text of one finding."""
    return _capital(REASONS[finding.reason](finding))


def limit_text(number: int, name: str, angle: float) -> str:
    """Return in words how far, ``angle`` [rad], a joint is from its nearer limit.

    ``number`` counts from 0.
    """
    return f"{axis_label(number + 1, name)}: {degrees(angle)} left"


def excluded(branch: object, axes: Sequence[int]) -> str:
    """Return the reason why the arm cannot take ``branch``: the limits of ``axes``, from 0."""
    *most, last = [str(axis + 1) for axis in axes]
    which = f"axes {', '.join(most)} and {last}" if most else f"axis {last}"
    return (
        f"The limits of {which} exclude the branch {branch} for this target: choose another one, "
        "or move the target"
    )


def _capital(text: str) -> str:
    return text[0].upper() + text[1:]


def short(value: float) -> str:
    """Return ``value`` with enough digits to act on: no decimal from 10 up, one below."""
    return f"{value:.0f}" if value >= 10.0 else f"{value:.1f}"

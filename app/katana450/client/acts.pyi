# Written by `python -m docs.stubs` from the classes of the requests.
from typing import Any, Generic, Literal, TypeVar

import msgspec
import numpy.typing as npt

from katana450.arm.control.commands.act import Request
from katana450.arm.control.commands.tool_commands import Frame
from katana450.arm.control.state.arm_report import ArmAct
from katana450.arm.control.state.scene_objects import Attachment, Shape, Zone
from katana450.maths.kinematics.priority import Priority
from katana450.maths.kinematics.velocity import JogFrame
from katana450.server.api.episode_requests import EpisodeRequest
from katana450.server.api.requests import FieldName, FieldSetting

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
    def joint(self, axis: int, value: float) -> AtRest:
        """Move one joint to a value.

        Args:
            axis: Number of the joint, counted from 1.
            value: Target [rad]; [m] for a joint that slides.
        """

    def nudge(self, axis: int, by: float) -> AtRest:
        """Move one joint by a relative angle, counted from its goal. Nudges in a row add up.

        The new goal is limited to the range of the joint.

        Args:
            axis: Number of the joint, counted from 1.
            by: Change of the goal [rad]; [m] for a joint that slides.
        """

    def joints(self, q: npt.ArrayLike) -> AtRest:
        """Move all joints along a straight line in joint space; they arrive together.

        Args:
            q: (n,) Targets [rad]; [m] for joints that slide.
        """

    def servo(
        self,
        q: npt.ArrayLike,
        qd: npt.ArrayLike | None = ...,
        gripper: float | None = ...,
    ) -> Sent:
        """Follow one sample of a stream of joint angles.

        The motion keeps the limits of speed, acceleration and jerk. The arm comes to rest when no
        other sample arrives for 0.2 s.

        Args:
            q: (n,) Joint angles [rad]; [m] for joints that slide.
            qd: (n,) Rates of ``q``. Without them the rates are estimated from the stream, which is less
                exact.
            gripper: Target of the finger joint [rad], or [m] if it slides; it stays without.
        """

    def gripper(self, angle: float) -> AtRest:
        """Move the fingers.

        Args:
            angle: Target of the finger joint [rad]; [m] for fingers that slide. The answer ``arm`` has
                its range.
        """

    def home(self) -> AtRest:
        """Move to the ready posture."""

    def go_to_zero(self) -> AtRest:
        """Move to the zero posture, in which the arm is stretched along x."""

    def branch(self, name: str) -> AtRest:
        """Move to the target pose on another branch: with another shoulder or elbow.

        Args:
            name: Name of the branch; the answer ``branches`` has it.
        """

    def hold(self) -> AtRest:
        """Come to rest and drop the target."""

    def pause(self) -> Answered:
        """Come to rest on the path and keep the target.

        The requests ``pause``, ``resume`` and ``speed`` also act on a running program. Only its owner
        may send them then: the page or API program that started it. A program that is being planned
        starts paused.
        """

    def resume(self) -> AtRest:
        """Resume the motion after a pause."""

    def speed(self, value: float) -> Answered:
        """Set the maximum speed of every joint and of the tool.

        Args:
            value: Fraction of full speed.
        """

    def operate_arm(self, act: ArmAct, confirmed: bool = ...) -> Answered:
        """Connect, calibrate or switch the motors of a real arm. It must be stopped and at rest.

        The state lists the acts that are possible; its ``arm.mode`` tells what becomes of an act.

        Args:
            act: connect; disconnect; calibrate: the arm moves to its mechanical stops; engage: the
                motors hold the arm, which was calibrated before; release: motors off, the arm falls;
                unblock: hold again after a collision or an error.
            confirmed: Whether a person has confirmed the hazard. Without it, an act that has one is
                refused with the text of the hazard.
        """

    def fill(self, ml: float) -> Answered:
        """Fill the cup with water, and remove all water elsewhere.

        Args:
            ml: Volume in the cup [ml].
        """

    def remove(self, name: str) -> Answered:
        """Remove an object; a held object stays.

        Args:
            name: Name of the object.
        """

    def attach(self, name: str, to: Attachment, T: npt.ArrayLike | None = ...) -> Answered:
        """Fix an object to the hand, for example a camera or a tool, or release it to the world.

        Args:
            name: Name of the object.
            to: Body to which the object is fixed.
            T: (4, 4) Pose on the hand, in the frame of the arm's default tool. Without it the object
                stays where it is.
        """

    def position(self, p: npt.ArrayLike, frame: Frame = ...) -> AtRest:
        """Move the tool point to a position; the orientation of the target is kept.

        Args:
            p: (3,) Position [m] in ``frame``.
            frame: Frame of ``p``: {S} at the shoulder, or the base frame on the table.
        """

    def pose(self, T: npt.ArrayLike, frame: Frame = ...) -> AtRest:
        """Move the tool to a pose, or as near to it as the arm can.

        The priority (``set_priority``) decides which part of the pose is kept.

        Args:
            T: (4, 4) Pose of the tool in ``frame``, translations in m.
            frame: Frame of ``T``: {S} at the shoulder, or the base frame on the table.
        """

    def turn(self, pitch: float, roll: float) -> AtRest:
        """Turn the tool of a five-axis arm to a pitch and a roll; its target position is kept.

        These are the two rotations that a five-axis arm is free to choose.

        Args:
            pitch: Angle of the tool below the horizontal [rad], positive downwards.
            roll: Angle about the tool's own axis [rad].
        """

    def orient(self, R: npt.ArrayLike, frame: Frame = ...) -> AtRest:
        """Turn the tool of an arm outside the five-axis family; its target position is kept.

        Args:
            R: (3, 3) Rotation of the tool in ``frame``.
            frame: Frame of ``R``: {S} at the shoulder, or the base frame on the table.
        """

    def step_tool(self, by: npt.ArrayLike, frame: JogFrame = ...) -> AtRest:
        """Move the target of the tool by one step. Steps in a row add up.

        Where the target cannot be reached, the nearest pose becomes the target.

        Args:
            by: (5,) Step of the tool point (x, y, z) [m], then of pitch and roll [rad]. (6,) for arms
                outside the five-axis family: a rotation vector [rad] follows.
            frame: Frame along whose axes the tool point moves, `"base"` or `"tool"`; with six numbers
                it also turns about them.
        """

    def jog(self, rates: npt.ArrayLike, frame: JogFrame = ...) -> Sent:
        """Move the tool at given rates for 0.2 s. Repeat the request to continue the motion.

        A client sends it repeatedly while a key, pad or stick is held.

        Args:
            rates: (5,) Velocity of the tool point (x, y, z) [m/s], then rates of pitch and roll
                [rad/s]. (6,) for arms outside the five-axis family: the rates of the rotations about x,
                y and z follow. (7,) for arms with an arm angle: its rate follows. It moves the elbow.
            frame: Frame along whose axes the tool point moves, `"base"` or `"tool"`; with six rates it
                also turns about them.
        """

    def turn_elbow(self, by: float) -> AtRest:
        """Turn the arm angle: the elbow moves about the line from shoulder to wrist, the tool rests.

        Turns in a row add up. A turn ends early at a limit of a joint, and before a contact. Only arms
        with seven turning axes have an arm angle.

        Args:
            by: Change of the arm angle [rad], counted from where the elbow is.
        """

    def end_drag(self) -> AtRest:
        """End a drag: the nearest pose that the arm can reach becomes the target."""

    def tool(self, name: str) -> Answered:
        """Choose the tool frame to which targets and read-outs refer. Nothing moves.

        Args:
            name: Name of the tool frame; the answer ``arm`` lists them.
        """

    def set_priority(self, priority: Priority) -> Answered:
        """Choose which part of a target is kept when the arm cannot satisfy all of it.

        A present target of the tool is projected again.

        Args:
            priority: The part that is kept first.
        """

    def undo(self) -> AtRest:
        """Undo the last change of a goal, an object or a setting by this client.

        To undo a goal, the arm moves back to the earlier one. Refused while the arm is stopped, and
        without a change since the last stop or change of driver.
        """

    def redo(self) -> AtRest:
        """Repeat the change by this client that was undone last, if no other change followed."""

    def acquire(self) -> Answered:
        """Acquire the lease if it is free. A command does this by itself while the lease is free."""

    def take(self) -> Answered:
        """Take the lease from its holder. For admins only."""

    def withdraw(self) -> Answered:
        """Withdraw your own request for the lease."""

    def release_lease(self) -> Answered:
        """Release the lease, so that others can acquire it."""

    def give(self, to: int) -> Answered:
        """Hand the lease over to another page or program.

        The holder may do this, and the owner of the running program, which ends the program.

        Args:
            to: Number of the page or program.
        """

    def decline(self, to: int) -> Answered:
        """Decline the request of another page or program for the lease.

        The holder may do this, and the owner of the running program.

        Args:
            to: Number of the page or program.
        """

    def rename(self, name: str) -> Answered:
        """Choose the name that others see. Refused if it is empty, too long or taken.

        Args:
            name: Name, of at most 24 characters. That of an access link cannot be changed.
        """

    def place(
        self,
        name: str,
        T: npt.ArrayLike | None = ...,
        near: tuple[float, float] | None = ...,
        frame: Frame = ...,
        shape: Shape | None = ...,
        size: list[float] | None = ...,
        mesh: str | None = ...,
        can_be_held: bool | None = ...,
        zone: Zone | None = ...,
        scale: float | None = ...,
        colour: str | None = ...,
        opacity: float | None = ...,
        hidden: bool | None = ...,
    ) -> Answered:
        """Create an object, or change one. Fields that are not given keep their values.

        Args:
            name: Name of the object.
            T: (4, 4) Pose in ``frame``; the object's own frame is in the middle of its underside. A new
                object without ``T`` is placed where there is room in front of the arm. An object that
                can be held, vessels and the basin are refused where nothing carries them: they stand
                on the table or on another object.
            near: (2,) Point of the table [m] in the base frame. A new object without ``T`` is placed
                there or near it, where there is room beside other objects and the arm in its ready
                posture.
            frame: Frame of ``T``: {S} at the shoulder, or the base frame on the table.
            shape: Shape that is checked for contacts.
            size: Size of the shape [m]: box (x, y, z), cylinder and vessel (radius, height), sphere
                (radius), plane (x, y; only drawn, it has no end). A mesh has that of its file.
            mesh: Key of the mesh, from the answer to its upload.
            can_be_held: Whether the fingers may touch the object; they hold it between both sides.
            zone: Rule for the arm in a space that all else passes through: the arm and what it carries
                keep out, or its tool moves at most at 250 mm/s. "none" for a body.
            scale: Factor on the size.
            colour: Colour such as "#94a3b8", or "own" for the colour of the file.
            opacity: Opacity, 1 for an opaque object.
            hidden: Whether the object is not drawn. It is checked for contacts nevertheless.
        """

    def load(self, scene: str) -> Answered:
        """Replace all objects and the water by those of an uploaded scene. The arm does not move.

        Args:
            scene: Key of the scene, from the answer to its upload.
        """

    def set(
        self,
        node: str,
        field: str,
        value: list[float],
        more: tuple[FieldSetting, ...] = ...,
    ) -> AtRest:
        """Set fields of the VRML world by the DEF names of their nodes, as VR Sink does.

        If one field cannot be set, none is. The names are those of `katana450 export vrml`; ``query``
        with ``world`` lists them. A ``rotation`` of a joint does not place the joint: it is a command
        to move there, under the rules of ``joints``.

        Args:
            node: DEF name of the node.
            field: Name of the field.
            value: New value.
            more: Further fields to set at the same time.
        """

    def get(self, node: str, field: str, more: tuple[FieldName, ...] = ...) -> Answered:
        """Read fields of the VRML world by the DEF names of their nodes, as VR Source does.

        Args:
            node: DEF name of the node.
            field: Name of the field.
            more: Further fields to read at the same time.
        """

class EpisodeActs:
    def start(self, task: str | None = ...) -> int:
        """Begin an episode.

        Args:
            task: What is to be done; None for that of the last episode.
        """

    def stop(
        self,
        outcome: Literal["unjudged", "success", "failure"] = ...,
        number: int | None = ...,
    ) -> int:
        """End the episode that runs, and keep it in its file.

        Args:
            outcome: Its outcome, if it is known already.
            number: The episode; another one that runs is not ended. None for any.
        """

    def judge(
        self,
        outcome: Literal["unjudged", "success", "failure"],
        number: int | None = ...,
    ) -> int:
        """Judge an episode. One that runs is ended first.

        Args:
            outcome: The outcome.
            number: The episode; None for the one that runs, or else the last one.
        """

    def discard(self, number: int | None = ...) -> int:
        """Move an episode to the discarded ones. One that runs is ended first.

        Args:
            number: The episode; None for the one that runs, or else the last one.
        """

    def restore(self, number: int) -> int:
        """Bring a discarded episode back.

        Args:
            number: The episode.
        """

    def rerecord(self, number: int | None = ...) -> int:
        """Discard an episode, and begin another one with the same task.

        Args:
            number: The old episode; None for the one that runs, or else the last one. One that runs is
                ended first.
        """

    def keep(
        self,
        start: float,
        end: float,
        outcome: Literal["unjudged", "success", "failure"] = ...,
        task: str | None = ...,
    ) -> int:
        """Keep a part of the last minutes, as a correction after a failure, as an episode.

        Args:
            start: Its first moment, as the timeline counts [s since the epoch].
            end: Its last moment [s since the epoch].
            outcome: Its outcome.
            task: What was done; None for that of the last episode.
        """

    def describe(self, number: int, task: str | None = ..., note: str | None = ...) -> int:
        """Change the texts of an episode.

        Args:
            number: The episode.
            task: The new task; None to keep it.
            note: The new remarks; None to keep them.
        """

    def describe_attempt(
        self,
        t: float,
        name: str = ...,
        outcome: Literal["unjudged", "success", "failure"] = ...,
        hidden: bool = ...,
    ) -> int:
        """Name or judge an attempt of the last minutes, or take it out of the list.

        Args:
            t: A moment of the attempt, as the timeline counts [s since the epoch].
            name: Its name; empty for none.
            outcome: Its outcome.
            hidden: Whether lists leave it out. Nothing is deleted.
        """

    def trim(self, number: int, start: float, end: float) -> int:
        """Give an episode another start and end. Nothing is deleted, so it can be widened again.

        Args:
            number: The episode.
            start: First moment, in seconds after the start of its file.
            end: Last moment, in seconds after the start of its file.
        """

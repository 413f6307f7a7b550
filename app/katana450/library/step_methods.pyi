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
    def arc(
        self,
        centre: Sequence[Any] | npt.NDArray[Any] | Mapping[str, Any] | str,
        axis: Sequence[Any] | npt.NDArray[Any] | Mapping[str, Any] | str,
        angle: float | str,
        *,
        pitch: float | str | None = ...,
        roll: float | str | None = ...,
        yaw: float | str | None = ...,
        feed: float | str | None = ...,
        climb: float | str | None = ...,
    ) -> None:
        """Move the tool point round an axis from its present place.

        Args:
            centre: A point, mm: {x, y, z}, [x, y, z], or the name of a pose.
            axis: A direction: x, -y and so on, or three numbers.
            angle: deg, or a text such as 0.5 rad.
            pitch: Pitch of the tool, deg; roomiest is farthest from the limits.
            roll: deg, or a text such as 0.5 rad.
            yaw: deg, or a text such as 0.5 rad.
            feed: Speed of the tool point, mm/s; slower where limits require it.
            climb: Motion along the axis, mm.
        """

    def circle(
        self,
        centre: Sequence[Any] | npt.NDArray[Any] | Mapping[str, Any] | str,
        normal: Sequence[Any] | npt.NDArray[Any] | Mapping[str, Any] | str,
        radius: float | str,
        *,
        pitch: float | str | None = ...,
        roll: float | str | None = ...,
        yaw: float | str | None = ...,
        feed: float | str | None = ...,
        turns: float | str | None = ...,
        branch: str | None = ...,
    ) -> None:
        """Move to the highest point of a circle, then round it.

        Args:
            centre: A point, mm: {x, y, z}, [x, y, z], or the name of a pose.
            normal: A direction: x, -y and so on, or three numbers.
            radius: mm.
            pitch: Pitch of the tool, deg; roomiest is farthest from the limits.
            roll: deg, or a text such as 0.5 rad.
            yaw: deg, or a text such as 0.5 rad.
            feed: Speed of the tool point, mm/s; slower where limits require it.
            turns: Number of turns, 1 unless given.
            branch: Branch of the arm.
        """

    def fill(self, water: float | str) -> None:
        """Fill the cup with water, ml.

        Args:
            water: ml.
        """

    def grasp(
        self,
        object: str,
        *,
        side: str | None = ...,
        pitch: float | str | None = ...,
        height: float | str | None = ...,
    ) -> None:
        """Open, approach an object, and close the fingers on it.

        Args:
            object: Name of an object.
            side: Side of the tool; found unless given.
            pitch: Pitch of the tool, deg; found unless given.
            height: Height above the underside, mm; found unless given.
        """

    def gripper(self, to: float | str, *, holding: str | None = ...) -> None:
        """Open or close the fingers, or move them to an angle, deg, or a place, mm, if they slide.

        Args:
            to: open, closed, or the angle of the fingers, deg; mm if they slide.
            holding: Name of an object.
        """

    def home(self) -> None:
        """Move to the ready posture."""

    def joints(self, q: Sequence[Any] | npt.NDArray[Any] | str) -> None:
        """Move to these angles of the joints, deg, round obstacles.

        Args:
            q: Angles of all joints, deg.
        """

    def line(
        self,
        to: Sequence[Any] | npt.NDArray[Any] | Mapping[str, Any] | str | None = ...,
        *,
        by: Sequence[Any] | npt.NDArray[Any] | Mapping[str, Any] | str | None = ...,
        pitch: float | str | None = ...,
        roll: float | str | None = ...,
        yaw: float | str | None = ...,
        feed: float | str | None = ...,
    ) -> None:
        """Move the tool point on a straight line, to a point or by an offset.

        Args:
            to: A point, mm: {x, y, z}, [x, y, z], or the name of a pose.
            by: Motion of the tool point, mm; what is absent is 0.
            pitch: Pitch of the tool, deg: 0 is level, 90 points down.
            roll: Roll of the tool about its own axis, deg.
            yaw: Yaw of the tool, deg, of arms with six or more axes.
            feed: Speed of the tool point, mm/s; slower where limits require it.
        """

    def lines(
        self,
        through: Sequence[Any] | npt.NDArray[Any] | str,
        *,
        blend: float | str | None = ...,
        feed: float | str | None = ...,
    ) -> None:
        """Move the tool point on straight lines through places, with rounded corners.

        Args:
            through: Places in their order.
            blend: Fraction of half a leg that a corner cuts off; 0 rests in each corner.
            feed: Speed of the tool point, mm/s; slower where limits require it.
        """

    def nudge(self, axis: float | str, by: float | str) -> None:
        """Turn one joint by an angle.

        Args:
            axis: Number of the joint, from 1.
            by: deg, or a text such as 0.5 rad.
        """

    def pick(
        self,
        object: str,
        *,
        side: str | None = ...,
        pitch: float | str | None = ...,
        height: float | str | None = ...,
    ) -> None:
        """Grasp an object, and lift it.

        Args:
            object: Name of an object.
            side: Side of the tool; found unless given.
            pitch: Pitch of the tool, deg; found unless given.
            height: Height above the underside, mm; found unless given.
        """

    def place(
        self,
        at: str | Sequence[Any] | npt.NDArray[Any] | Mapping[str, Any] | None = ...,
        *,
        on: str | None = ...,
    ) -> None:
        """Put the held object down, and draw back.

        Args:
            at: Its place: the name of a pose, [x, y, z], or x, y and, if wanted, z, yaw.
            on: Object that carries it; its middle without `at`.
        """

    def pour(
        self,
        into: str,
        *,
        ml: float | str | None = ...,
        shake: float | str | None = ...,
    ) -> None:
        """Carry a held vessel over an object, turn it over, shake it, and turn it back.

        Args:
            into: Name of an object.
            ml: How much to pour, ml; all unless given.
            shake: Number of shakes after all is poured, 3 unless given.
        """

    def put(self, object: str, x: float | str, y: float | str) -> None:
        """Set an object to another place on the table, without the arm.

        Args:
            object: Name of an object.
            x: mm, or a text such as 4 cm or 2 * radius.
            y: mm, or a text such as 4 cm or 2 * radius.
        """

    def release(self) -> None:
        """Open the fingers on the held object where it is, and draw back."""

    def set_down(self) -> None:
        """Put the held object back to where it was grasped, and draw back."""

    def speed(self, value: float | str) -> None:
        """Fraction of full speed of all later motions.

        Args:
            value: .
        """

    def stack(
        self,
        object: str,
        on: str,
        *,
        side: str | None = ...,
        pitch: float | str | None = ...,
        height: float | str | None = ...,
    ) -> None:
        """Pick an object, and place it on the middle of another.

        Args:
            object: Name of an object.
            on: Name of an object.
            side: Side of the tool; found unless given.
            pitch: Pitch of the tool, deg; found unless given.
            height: Height above the underside, mm; found unless given.
        """

    def tool(self, name: str) -> None:
        """Tool frame of all later points: tcp, grasp or flange.

        Args:
            name: A text.
        """

    def trajectory(self, through: Sequence[Any] | npt.NDArray[Any]) -> None:
        """Move through postures at given times, on a smooth path, slower where limits require it.

        Args:
            through: Rows of a time, s, and all angles, deg.
        """

    def turn_elbow(self, by: float | str) -> None:
        """Turn the elbow of seven axes about the line from shoulder to wrist; the tool rests.

        Args:
            by: deg, or a text such as 0.5 rad.
        """

    def via(
        self,
        through: Sequence[Any] | npt.NDArray[Any] | str,
        *,
        blend: float | str | None = ...,
    ) -> None:
        """Move the joints through places, with rounded corners.

        Args:
            through: Places in their order.
            blend: Fraction of half a leg that a corner cuts off; 0 rests in each corner.
        """

    def wait(self, seconds: float | str) -> None:
        """Wait, s.

        Args:
            seconds: s.
        """

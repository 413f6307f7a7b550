"""``katana450 fk`` and ``katana450 ik``: one JSON object per line in, one per line out."""

from __future__ import annotations

import io
import json
import math
import sys
from argparse import Namespace
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any, NamedTuple, TypeVar

import msgspec
import numpy as np

from katana450.assembly.robot_files import read_robot
from katana450.errors import InputError
from katana450.extensions.general_arms.choice import kinematics_of
from katana450.extensions.general_arms.driven_tool import solved_arm
from katana450.extensions.general_arms.nearest import NearestPose, nearest_pose
from katana450.maths.geometry import se3, so3
from katana450.maths.geometry.arrays import FloatArray, finite_array
from katana450.maths.kinematics.arm import family_arm
from katana450.maths.kinematics.branch import BRANCHES
from katana450.maths.kinematics.chain import Chain
from katana450.maths.kinematics.forward import forward
from katana450.maths.kinematics.pose import check_metres, check_radians, quaternion_misfit
from katana450.maths.kinematics.projection import project
from katana450.maths.kinematics.tool import ToolTarget

Numbers = TypeVar("Numbers")

MAX_SHOWN_CHARACTERS = 40
"""Maximum number of characters of a wrong value that an error message repeats."""


def numbers(request: Mapping[str, Any], key: str, kind: type[Numbers]) -> Numbers:
    """Return the value of ``key``, which is of JSON numbers in the shape of ``kind``.

    Raises InputError with the place of a value that is not a number. The caller checks lengths.
    """
    if key not in request:
        raise InputError(f"The key {key!r} is missing.")
    try:
        return msgspec.convert(request[key], kind)
    except (msgspec.ValidationError, OverflowError) as error:
        raise InputError(f"{key} is not of plain finite numbers: {error}.") from error


def shown(value: Any) -> str:
    """Return ``value`` as JSON shows it, shortened."""
    if isinstance(value, dict | list):
        return "an object" if isinstance(value, dict) else "a list"
    text = json.dumps(value)
    return text if len(text) <= MAX_SHOWN_CHARACTERS else f"{text[:MAX_SHOWN_CHARACTERS]}..."


QUATERNIONS = {"wxyz": (0, 1, 2, 3), "xyzw": (3, 0, 1, 2)}
"""Keys of quaternions, and the places of w, x, y and z in them."""

KEYS = frozenset({"T", "p", "rpy", "pitch", "roll", *QUATERNIONS})
"""The keys that describe a pose."""


class RequestedPose(NamedTuple):
    """The pose ``T`` (4, 4) of the tool in {S} [m], and how far its numbers are from a rotation."""

    T: FloatArray
    misfit: float


def requested_pose(
    request: Mapping[str, Any], chain: Chain, T_frame_shoulder: FloatArray
) -> RequestedPose:
    """Return the pose in ``request``, whose numbers are in the frame of ``T_frame_shoulder``.

    The forms are ``T``, or ``p`` with ``wxyz``, ``xyzw``, ``rpy`` or with ``pitch`` and ``roll``.
    Pitch and roll are those of the arm's plane, so they have no yaw: of the planes of both
    shoulders the one that comes nearer is taken. Raises InputError with the key at fault, also for
    numbers that seem to be millimetres or degrees.
    """
    pose = _requested(request, chain, T_frame_shoulder)
    check_metres(chain, pose.T[:3, 3].tolist())
    return pose


def _requested(
    request: Mapping[str, Any], chain: Chain, T_frame_shoulder: FloatArray
) -> RequestedPose:
    orientation = [key for key in ("T", *QUATERNIONS, "rpy", "pitch", "roll") if key in request]
    if orientation == ["T"] and "p" not in request:
        rows = numbers(request, "T", list[list[float]])
        pose = se3.validated(rows, "T")
        misfit = so3.misfit(np.array(rows)[:3, :3])
        return RequestedPose(se3.inverse(T_frame_shoulder) @ pose, misfit)
    if not orientation and "p" not in request:
        raise InputError("The key 'T' is missing, or 'p' with an orientation.")
    if orientation not in (["wxyz"], ["xyzw"], ["rpy"], ["pitch", "roll"]) or "p" not in request:
        raise InputError(
            "A pose is T, or p with one orientation: wxyz, xyzw, rpy, or both pitch and roll; "
            f"this has {', '.join(sorted(KEYS & set(request)))}."
        )
    p = finite_array(numbers(request, "p", list[float]), (3,), "p")
    if orientation == ["pitch", "roll"]:
        angles = [numbers(request, key, float) for key in orientation]
        pitch, roll = finite_array(angles, (2,), "pitch and roll").tolist()
        check_radians((pitch, roll), "The pose")
        position = (se3.inverse(T_frame_shoulder) @ np.append(p, 1.0))[:3]
        target = ToolTarget(position, pitch, roll)
        poses = [target.pose(chain, target.facing(chain, branch, 0.0)) for branch in BRANCHES[::2]]
        return RequestedPose(min(poses, key=lambda T: _misses(chain, T)), 0.0)
    R, misfit = _rotation(request, orientation[0])
    T = se3.from_rotation_translation(R, p)
    return RequestedPose(se3.inverse(T_frame_shoulder) @ T, misfit)


def _misses(chain: Chain, T: FloatArray) -> tuple[float, float]:
    """Return how far [m], [rad] the arm is from ``T`` (4, 4) without limits, rounded to compare."""
    nearest = project(chain, T, within_limits=False)
    return round(nearest.position_error, 9), round(nearest.rotation_error, 9)


def _rotation(request: Mapping[str, Any], key: str) -> tuple[FloatArray, float]:
    """Return the rotation (3, 3) of ``key``, and the deviation of a quaternion from length 1."""
    if key == "rpy":
        roll, pitch, yaw = finite_array(numbers(request, key, list[float]), (3,), key).tolist()
        check_radians((roll, pitch, yaw), key)
        return so3.from_rpy(roll, pitch, yaw), 0.0
    q = finite_array(numbers(request, key, list[float]), (4,), key)
    return so3.from_quaternion(q[list(QUATERNIONS[key])]), quaternion_misfit(q, key)


Answer = Callable[[Mapping[str, Any]], dict[str, Any]]


class JsonKinematics:
    """Forward and inverse kinematics of the arm in a URDF, on plain JSON values."""

    def __init__(
        self,
        urdf: Path,
        tool: str | None,
        *,
        in_base_frame: bool,
        with_nearest: bool = False,
    ) -> None:
        """Load the arm.

        Args:
            urdf: file of the arm.
            tool: link that is its default tool; see ``load``.
            in_base_frame: whether poses are in the base frame on the table, else in {S}.
            with_nearest: whether answers include the nearest posture inside the limits.

        Raises:
            RobotDescriptionError: the file has no arm.
        """
        self._with_nearest = with_nearest
        self._arm = read_robot(urdf, tool, solved_arm).require_arm()
        self._T_frame_shoulder = self._arm.T_base_shoulder if in_base_frame else np.eye(4)
        self._is_member = family_arm(self._arm.chain) is not None

    def fk(self, request: Mapping[str, Any]) -> dict[str, Any]:
        """Answer ``{"q": [n rad], "tool"}`` with ``{"T": 4x4}`` [m]."""
        chain = self._chain(request, frozenset({"q"}))
        q = chain.check_q(numbers(request, "q", list[float]))
        return {"T": (self._T_frame_shoulder @ forward(chain, q)).tolist()}

    def ik(self, request: Mapping[str, Any]) -> dict[str, Any]:
        """Answer a pose with the solutions of all branches that take it, or the nearest pose.

        The forms of a pose are those of ``requested_pose``, with an optional ``"tool"``. A pose
        printed with four decimals or more is replaced by the nearest rotation;
        ``rotation_misfit`` is the deviation of its numbers from a rotation. ``"q"`` [n rad] decides
        what the pose leaves free.

        The residuals are the distance of the solutions from the request, without regard to joint
        limits. ``within_limits`` of each solution is True if the arm can go there, and ``singular``
        are the axes, counted from 1, that can turn together there without moving the tool.
        ``nearest`` is the best posture inside the limits, of equally good ones the nearest to
        ``"q"``, with what it loses and what keeps it from more.
        """
        # Pitch and roll are those of five axes.
        poses = KEYS if self._is_member else KEYS - {"pitch", "roll"}
        chain = self._chain(request, poses | {"q"})
        kinematics = kinematics_of(chain)
        hint = chain.check_q(numbers(request, "q", list[float])) if "q" in request else None
        T, misfit = requested_pose(request, chain, self._T_frame_shoulder)
        solutions = [candidate for candidate in kinematics.inverse(T, hint) if candidate.exact]
        if not solutions:
            best = nearest_pose(kinematics, T, q_hint=hint, within_limits=False)
            # If the axes do not cross, some branches do not reach every pose.
            solutions = [
                candidate for candidate in kinematics.inverse(best.T, best.q) if candidate.exact
            ]
        reached = [forward(chain, solution.q) for solution in solutions]
        answer = {
            "solutions": [
                {
                    "q": solution.q.tolist(),
                    "within_limits": solution.within_limits,
                    "branch": str(solution.branch),
                    "singular": [axis + 1 for axis in solution.singular],
                }
                for solution in solutions
            ],
            "residual_mm": 1e3 * max(math.dist(T[:3, 3], T_q[:3, 3]) for T_q in reached),
            "residual_rad": max(so3.angle(T[:3, :3], T_q[:3, :3]) for T_q in reached),
            "rotation_misfit": misfit,
        }
        if self._with_nearest:
            # Pitch and roll leave the yaw to the arm.
            best = nearest_pose(
                kinematics,
                T,
                q_hint=hint,
                yaw_counts="pitch" not in request,
            )
            answer["nearest"] = self._described(best)
        return answer

    @staticmethod
    def _described(best: NearestPose) -> dict[str, Any]:
        """Return the nearest posture and its losses. Axes count from 1."""
        return {
            "q": best.q.tolist(),
            "branch": str(best.branch),
            "position_mm": 1e3 * best.position_error,
            "rotation_rad": best.rotation_error,
            "limits": [axis + 1 for axis in best.limits],
            "reason": best.reason,
        }

    def _chain(self, request: Mapping[str, Any], keys: frozenset[str]) -> Chain:
        known = keys | {"tool"}
        unknown = set(request) - known
        if unknown:
            raise InputError(f"There is no key {sorted(unknown)[0]!r}; known: {sorted(known)}.")
        tool = request.get("tool", self._arm.default_tool)
        if not isinstance(tool, str):
            raise InputError(f"'tool' is {shown(tool)}; there is no tool with that name.")
        return self._arm.chain_to(tool)


def fk(options: Namespace) -> int:
    """Answer the lines of ``katana450 fk``, and return the exit status."""
    in_base = options.frame == "base"
    return answer_lines(JsonKinematics(options.urdf, options.tool, in_base_frame=in_base).fk)


def ik(options: Namespace) -> int:
    """Answer the lines of ``katana450 ik``, and return the exit status."""
    kinematics = JsonKinematics(
        options.urdf,
        options.tool,
        in_base_frame=options.frame == "base",
        with_nearest=options.nearest,
    )
    return answer_lines(kinematics.ik)


def answer_lines(answer: Answer) -> int:
    """Answer each line of the input when it arrives and return the exit status.

    A wrong line is answered by ``{"error": ...}`` with its number, counted from 1; the next lines
    are answered as usual. The status is 1 if there were requests and all were wrong, else 0.
    """
    if isinstance(sys.stdin, io.TextIOWrapper):
        # Bytes that are not UTF-8 make only their own line wrong.
        sys.stdin.reconfigure(encoding="utf-8", errors="replace")
    requested = answered = 0
    for number, line in enumerate(sys.stdin, start=1):
        if not line.strip():
            continue
        requested += 1
        try:
            reply = answer(_request(line))
            answered += 1
        except InputError as error:
            reply = {"error": f"line {number}: {error}"}
        print(json.dumps(reply, allow_nan=False), flush=True)
    return int(requested > answered == 0)


def _request(line: str) -> Mapping[str, Any]:
    if line.startswith("\ufeff"):
        raise InputError(
            "This is not JSON: it begins with a byte order mark (BOM). Save the file as UTF-8 "
            "without one."
        )
    try:
        request = json.loads(line.strip())
    except json.JSONDecodeError as error:
        raise InputError(f"This is not JSON: {error.msg} at column {error.colno}.") from error
    except ValueError as error:
        raise InputError("This is not JSON: a number in it has too many digits.") from error
    except RecursionError as error:
        raise InputError("This is not JSON: it is nested too deeply.") from error
    if not isinstance(request, dict):
        raise InputError(f"This is {shown(request)}; a request is a JSON object.")
    return request

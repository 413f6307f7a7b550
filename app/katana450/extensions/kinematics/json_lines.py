"""``katana450 fk`` and ``katana450 ik``: one JSON object per line in, one per line out."""

from __future__ import annotations

import io
import json
import sys
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any, TextIO

import numpy as np

from katana450.arm.control.findings import of_projection
from katana450.arm.control.messages import REASONS
from katana450.assembly.robot_files import read_robot
from katana450.errors import InputError
from katana450.extensions.kinematics.numbers import numbers, shown
from katana450.extensions.kinematics.pose_requests import KEYS, requested_pose
from katana450.maths.geometry import so3
from katana450.maths.geometry.arrays import FloatArray
from katana450.maths.kinematics.chain import Chain
from katana450.maths.kinematics.forward import forward
from katana450.maths.kinematics.inverse import inverse
from katana450.maths.kinematics.priority import Priority
from katana450.maths.kinematics.projection import project

Answer = Callable[[Mapping[str, Any]], dict[str, Any]]


class JsonKinematics:
    """Forward and inverse kinematics of the arm in a URDF, on plain JSON values."""

    def __init__(
        self,
        urdf: Path,
        tool: str | None,
        *,
        in_base_frame: bool,
        priority: Priority = Priority.POSE,
        with_nearest: bool = False,
    ) -> None:
        """Load the arm.

        Args:
            urdf: file of the arm.
            tool: link that is its default tool; see ``load``.
            in_base_frame: whether poses are in the base frame on the table, else in {S}.
            priority: the part of a pose that is kept when five axes cannot satisfy all of it.
            with_nearest: whether answers include the nearest posture inside the limits.
        """
        self._priority = priority
        self._with_nearest = with_nearest
        self._arm = read_robot(urdf, tool).require_arm()
        self._T_frame_shoulder = self._arm.T_base_shoulder if in_base_frame else np.eye(4)

    def fk(self, request: Mapping[str, Any]) -> dict[str, Any]:
        """Answer ``{"q": [n rad], "tool"}`` with ``{"T": 4x4}`` [m]."""
        chain = self._chain(request, {"q", "tool"})
        q = chain.check_q(numbers(request, "q", 1))
        return {"T": (self._T_frame_shoulder @ forward(chain, q)).tolist()}

    def ik(self, request: Mapping[str, Any]) -> dict[str, Any]:
        """Answer a pose with all solutions for the nearest pose of five axes.

        The forms of a pose are those of ``requested_pose``, with an optional ``"tool"``. A pose
        printed with four decimals or more is replaced by the nearest rotation;
        ``rotation_misfit`` is the deviation of its numbers from a rotation.

        The residuals are the distance of that pose from the request, without regard to joint
        limits. ``within_limits`` of each solution is True if the arm can go there. ``nearest`` is
        the best posture inside the limits, of equally good ones the nearest to ``q`` ([n rad]),
        with what it loses and what keeps it from more.
        """
        keys = {*KEYS, "tool", "q"} if self._with_nearest else {*KEYS, "tool"}
        chain = self._chain(request, keys)
        hint = chain.check_q(numbers(request, "q", 1)) if "q" in request else None
        T_shoulder, misfit = requested_pose(request, chain, self._T_frame_shoulder)
        nearest = project(chain, T_shoulder, within_limits=False, priority=self._priority).T
        # If the axes do not cross, some branches do not reach every pose.
        solutions = [solution for solution in inverse(chain, nearest) if solution.exact]
        reached = [forward(chain, solution.q) for solution in solutions]
        return {
            "solutions": [
                {
                    "q": solution.q.tolist(),
                    "within_limits": solution.within_limits,
                    "branch": str(solution.branch),
                }
                for solution in solutions
            ],
            "residual_mm": 1e3 * max(_distance(T_shoulder, T_q) for T_q in reached),
            "residual_rad": max(so3.angle(T_shoulder[:3, :3], T_q[:3, :3]) for T_q in reached),
            "rotation_misfit": misfit,
        } | (self._nearest(chain, T_shoulder, hint, request) if self._with_nearest else {})

    def _nearest(
        self, chain: Chain, T: FloatArray, hint: FloatArray | None, request: Mapping[str, Any]
    ) -> dict[str, Any]:
        """Return the nearest posture to ``T`` (4, 4) in {S} inside the limits, and its losses.

        Of equally good postures the nearest to ``hint`` is taken. Axes count from 1.
        """
        # Pitch and roll leave the yaw to the arm.
        yaw_counts = self._priority is Priority.POSE and "pitch" not in request
        best = project(chain, T, priority=self._priority, q_hint=hint)
        findings = of_projection(chain, best, self._priority, yaw_was_given=yaw_counts)
        links = (["axis 1"] if best.axis1 else []) + (["links"] if best.reach else [])
        return {
            "nearest": {
                "q": best.q.tolist(),
                "branch": str(best.branch),
                "position_mm": 1e3 * best.position_error,
                "rotation_rad": best.rotation_error,
                "yaw_rad": best.yaw_error,
                "pitch_rad": best.pitch_error,
                "roll_rad": best.roll_error,
                "limits": [axis + 1 for axis in best.limits],
                "held_by": links,
                "reason": "; ".join(REASONS[each.reason](each) for each in findings),
            }
        }

    def _chain(self, request: Mapping[str, Any], keys: set[str]) -> Chain:
        unknown = set(request) - keys
        if unknown:
            raise InputError(f"There is no key {sorted(unknown)[0]!r}; known: {sorted(keys)}.")
        tool = request.get("tool", self._arm.default_tool)
        if not isinstance(tool, str):
            raise InputError(f"'tool' is {shown(tool)}; there is no tool with that name.")
        return self._arm.chain_to(tool)


def answer_lines(answer: Answer, source: TextIO | None = None, sink: TextIO | None = None) -> int:
    """Answer each line when it arrives and return the exit status.

    A wrong line is answered by ``{"error": ...}`` with its number, counted from 1; the next lines
    are answered as usual. The status is 1 if there were requests and all were wrong, else 0.
    """
    if source is None and isinstance(sys.stdin, io.TextIOWrapper):
        # Bytes that are not UTF-8 make only their own line wrong.
        sys.stdin.reconfigure(encoding="utf-8", errors="replace")
    source, sink = source or sys.stdin, sink or sys.stdout
    requested = answered = 0
    for number, line in enumerate(source, start=1):
        if not line.strip():
            continue
        requested += 1
        try:
            reply = answer(_request(line))
            answered += 1
        except InputError as error:
            reply = {"error": f"line {number}: {error}"}
        print(json.dumps(reply, allow_nan=False), file=sink, flush=True)
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


def _distance(a: FloatArray, b: FloatArray) -> float:
    return float(np.linalg.norm(a[:3, 3] - b[:3, 3]))

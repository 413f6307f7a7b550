"""``katana450 fk`` and ``katana450 ik``: one JSON object per line in, one per line out."""

from __future__ import annotations

import io
import json
import sys
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any, TextIO

import numpy as np

from katana450.arm.control.branch_options import contact_at
from katana450.arm.robot.collision import initial_objects, world_of
from katana450.arm.robot.loader import load
from katana450.arm.robot.props import load_props
from katana450.errors import InputError
from katana450.maths.geometry import se3, so3
from katana450.maths.geometry.arrays import FloatArray
from katana450.maths.kinematics.branch_metrics import BranchMetrics
from katana450.maths.kinematics.chain import Chain
from katana450.maths.kinematics.forward import forward
from katana450.maths.kinematics.inverse import inverse
from katana450.maths.kinematics.projection import project

MAX_SHOWN_CHARACTERS = 40
"""Maximum number of characters of a wrong value that an error message repeats."""

Answer = Callable[[Mapping[str, Any]], dict[str, Any]]


class Kinematics:
    """Forward and inverse kinematics of the arm in a URDF, on plain JSON values."""

    def __init__(
        self, urdf: Path, tool: str | None, *, in_base_frame: bool, all_metrics: bool = False
    ) -> None:
        """Load the arm.

        Args:
            urdf: file of the arm.
            tool: link that is its default tool; see ``load``.
            in_base_frame: whether poses are in the base frame on the table, else in {S}.
            all_metrics: whether solutions include the cost of moving there from the request's
                ``q``.
        """
        self._all_metrics = all_metrics
        robot = load(urdf, tool)
        self._arm = robot.require_arm()
        self._world = None
        if all_metrics:
            world, _ = world_of(robot)
            self._world = world and world.with_obstacles(initial_objects(load_props()))
        self._T_frame_shoulder = self._arm.T_base_shoulder if in_base_frame else np.eye(4)

    def fk(self, request: Mapping[str, Any]) -> dict[str, Any]:
        """Answer ``{"q": [n rad], "tool"}`` with ``{"T": 4x4}`` [m]."""
        chain = self._chain(request, {"q", "tool"})
        q = chain.check_q(_numbers(request, "q", 1))
        return {"T": (self._T_frame_shoulder @ forward(chain, q)).tolist()}

    def ik(self, request: Mapping[str, Any]) -> dict[str, Any]:
        """Answer ``{"T": 4x4, "tool"}`` with all solutions for the nearest pose of five axes.

        A T printed with four decimals or more is replaced by the nearest rotation;
        ``rotation_misfit`` is the deviation of its columns from orthonormal.

        The residuals are the distance of that pose from ``T``, without regard to joint limits.
        ``within_limits`` of each solution is True if the arm can go there. With all metrics each
        solution also has its distance from ``q`` ([n rad]; the zero posture if not given), its
        smallest singular value, and the two parts in contact there, if any. The finger joint is
        then at 0 or at the limit nearest to it.
        """
        chain = self._chain(request, {"T", "tool", "q"} if self._all_metrics else {"T", "tool"})
        start = chain.check_q(_numbers(request, "q", 1)) if "q" in request else np.zeros(chain.n)
        given = _numbers(request, "T", 2)
        T = se3.printed(given, "T")
        T_shoulder = se3.inverse(self._T_frame_shoulder) @ T
        nearest = project(chain, T_shoulder, within_limits=False).T
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
                | (
                    self._metrics(BranchMetrics.of(chain, solution, start))
                    if self._all_metrics
                    else {}
                )
                for solution in solutions
            ],
            "residual_mm": 1e3 * max(_distance(T_shoulder, T_q) for T_q in reached),
            "residual_rad": max(so3.angle(T_shoulder[:3, :3], T_q[:3, :3]) for T_q in reached),
            "rotation_misfit": so3.misfit(np.array(given)[:3, :3]),
        }

    def _metrics(self, metrics: BranchMetrics) -> dict[str, Any]:
        contact = contact_at(self._world, metrics.q, self._arm.gripper.clamp(0.0))
        return {
            "distance_rad": metrics.distance,
            "time_s": metrics.time,
            "smallest_singular_value": metrics.smallest_singular_value,
            "contact": None if contact is None else contact.parts,
        }

    def _chain(self, request: Mapping[str, Any], keys: set[str]) -> Chain:
        unknown = set(request) - keys
        if unknown:
            raise InputError(f"There is no key {sorted(unknown)[0]!r}; known: {sorted(keys)}.")
        tool = request.get("tool", self._arm.default_tool)
        if not isinstance(tool, str):
            raise InputError(f"'tool' is {_shown(tool)}; there is no tool with that name.")
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
        raise InputError(f"This is {_shown(request)}; a request is a JSON object.")
    return request


def _numbers(request: Mapping[str, Any], key: str, depth: int) -> Any:
    """Return the value of ``key``: lists of JSON numbers, nested ``depth`` deep.

    Raises InputError with the place of a value that is not a number. The caller checks shapes.
    """
    if key not in request:
        raise InputError(f"The key {key!r} is missing.")
    _check_numbers(request[key], key, depth)
    return request[key]


def _check_numbers(value: Any, place: str, depth: int) -> None:
    if depth:
        if not isinstance(value, list):
            what = "numbers" if depth == 1 else "rows"
            raise InputError(f"{place} is {_shown(value)}; it must be a list of {what}.")
        for k, each in enumerate(value):
            _check_numbers(each, f"{place}[{k}]", depth - 1)
        if depth == 2 and len({len(row) for row in value}) > 1:
            raise InputError(f"The rows of {place} have different lengths; its shape must be 4x4.")
    elif isinstance(value, bool) or not isinstance(value, int | float):
        raise InputError(f"{place} is {_shown(value)}; give plain finite numbers.")
    elif isinstance(value, int) and abs(value) > sys.float_info.max:
        raise InputError(f"{place} is too large; give plain finite numbers.")


def _shown(value: Any) -> str:
    """Return ``value`` as JSON shows it, shortened."""
    if isinstance(value, dict | list):
        return "an object" if isinstance(value, dict) else "a list"
    text = json.dumps(value)
    return text if len(text) <= MAX_SHOWN_CHARACTERS else f"{text[:MAX_SHOWN_CHARACTERS]}..."


def _distance(a: FloatArray, b: FloatArray) -> float:
    return float(np.linalg.norm(a[:3, 3] - b[:3, 3]))

"""Other inverse kinematics, each used as in its manual, set to reach the accuracy of the task.

The iterative ones start in the middle of the joints' range. If this fails, they start again at
random angles inside the limits. The cost of failed starts is counted.
"""

from __future__ import annotations

import tempfile
import warnings
from collections.abc import Iterator
from importlib import import_module
from typing import Any

import numpy as np

from benchmarks.kinematics_task import (
    SOLVED_POSITION,
    SOLVED_ROTATION,
    FloatArray,
    Task,
    numbers_text,
    urdf,
)

# An iteration stops an order of magnitude below the error of a solved pose.
_CLOSE_POSITION = 0.1 * SOLVED_POSITION
_CLOSE_ROTATION = 0.1 * SOLVED_ROTATION


class Eaik:
    """Subproblem decomposition in C++; it returns all branches and ignores limits."""

    package = "EAIK"

    def __init__(self, task: Task, workers: int = 1) -> None:
        self._axes = task.n
        self._robot = import_module("eaik.IK_HP").HPRobot(task.axes, task.offsets)
        self._workers = workers
        if not self._robot.hasKnownDecomposition():
            raise RuntimeError("EAIK has no decomposition for this arm")

    def solve(self, T: FloatArray) -> Any:
        """Return all solutions for the pose ``T`` (4, 4), of which the angles are read."""
        found = self._robot.IK(T)
        return found, found.Q

    def joints(self, found: Any) -> FloatArray:
        """Return the joint angles (k, n) [rad] of the exact solutions in ``found``."""
        return self._exact(found[0])

    def _exact(self, found: Any) -> FloatArray:
        exact = [q for q, rough in zip(found.Q, found.is_LS, strict=True) if not rough]
        return np.array(exact, dtype=np.float64).reshape(-1, self._axes)

    def solve_batch(self, T: FloatArray) -> Any:
        """Return all solutions for the poses ``T`` (N, 4, 4)."""
        return self._robot.IK_batched(T, self._workers)

    def joints_batch(self, found: Any) -> list[FloatArray]:
        """Return the joint angles (k, n) [rad] of each pose in ``found``."""
        return [self._exact(each) for each in found]


class IkGeo:
    """Subproblem decomposition in Rust; all branches, limits ignored.

    The points of the task on axes 4 to 6 of a spherical wrist must be its centre.
    """

    package = "ik-geo"

    def __init__(self, task: Task) -> None:
        robot = import_module("ik_geo").Robot
        if task.n != 6:
            raise RuntimeError("ik-geo solves six axes")
        parallel = task.letters[1] == task.letters[2] == task.letters[3]
        form = robot.three_parallel_two_intersecting if parallel else robot.spherical_two_parallel
        self._robot = form(task.axes.tolist(), task.offsets.tolist())

    def solve(self, T: FloatArray) -> Any:
        """Return all solutions for the pose ``T`` (4, 4)."""
        # It reads the rotation by columns.
        return self._robot.get_ik(T[:3, :3].T.tolist(), T[:3, 3].tolist())

    def joints(self, found: Any) -> FloatArray:
        """Return the joint angles (k, 6) [rad] of the exact solutions in ``found``."""
        exact = [q for q, rough in found if not rough]
        return np.array(exact, dtype=np.float64).reshape(-1, 6)


class TracIk:
    """TRAC-IK in C++: Newton steps and sequential quadratic programming side by side."""

    package = "pytracik"
    _TIMEOUT = 0.005  # s

    def __init__(self, task: Task) -> None:
        solver = import_module("trac_ik").TracIK
        with tempfile.NamedTemporaryFile("w", suffix=".urdf") as file:
            file.write(urdf(task))
            file.flush()
            self._solver = solver("base", "tool", file.name, self._TIMEOUT, _CLOSE_POSITION)
        self._start = task.middle

    def solve(self, T: FloatArray) -> Any:
        """Return joint angles (n,) [rad] for the pose ``T`` (4, 4); None after the timeout."""
        return self._solver.ik(T[:3, 3], T[:3, :3], self._start)

    def joints(self, found: Any) -> FloatArray:
        """Return the joint angles (k, n) [rad] of ``found``, k being 0 or 1."""
        return np.array([] if found is None else [found], dtype=np.float64).reshape(
            -1, len(self._start)
        )


class RoboticsToolbox:
    """Levenberg-Marquardt with restarts in C++."""

    package = "roboticstoolbox-python"

    def __init__(self, task: Task, *, limits: bool) -> None:
        ET = import_module("roboticstoolbox").ET
        turn = {"x": ET.Rx, "y": ET.Ry, "z": ET.Rz}
        ranges = zip(task.lower, task.upper, strict=True)
        parts: list[Any] = []
        for letter, offset, (lower, upper) in zip(
            task.letters, task.offsets[:-1], ranges, strict=True
        ):
            parts += [*self._moved(ET, offset), turn[letter](qlim=[lower, upper])]
        parts += self._moved(ET, task.offsets[-1])
        self._chain = parts[0]
        for part in parts[1:]:
            self._chain = self._chain * part
        self._limits = limits
        self._start = task.middle

    @staticmethod
    def _moved(ET: Any, offset: FloatArray) -> Iterator[Any]:
        for move, length in zip((ET.tx, ET.ty, ET.tz), offset, strict=True):
            if length:
                yield move(float(length))

    def solve(self, T: FloatArray) -> Any:
        """Return the solution for the pose ``T`` (4, 4)."""
        # The tolerance applies to half the squared error: 1e-13 is 0.4 um. This damping method and
        # gain are the quickest on this arm that solve every pose.
        return self._chain.ik_LM(
            T, q0=self._start, tol=1e-13, method="chan", k=0.1, joint_limits=self._limits
        )

    def joints(self, found: Any) -> FloatArray:
        """Return the joint angles (1, n) [rad] of ``found``."""
        return np.array(found.q, dtype=np.float64).reshape(1, -1)


class Pinocchio:
    """The damped Gauss-Newton loop of its inverse kinematics example, with steps in C++."""

    package = "pin"
    _STARTS, _STEPS, _DAMPING = 20, 60, 1e-8

    def __init__(self, task: Task) -> None:
        pin = import_module("pinocchio")
        joint = {"x": pin.JointModelRX, "y": pin.JointModelRY, "z": pin.JointModelRZ}
        self._pin, self._model = pin, pin.Model()
        parent = 0
        for number, letter in enumerate(task.letters):
            place = pin.SE3(np.eye(3), task.offsets[number])
            parent = self._model.addJoint(parent, joint[letter](), place, f"joint{number + 1}")
        place = pin.SE3(np.eye(3), task.offsets[-1])
        self._tool = self._model.addFrame(
            pin.Frame("tool", parent, 0, place, pin.FrameType.OP_FRAME)
        )
        self._data = self._model.createData()
        self._starts = task.starts(self._STARTS)

    def solve(self, T: FloatArray) -> Any:
        """Return joint angles (n,) [rad] for the pose ``T`` (4, 4)."""
        pin, model, data, tool = self._pin, self._model, self._data, self._tool
        goal = pin.SE3(T)
        q = self._starts[0]
        for start in self._starts:
            q = start
            for _ in range(self._STEPS):
                pin.forwardKinematics(model, data, q)
                pin.updateFramePlacement(model, data, tool)
                gap = data.oMf[tool].actInv(goal)
                error = pin.log6(gap).vector
                if _is_close(error):
                    return q
                J = -pin.Jlog6(gap.inverse()) @ pin.computeFrameJacobian(model, data, q, tool)
                square = J @ J.T
                square[range(6), range(6)] += self._DAMPING
                q = q - J.T @ np.linalg.solve(square, error)
        return q

    def joints(self, found: Any) -> FloatArray:
        """Return the joint angles (1, n) [rad] of ``found``."""
        return np.array(found, dtype=np.float64).reshape(1, -1)


class Mink:
    """Differential kinematics as a quadratic program on MuJoCo, repeated until it converges."""

    package = "mink"
    _STARTS, _STEPS = 40, 12

    def __init__(self, task: Task, *, limits: bool) -> None:
        mink = import_module("mink")
        self._mink = mink
        model = import_module("mujoco").MjModel.from_xml_string(_mjcf(task))
        self._arm = mink.Configuration(model)
        self._task = mink.FrameTask("tool", "site", position_cost=1.0, orientation_cost=1.0)
        self._limits = [mink.ConfigurationLimit(model, gain=1.0)] if limits else []
        self._starts = task.starts(self._STARTS)

    def solve(self, T: FloatArray) -> Any:
        """Return joint angles (n,) [rad] for the pose ``T`` (4, 4)."""
        mink, arm = self._mink, self._arm
        self._task.set_target(mink.SE3.from_matrix(T))
        for start in self._starts:
            arm.update(start)
            for _ in range(self._STEPS):
                if _is_close(self._task.compute_error(arm)):
                    return arm.q.copy()
                try:
                    step = mink.solve_ik(
                        arm, [self._task], 1.0, "daqp", damping=1e-12, limits=self._limits
                    )
                except mink.NoSolutionFound:
                    break
                arm.integrate_inplace(step, 1.0)
        return arm.q.copy()

    def joints(self, found: Any) -> FloatArray:
        """Return the joint angles (1, n) [rad] of ``found``."""
        return np.array(found, dtype=np.float64).reshape(1, -1)


class Ikpy:
    """Bounded least squares by SciPy on kinematics in Python."""

    package = "ikpy"
    _STARTS = 5

    def __init__(self, task: Task) -> None:
        # ikpy warns that its fixed first and last links are marked as fixed.
        warnings.simplefilter("ignore")
        link = import_module("ikpy.link")
        limits = zip(task.lower, task.upper, strict=True)
        links = [link.OriginLink()]
        for number, bounds in enumerate(limits):
            links.append(
                link.URDFLink(
                    f"joint{number + 1}",
                    origin_translation=task.offsets[number],
                    origin_orientation=[0.0, 0.0, 0.0],
                    rotation=task.axes[number],
                    bounds=bounds,
                )
            )
        links.append(
            link.URDFLink(
                "tool",
                origin_translation=task.offsets[-1],
                origin_orientation=[0.0, 0.0, 0.0],
                rotation=None,
                joint_type="fixed",
            )
        )
        moves = [False, *(True for _ in task.letters), False]
        self._chain = import_module("ikpy.chain").Chain(links, active_links_mask=moves)
        self._starts = [np.array([0.0, *q, 0.0]) for q in task.starts(self._STARTS)]

    def solve(self, T: FloatArray) -> Any:
        """Return the angles of all links, fixed ones included, for the pose ``T`` (4, 4)."""
        q = self._starts[0]
        for start in self._starts:
            q = self._chain.inverse_kinematics_frame(
                T, initial_position=start, orientation_mode="all", tol=1e-12
            )
            if np.abs(self._chain.forward_kinematics(q) - T).max() < _CLOSE_POSITION:
                break
        return q

    def joints(self, found: Any) -> FloatArray:
        """Return the joint angles (1, n) [rad] of ``found``."""
        return np.array(found[1:-1], dtype=np.float64).reshape(1, -1)


def _is_close(error: FloatArray) -> bool:
    """Return whether an error (6,), linear part first, is small enough to stop."""
    linear, angular = error[:3], error[3:]
    return bool(linear @ linear < _CLOSE_POSITION**2 and angular @ angular < _CLOSE_ROTATION**2)


def _mjcf(task: Task) -> str:
    """Return the arm as MuJoCo XML; MuJoCo requires masses, although they have no effect here."""
    bodies = "".join(
        f'<body pos="{numbers_text(offset)}"><joint type="hinge" axis="{numbers_text(axis)}" '
        f'range="{numbers_text(np.array(limits))}"/>'
        f'<inertial pos="0 0 0" mass="1" diaginertia="1 1 1"/>'
        for offset, axis, *limits in zip(
            task.offsets[:-1], task.axes, task.lower, task.upper, strict=True
        )
    )
    tool = f'<site name="tool" pos="{numbers_text(task.offsets[-1])}"/>'
    return (
        '<mujoco><compiler angle="radian"/><worldbody>'
        f"{bodies}{tool}{'</body>' * len(task.axes)}</worldbody></mujoco>"
    )

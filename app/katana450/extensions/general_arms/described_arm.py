"""An arm of any number of turning axes in a URDF file, with the kinematics that suit it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

from katana450.arm.robot.arm_reader import described_chain
from katana450.arm.robot.description import explained, refuse_loops
from katana450.arm.robot.link import SLOW_TURN
from katana450.arm.robot.structure import structure_of
from katana450.arm.robot.urdf import urdf_of
from katana450.assembly.robot_files import read_urdf
from katana450.caching import cached_property
from katana450.errors import InputError, RobotDescriptionError
from katana450.extensions.general_arms.choice import exact_arm, kinematics_of
from katana450.maths.geometry import se3
from katana450.maths.geometry.arrays import FloatArray, frozen
from katana450.maths.kinematics.chain import Chain
from katana450.maths.kinematics.kinematics import Kinematics

LEAST_AXES = 2
"""Minimum number of axes: {S} lies where axis 1 passes axis 2."""


@dataclass(frozen=True, eq=False)
class DescribedArm:
    """An arm in a file: its chain with exact axes, its tools, and where it stands.

    Attributes:
        chain: the joints in frame {S}; its ``M`` is that of ``default_tool``.
        tools: home configuration M, (4, 4) in {S}, of each tool link.
        default_tool: a key of ``tools``.
        T_base_shoulder: (4, 4) frame {S} in the root link [m].
        notes: sentences about assumptions on the file.
    """

    chain: Chain
    tools: Mapping[str, FloatArray]
    default_tool: str
    T_base_shoulder: FloatArray
    notes: tuple[str, ...]

    @cached_property
    def _chains(self) -> Mapping[str, Chain]:
        return {name: self.chain.with_tool(M) for name, M in self.tools.items()}

    @property
    def kinematics(self) -> Kinematics:
        """The kinematics of the default tool."""
        return kinematics_of(self._chains[self.default_tool])

    def kinematics_to(self, tool: str) -> Kinematics:
        """Return the kinematics of ``tool``. Raises InputError with the names of all tools."""
        try:
            return kinematics_of(self._chains[tool])
        except (KeyError, TypeError):
            known = ", ".join(self.tools)
            raise InputError(f"There is no tool {tool!r}; this arm has {known}.") from None


def described_arm(path: Path, tool: str | None = None) -> DescribedArm:
    """Return the arm in the URDF file at ``path``.

    Args:
        path: the file.
        tool: link to which poses refer; None for the first of TOOL_FRAMES that exists, else the
            outermost link that the arm carries.

    Raises:
        RobotDescriptionError: the file cannot be read, has no such link, or no series of turning
            joints that carries it. The message says what is wrong.
    """
    data = read_urdf(path)
    refuse_loops(data, path)
    with explained(path):
        urdf = urdf_of(data, path.parent)
        structure = structure_of(urdf, path, tool, count=None)
        if len(structure.axes) < LEAST_AXES:
            raise RobotDescriptionError(
                f"The tool of {path.name} is carried by {len(structure.axes)} turning joints; an "
                f"arm needs at least {LEAST_AXES}. Name another link with --tool."
            )
        for joint in structure.axes:
            if joint.type not in ("revolute", "continuous"):
                raise RobotDescriptionError(
                    f"Joint {joint.name!r} of {path.name} is {joint.type}; only turning joints can "
                    "carry a tool. Name a link before it with --tool."
                )
        frames = urdf.frames()
        described, T_base_shoulder = described_chain(frames, structure)
    T_shoulder_base = se3.inverse(T_base_shoulder)
    chain, notes = exact_arm(described)
    slow = [
        f"Joint {joint.name!r} has no speed in its file; it gets {SLOW_TURN:g} rad/s."
        for joint, speed in zip(structure.axes, chain.speed.tolist(), strict=True)
        if joint.limit is None or joint.limit.velocity != speed
    ]
    method = f"The kinematics are {kinematics_of(chain).method}."
    return DescribedArm(
        chain=chain,
        tools={link: frozen(T_shoulder_base @ frames[link]) for link in structure.tools},
        default_tool=structure.tools[0],
        T_base_shoulder=frozen(T_base_shoulder),
        notes=(*notes, *slow, method),
    )

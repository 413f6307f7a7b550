"""Five-axis robot arms: exact kinematics, collision-free plans and teleoperation in a browser.

The library in a few lines::

    import katana450

    arm = katana450.load()  # or load("my_arm.urdf", tool="gripper_tip")
    T = arm.fk([0.0, -1.2, 1.5, 0.1, 0.0])
    for solution in arm.ik(T).feasible:
        print(solution.branch, solution.q)
    circle = arm.circle(centre=(0.15, 0.0, -0.11), radius=0.1)
    circle.plot()
    arm.show(circle)

Lengths are in m, angles in rad, times in s. The argument ``frame`` of `load` sets the frame of
poses. Each name below is loaded on first use, so that ``import katana450`` is fast.
"""

from typing import TYPE_CHECKING, Any

from katana450.lazy_names import loaded as _loaded
from katana450.lazy_names import modules_of as _modules_of

if TYPE_CHECKING:
    from katana450.client import Client as Client
    from katana450.client import connect as connect
    from katana450.errors import BlockedError as BlockedError
    from katana450.errors import ConfigurationError as ConfigurationError
    from katana450.errors import InputError as InputError
    from katana450.errors import KatanaError as KatanaError
    from katana450.errors import RobotDescriptionError as RobotDescriptionError
    from katana450.extensions.general_arms.nearest import NearestPose as NearestPose
    from katana450.extensions.reachability.reachability import ReachabilityMap as ReachabilityMap
    from katana450.library.arm import Arm as Arm
    from katana450.library.arm import load as load
    from katana450.library.motion_plan import MotionPlan as MotionPlan
    from katana450.library.motion_plan import Trajectory as Trajectory
    from katana450.library.recording import Recording as Recording
    from katana450.library.recording import open as open
    from katana450.library.script_writer import ScriptWriter as ScriptWriter
    from katana450.library.script_writer import program as program
    from katana450.library.solutions import IKSolutions as IKSolutions
    from katana450.library.viewer import Viewer as Viewer
    from katana450.maths.kinematics.branch import Branch as Branch
    from katana450.maths.kinematics.pose import SE3 as SE3
    from katana450.maths.kinematics.solution import Solution as Solution

_MODULES = _modules_of(__file__)

__all__ = sorted(_MODULES)  # noqa: PLE0605

# Hidden from type checkers, which would otherwise accept every name.
if not TYPE_CHECKING:

    def __getattr__(name: str) -> Any:
        """Load a public name when it is first used."""
        return _loaded(name, _MODULES, globals())


def __dir__() -> list[str]:
    return sorted({*globals(), *__all__})

"""Load your own arm: any URDF with a pan axis, three parallel axes and a roll axis.

python my_own_arm.py [FILE.urdf] [TOOL_LINK]
"""

import sys
from pathlib import Path

import numpy as np

import katana450

file = Path(sys.argv[1] if len(sys.argv) > 1 else Path(__file__).with_name("my_own_arm.urdf"))
tool = sys.argv[2] if len(sys.argv) > 2 else None

try:
    arm = katana450.load(file, tool, frame="base")
except katana450.RobotDescriptionError as error:
    sys.exit(f"This is not an arm for katana450: {error}")

print(f"{arm.name}: {arm.n} joints, poses of the link {arm.tool!r} in the base frame")
for note in arm.notes:
    print(f"  {note}")

T = arm.fk(arm.ready)
print(f"Ready, the tool is at {np.round(1e3 * T[:3, 3]).tolist()} mm.")
for solution in arm.ik(T):
    inside = "inside" if solution.within_limits else "outside"
    print(f"  {solution.branch}: {np.degrees(solution.q).round(1).tolist()} deg, {inside} limits")

# Five axes cannot reach every pose. Compute the nearest one, and the reason for the difference.
T[:3, 3] += (0.0, 0.1, 0.5)
best = arm.nearest(T)
print(f"The nearest pose to one half a metre higher: {best.reason}.")

# Solve a sequence of poses at once.
q = np.linspace(arm.ready, arm.ready + 0.2, 1000)
found = arm.ik(arm.fk(q))
print(f"{len(q)} poses solved, at most {found.position_error[:, 0].max():.1e} m off.")

down = arm.line(by=(0.0, 0.0, -0.03))
print(f"A line of 30 mm down takes {down.duration:.2f} s.")

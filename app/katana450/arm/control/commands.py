"""All commands of the arm, from the modules of their subjects."""

from katana450.arm.control.act import *
from katana450.arm.control.arm_commands import *
from katana450.arm.control.joint_commands import *
from katana450.arm.control.motion_commands import *
from katana450.arm.control.object_commands import *
from katana450.arm.control.stop_commands import *
from katana450.arm.control.tool_commands import *

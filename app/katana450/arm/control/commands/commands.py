"""All commands of the arm, from the modules of their subjects."""

from katana450.arm.control.commands.act import *
from katana450.arm.control.commands.joint_commands import *
from katana450.arm.control.commands.motion_commands import *
from katana450.arm.control.commands.object_commands import *
from katana450.arm.control.commands.stop_commands import *
from katana450.arm.control.commands.tool_commands import *

"""The extension ``joint_view``: scene and panel of robots that are driven joint by joint."""

from __future__ import annotations

from typing import TYPE_CHECKING

from katana450.extension import Extension

if TYPE_CHECKING:
    from katana450.server.view.view_updater import ViewUpdater


def _joint_view() -> type[ViewUpdater]:
    from katana450.extensions.joint_view.machine_view import MachineView

    return MachineView


EXTENSION = Extension("joint_view", joint_view=_joint_view)

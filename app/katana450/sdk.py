"""Everything that an extension needs: the only module of katana450 that one has to import.

    from katana450.sdk import CliCommand, Extension

The names are loaded on first use, because an extension is imported whenever options are read. They
stay as they are within a minor version. ``docs/extensions.md`` describes how they work together.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from katana450.lazy_names import loaded, modules_of

if TYPE_CHECKING:
    from katana450.arm.control.commands import commands as commands
    from katana450.arm.control.commands.act import Command as Command
    from katana450.arm.control.commands.act import MotionRequest as MotionRequest
    from katana450.arm.control.commands.act import Request as Request
    from katana450.arm.control.commands.act import Traits as Traits
    from katana450.arm.control.lease import Actor as Actor
    from katana450.arm.control.lease import Person as Person
    from katana450.arm.control.lease import Role as Role
    from katana450.arm.control.session.session import Session as Session
    from katana450.arm.control.session.stopping import SilenceProfile as SilenceProfile
    from katana450.arm.control.state.arm_report import ArmReport as ArmReport
    from katana450.arm.control.state.state import Finding as Finding
    from katana450.arm.control.state.state import Reason as Reason
    from katana450.arm.control.state.state import State as State
    from katana450.arm.control.state.state import Status as Status
    from katana450.arm.drivers.driver import Driver as Driver
    from katana450.arm.drivers.driver import DriverAnswer as DriverAnswer
    from katana450.arm.robot.object_meshes import InitialScene as InitialScene
    from katana450.arm.robot.robot import Robot as Robot
    from katana450.errors import ConfigurationError as ConfigurationError
    from katana450.errors import InputError as InputError
    from katana450.errors import KatanaError as KatanaError
    from katana450.errors import LeaseError as LeaseError
    from katana450.extension import CliCommand as CliCommand
    from katana450.extension import Extension as Extension
    from katana450.extension import ExtraProcess as ExtraProcess
    from katana450.extension import ServerFacts as ServerFacts
    from katana450.extension import TickSender as TickSender
    from katana450.extensions.programs.building.plan_state import PlanState as PlanState
    from katana450.extensions.programs.building.step import Step as Step
    from katana450.extensions.programs.language import kinds as kinds
    from katana450.server.api import answers as answers
    from katana450.server.api import program_requests as program_requests
    from katana450.server.api import requests as requests
    from katana450.server.service.arm_handle import ArmHandle as ArmHandle
    from katana450.server.service.hub import Hub as Hub
    from katana450.server.service.identity import Identity as Identity
    from katana450.server.service.participants import Participant as Participant
    from katana450.server.service.runner import RequestHandler as RequestHandler
    from katana450.server.view.layer import FolderContext as FolderContext
    from katana450.server.view.layer import LayerContext as LayerContext
    from katana450.server.view.layer import PanelFolder as PanelFolder
    from katana450.server.view.layer import ViewLayer as ViewLayer
    from katana450.server.viser_bridge.presets import Preset as Preset
    from katana450.server.web.http_api import RouteContext as RouteContext
    from katana450.server.web.listen import listen as listen

MODULES = modules_of(__file__)
"""The module of each public name, as the imports for type checkers above say."""

__all__ = sorted(MODULES)  # noqa: PLE0605

# Hidden from type checkers, which would otherwise accept every name.
if not TYPE_CHECKING:

    def __getattr__(name: str) -> Any:
        """Load a public name when it is first used."""
        return loaded(name, MODULES, globals())


def __dir__() -> list[str]:
    return sorted({*globals(), *__all__})

"""The page of katana450 as a teleoperator of LeRobot: ``--teleop.type=katana450``."""

from dataclasses import dataclass
from typing import Any

from lerobot.teleoperators import Teleoperator, TeleoperatorConfig
from lerobot.utils.decorators import check_if_already_connected, check_if_not_connected

from katana450.caching import cached_property
from lerobot_robot_katana450.served_arm import (
    TELEOPERATOR_NAME,
    ServedArm,
    ServedDevice,
    ServerOptions,
)


@TeleoperatorConfig.register_subclass("katana450")
@dataclass(kw_only=True)
class Katana450TeleoperatorConfig(ServerOptions, TeleoperatorConfig):
    """Options of the teleoperator.

    Attributes:
        lead: time ahead [s] of the setpoints that are its actions. With the time of a frame, an
            action is the setpoint of the next frame, as in our datasets.
    """

    lead: float = 1.0 / 30.0


class Katana450Teleoperator(ServedDevice, Teleoperator):
    """The setpoints of the arm of a server, which another driver moves by any device.

    It never asks for the lease.
    """

    config_class = Katana450TeleoperatorConfig
    name = "katana450"

    def __init__(self, config: Katana450TeleoperatorConfig) -> None:
        super().__init__(config)
        self.config = config
        self._arm = ServedArm(config, TELEOPERATOR_NAME)

    @cached_property
    def action_features(self) -> dict[str, type]:
        """Type of each number by its name. Raises LostError without a server."""
        return dict.fromkeys(self._arm.features.names, float)

    @property
    def feedback_features(self) -> dict[str, type]:
        """Nothing: a server shows no feedback of another robot."""
        return {}

    @check_if_already_connected
    def connect(self, calibrate: bool = True) -> None:  # noqa: ARG002
        """Connect to the server. Raises LostError without one."""
        self._arm.open()

    @check_if_not_connected
    def get_action(self) -> dict[str, float]:
        """Return the setpoint of the arm. Raises LostError for a lost or late server."""
        return self._arm.setpoint(self.config.lead)

    def send_feedback(self, feedback: dict[str, Any]) -> None:
        """Raise NotImplementedError."""
        raise NotImplementedError

    @check_if_not_connected
    def disconnect(self) -> None:
        """Close the connection."""
        self._arm.close()

"""Arms that katana450 serves, as robots of LeRobot: ``--robot.type=katana450``."""

from dataclasses import dataclass, field
from typing import Any

from lerobot.cameras import CameraConfig, make_cameras_from_configs
from lerobot.robots import Robot, RobotConfig
from lerobot.utils.decorators import check_if_already_connected, check_if_not_connected

from katana450.caching import cached_property
from lerobot_robot_katana450.served_arm import (
    ROBOT_NAME,
    ServedArm,
    ServedDevice,
    ServerOptions,
)


@RobotConfig.register_subclass("katana450")
@dataclass(kw_only=True)
class Katana450RobotConfig(ServerOptions, RobotConfig):
    """Options of the robot.

    Attributes:
        drive: whether LeRobot drives the arm. Otherwise another driver does, as a person on the
            page, and the robot is only measured: actions are returned and not sent.
        cameras: cameras of LeRobot by their names.
    """

    drive: bool = True
    cameras: dict[str, CameraConfig] = field(default_factory=dict)


class Katana450Robot(ServedDevice, Robot):
    """The arm of a server, whatever its kind."""

    config_class = Katana450RobotConfig
    name = "katana450"

    def __init__(self, config: Katana450RobotConfig) -> None:
        super().__init__(config)
        self.config = config
        self.cameras = make_cameras_from_configs(config.cameras)
        self._arm = ServedArm(config, ROBOT_NAME)

    @cached_property
    def action_features(self) -> dict[str, type]:
        """Type of each number by its name. Raises LostError without a server."""
        return dict.fromkeys(self._arm.features.names, float)

    @cached_property
    def observation_features(self) -> dict[str, Any]:
        """Type of each number, and height, width and channels of each camera, by their names."""
        cameras = self.config.cameras.items()
        shapes = {name: (camera.height, camera.width, 3) for name, camera in cameras}
        return {**self.action_features, **shapes}

    @check_if_already_connected
    def connect(self, calibrate: bool = True) -> None:  # noqa: ARG002
        """Connect to the server, acquire the lease if we drive, and connect the cameras.

        Raises LostError without a server, and RefusedError if the arm cannot be driven.
        """
        self._arm.open()
        try:
            if self.config.drive:
                self._arm.drive()
            for camera in self.cameras.values():
                camera.connect()
        except BaseException:
            self.disconnect()
            raise

    @check_if_not_connected
    def get_observation(self) -> dict[str, Any]:
        """Return the measured joints, and the newest picture of each camera.

        Raises LostError for a lost or late server, and RefusedError if we no longer drive.
        """
        pictures = {name: camera.read_latest() for name, camera in self.cameras.items()}
        return {**self._arm.measured(), **pictures}

    @check_if_not_connected
    def send_action(self, action: dict[str, Any]) -> dict[str, Any]:
        """Let the arm follow ``action``; return the part of it within the limits of the joints."""
        return self._arm.follow(action) if self.config.drive else action

    @check_if_not_connected
    def disconnect(self) -> None:
        """Release the lease, and close the connections."""
        self._arm.close()
        for camera in self.cameras.values():
            if camera.is_connected:
                camera.disconnect()

"""A live connection of Foxglove: frames, joints and status of the arm, and STOP.

The SDK of Foxglove listens on a port of its own and authenticates nobody, so the port is open to
this machine only, and its clients can only watch and stop the arm.
"""

from __future__ import annotations

import logging
import threading
import time
from typing import Any

import foxglove
from foxglove import messages
from foxglove.channels import FrameTransformsChannel, JointStatesChannel
from foxglove.websocket import Service, ServiceRequest, ServiceSchema

from katana450.arm.control.actor import Actor, CommandChannel
from katana450.arm.control.commands import commands as cmd
from katana450.arm.control.lease import Person, Role
from katana450.arm.control.state.messages import sentence
from katana450.arm.control.state.stop_cause import pressed
from katana450.extensions.rosbridge import names
from katana450.extensions.rosbridge.publications import SILENT_AFTER, Publications, link_poses
from katana450.server.service.arm_handle import ArmHandle
from katana450.server.service.hub import Hub

log = logging.getLogger(__name__)

HOST = "127.0.0.1"

PROTOCOL = "foxglove.sdk.v1"
"""The only protocol that the SDK accepts."""

INTERVAL = 1.0 / 30.0
"""[s] Interval of the messages."""

MAX_WAITING_MESSAGES = 8
"""Maximum number of messages that wait for a slow client; the oldest are dropped."""

STATUS = "/katana450/status"

ACTOR = Actor(Person("foxglove", "Foxglove", Role.VIEWER), CommandChannel.WEBSOCKET)
"""The actor in whose name the clients press STOP."""


class FoxgloveServer:
    """Publishes the newest state while a client is subscribed, from a thread of its own."""

    def __init__(self, hub: Hub, port: int) -> None:
        """Listen on ``port`` of this machine. Raises RuntimeError if the port is taken."""
        self._hub = hub
        self._publications = Publications(hub, lambda: "")
        self._context = foxglove.Context()
        self._frames = FrameTransformsChannel(names.TF, context=self._context)
        self._joints = JointStatesChannel(names.JOINT_STATES, context=self._context)
        self._status = foxglove.Channel(STATUS, message_encoding="json", context=self._context)
        self._server = foxglove.start_server(
            name="katana450",
            host=HOST,
            port=port,
            services=[
                Service(
                    name=names.STOP_SERVICE,
                    schema=ServiceSchema(name=names.TRIGGER, request=None, response=None),
                    handler=self._stop,
                )
            ],
            supported_encodings=["json"],
            capabilities=[],
            context=self._context,
            message_backlog_size=MAX_WAITING_MESSAGES,
        )
        self._thread = threading.Thread(target=self._run, name="foxglove", daemon=True)
        self._thread.start()
        log.info("Foxglove (protocol %s) can connect to ws://%s:%d.", PROTOCOL, HOST, port)

    def _run(self) -> None:
        problem = ""
        while True:
            time.sleep(INTERVAL)
            arm = self._hub.arm
            if arm is None or arm.age > SILENT_AFTER:
                continue
            try:
                self._publish(arm)
                problem = ""
            except Exception as error:
                # The next state may be shown again. An error that lasts is logged once.
                if repr(error) != problem:
                    log.exception("Error in the connection of Foxglove.")
                problem = repr(error)

    def _publish(self, arm: ArmHandle) -> None:
        state = arm.state
        if self._frames.has_sinks():
            self._frames.log(_frame_transforms(arm, _stamp(self._publications.stamp(arm))))
        if self._joints.has_sinks():
            stamp = _stamp(self._publications.stamp(arm))
            values = arm.robot.joint_values(state.q, state.gripper)
            joints = [messages.JointState(name=k, position=v) for k, v in values.items()]
            self._joints.log(messages.JointStates(timestamp=stamp, joints=joints))
        if self._status.has_sinks():
            now = {"status": state.status.value, "moving": state.moving, "why": sentence(state)}
            self._status.log(now)

    def _stop(self, _request: ServiceRequest) -> bytes:
        """Stop the arm. Called in a thread of the SDK; the gate may be used in any."""
        # A stop that is in force is not renewed: pages of any site on this machine can call this.
        if self._hub.gate.stopped is not None:
            return b'{"success": true, "message": "stopped"}'
        self._hub.gate.submit(cmd.Stop(pressed(ACTOR.name, ACTOR.key, None, 0.0)), ACTOR)
        return b'{"success": true, "message": "requested"}'


def start(hub: Hub, port: int) -> None:
    """Let Foxglove connect to ``port``. A port that cannot be opened is logged."""
    try:
        FoxgloveServer(hub, port)
    except (RuntimeError, OSError, foxglove.FoxgloveError) as error:
        log.warning("Foxglove cannot connect to port %d: %s", port, error)


def _stamp(seconds: float) -> Any:
    return messages.Timestamp.from_epoch_secs(seconds)


def _frame_transforms(arm: ArmHandle, stamp: Any) -> Any:
    """Return the poses of all links in their parents at the time ``stamp``."""
    return messages.FrameTransforms(
        transforms=[
            messages.FrameTransform(
                timestamp=stamp,
                parent_frame_id=pose.parent,
                child_frame_id=pose.child,
                translation=messages.Vector3(**pose.translation),
                rotation=messages.Quaternion(**pose.rotation),
            )
            for pose in (*link_poses(arm, moving=False), *link_poses(arm, moving=True))
        ]
    )

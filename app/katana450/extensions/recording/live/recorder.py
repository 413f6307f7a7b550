"""The process that records: it receives every tick of the arm and writes the ring.

It imports little until the server has started, and the arm's process keeps the ticks meanwhile.
"""

from __future__ import annotations

import logging
import sys
import threading
import time
from dataclasses import dataclass, replace
from multiprocessing.connection import Connection
from pathlib import Path
from typing import TYPE_CHECKING

from katana450.assembly.supervised import READY, SupervisorPipe, connected_to_ticks
from katana450.errors import InputError
from katana450.extension import ServerFacts
from katana450.extensions.recording.live.running_scripts import RunningScripts
from katana450.platform_support import lower_priority

if TYPE_CHECKING:
    from katana450.arm.runtime.pipes.private_listener import PrivateAddress
    from katana450.extensions.recording.episodes.keeper import EpisodeKeeper
    from katana450.extensions.recording.files.header import RecordingHeader
    from katana450.extensions.recording.live.recorder_link import RecorderListener
    from katana450.extensions.recording.live.ring import Ring

START_DELAY = 3.0
"""[s] Time after the start of the arm in which the other processes have the processor alone."""

SYNC_INTERVAL = 0.6
"""[s] Time between two syncs of the file. With ``COLLECTING`` of the arm's process it is the
maximum age of what a crash of the machine loses."""

END_NOTICE_TIME = 1.0
"""[s] Time within which this process notices that the server ends."""

SWITCH_INTERVAL = 0.001
"""[s] Time after which a busy thread lets another one run."""

LOOK_SECONDS = 0.05
"""[s] Time between two looks at whether pictures are to be recorded."""

log = logging.getLogger(__name__)


@dataclass(frozen=True)
class RecorderConfig:
    """Configuration of the process that records.

    Attributes:
        facts: what it knows of the server.
        folder: folder of the ring.
        episodes: folder of the episodes.
        address: address of this process for the page's server.
        camera_names: names of the cameras.
        cameras: address of the process of the cameras; None without any.
    """

    facts: ServerFacts
    folder: Path
    episodes: Path
    address: PrivateAddress
    camera_names: tuple[str, ...] = ()
    cameras: PrivateAddress | None = None


def run_recorder(config: RecorderConfig, supervisor: SupervisorPipe) -> None:
    """Record in this process, from start to end. Raises KatanaError."""
    facts = config.facts
    # So that ticks are received at once while another thread cuts out a long episode.
    sys.setswitchinterval(SWITCH_INTERVAL)
    lower_priority()
    supervisor.report(READY)
    try:
        pipe = connected_to_ticks(facts.address, supervisor.ended)
        supervisor.ended.wait(START_DELAY)
        scripts = RunningScripts()
        ring, header = _ring(config, scripts)
        if supervisor.ended.is_set():
            return
        keeper = _episodes(config, ring, header, supervisor.ended)
        listener = _listener(config, keeper, scripts, supervisor.ended)
        if config.cameras is not None:
            threading.Thread(
                target=_record_pictures, args=(config.cameras, ring), name="pictures", daemon=True
            ).start()
        try:
            while True:
                _receive(pipe, ring)
                pipe = connected_to_ticks(facts.address, supervisor.ended)
        finally:
            if not isinstance(keeper, InputError):
                keeper.close()
            if listener is not None:
                listener.close()
            ring.close()
    except EOFError:
        # The server ends.
        return


def _ring(config: RecorderConfig, scripts: RunningScripts) -> tuple[Ring, RecordingHeader]:
    from katana450.assembly.robot_session import find_robot
    from katana450.extensions.recording.files.header import header_of
    from katana450.extensions.recording.live.ring import Ring

    facts = config.facts
    robot = find_robot(facts.settings, facts.urdf, facts.tool)
    environment = robot.session.environment
    header = header_of(robot.robot, facts.settings, facts.urdf, facts.tool, environment)
    header = replace(header, cameras=config.camera_names)
    return Ring(config.folder, header, scripts=scripts), header


def _episodes(
    config: RecorderConfig, ring: Ring, header: RecordingHeader, ended: threading.Event
) -> EpisodeKeeper | InputError:
    """Return the keeper of the episodes, or why there is none."""
    from katana450.extensions.recording.episodes.episode_folder import EpisodeFolder
    from katana450.extensions.recording.episodes.keeper import EpisodeKeeper

    folder = EpisodeFolder(config.episodes)
    try:
        folder.claim()
        return EpisodeKeeper(folder, ring, config.folder, header.metadata["utc_offset_ns"])
    except (InputError, OSError) as error:
        # A server that ends removes its folders.
        if not ended.wait(END_NOTICE_TIME):
            log.error("Episodes cannot be recorded: %s", error)
        return InputError(f"Episodes cannot be recorded: {error}")


def _listener(
    config: RecorderConfig,
    keeper: EpisodeKeeper | InputError,
    scripts: RunningScripts,
    ended: threading.Event,
) -> RecorderListener | None:
    """Return what takes requests of the page's server; None if it cannot, or the server ends."""
    from katana450.extensions.recording.live.recorder_link import RecorderListener

    try:
        return RecorderListener(keeper, scripts, config.address)
    except OSError as error:
        # A server that ends removes the folder of the address.
        if not ended.wait(END_NOTICE_TIME):
            log.error("Episodes and scripts cannot be recorded: %s", error)
        return None


def _record_pictures(address: PrivateAddress, ring: Ring) -> None:
    """Record the pictures of the cameras while the arm moves or an episode runs."""
    from katana450.extensions.cameras.camera_process import RECORDER, received_pictures

    while True:
        for picture in received_pictures(address, RECORDER, ring.wants_pictures):
            if picture is not None and picture.jpeg:
                ring.put_picture(picture.camera, picture.t, picture.jpeg)
        time.sleep(LOOK_SECONDS)


def _receive(pipe: Connection, ring: Ring) -> None:
    """Write what comes by ``pipe`` until the other end closes it."""
    from katana450.extensions.recording.live.record_end import LostTicks, RecordDeserializer

    deserializer, synced = RecordDeserializer(), time.monotonic()
    try:
        while True:
            # Without anything to sync there is nothing to do until the next record.
            left = max(synced + SYNC_INTERVAL - time.monotonic(), 0.0)
            if not ring.unsynced or pipe.poll(left):
                records = deserializer.loaded(pipe.recv_bytes())
                with ring.lock:
                    if isinstance(records, LostTicks):
                        ring.lost(records.until, records.ticks)
                    else:
                        ring.put_all(records)
            if ring.unsynced and time.monotonic() - synced >= SYNC_INTERVAL:
                with ring.lock:
                    ring.sync()
                synced = time.monotonic()
    except (EOFError, OSError):
        with ring.lock:
            ring.sync()
            # The next process of the arm begins with another state.
            ring.close()

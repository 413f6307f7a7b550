"""The measured arm of a run on a server, for the report of its script."""

from __future__ import annotations

import sys
import tempfile
from argparse import Namespace
from pathlib import Path

from katana450.client import Client, RefusedError
from katana450.client.files import LostError
from katana450.extensions.experiments.simulate import Simulated, exit_status
from katana450.extensions.programs.run.measured_run import MeasuredRun
from katana450.extensions.recording.files.checking import session_for
from katana450.extensions.recording.files.recorded_states import recorded_states
from katana450.extensions.recording.files.recording_file import RecordingFile
from katana450.extensions.recording.live.run_fetcher import fetch_run
from katana450.server.api import answers


def report_measured(
    simulated: Simulated, options: Namespace, arm: Client, before: answers.State
) -> int:
    """Write the report of ``simulated`` again, with the arm as the server has measured it.

    ``before``: the state before the run. Returns the exit status: 1 if a bound is not met. Raises
    KatanaError.
    """
    report = simulated.report
    assert report is not None
    if before.arm is not None:
        try:
            report = report.with_measured(
                _measured_run(arm, before.sent, options.urdf), f"at {options.url}"
            )
        except (LostError, RefusedError) as error:
            print(f"katana450: the report lacks the measured arm: {error}", file=sys.stderr)
        else:
            print("\n".join(f"  {line}" for line in report.lines))
            simulated._replace(report=report).write(options.report)
    return exit_status(report)


def _measured_run(arm: Client, began: float, urdf: Path) -> MeasuredRun | None:
    with tempfile.TemporaryDirectory(prefix="katana450-") as folder:
        path = Path(folder) / "run.mcap"
        fetch_run(arm, began, path)
        with RecordingFile.open(path) as file:
            session = session_for(file, urdf).session
            return MeasuredRun.of(
                session.require_arm(), list(recorded_states(file, session, began))
            )

"""``katana450 arm calibrate`` and ``release``: orders that a person confirms twice."""

from __future__ import annotations

import sys
import time
from argparse import Namespace
from collections.abc import Callable

from katana450.arm.control.arm_commands import HAZARDS, ArmAct
from katana450.arm.control.arm_report import ArmMode
from katana450.errors import InputError
from katana450.extensions.real_arm.commands.options import STOP_BUTTON
from katana450.extensions.real_arm.driver.procedures import (
    Procedure,
    ProcedureEnd,
    calibrate,
    hold,
    release,
)
from katana450.extensions.real_arm.driver.readings import ArmReadings
from katana450.extensions.real_arm.link.arm_link import ArmLink
from katana450.extensions.real_arm.link.arm_url import ArmUrl
from katana450.extensions.real_arm.link.transport import ArmRefusalError
from katana450.extensions.real_arm.variants import DEFAULT_VARIANT

QUESTIONS = {
    ArmAct.CALIBRATE: (
        f"{HAZARDS[ArmAct.CALIBRATE]} Continue?",
        "Is the space clear, and is your hand on the switch?",
    ),
    ArmAct.RELEASE: (
        f"{HAZARDS[ArmAct.RELEASE]} Continue?",
        "Do you hold the arm now?",
    ),
}
"""The two questions before each act."""

YES = "yes"

PROCEDURES: dict[ArmAct, Callable[[ArmReadings], Procedure]] = {
    ArmAct.CALIBRATE: lambda arm: calibrate(arm, DEFAULT_VARIANT),
    ArmAct.RELEASE: lambda arm: release(arm, DEFAULT_VARIANT),
}


def operate(options: Namespace) -> int:
    """Run ``arm calibrate`` or ``arm release``; return the exit status. Raises KatanaError."""
    act = ArmAct(options.act)
    url = ArmUrl.parse(options.url)
    print(STOP_BUTTON)
    if not _is_confirmed(act, options):
        print("katana450: Nothing was done.", file=sys.stderr)
        return 1
    link, arm = ArmLink(url.open()), ArmReadings()
    try:
        end = perform(PROCEDURES[act](arm), link, arm)
    except KeyboardInterrupt:
        # Ctrl-C must not leave the arm moving. It may have come in the middle of an exchange, so
        # the connection cannot be used any more.
        link.close()
        link = ArmLink(url.open())
        perform(hold(arm, DEFAULT_VARIANT), link, arm)
        print("katana450: Interrupted. The arm was frozen.", file=sys.stderr)
        return 130
    finally:
        link.close()
    if end.note:
        print(end.note)
    if act is ArmAct.CALIBRATE and end.mode is ArmMode.HOLDING:
        print(f"Calibrated. Encoders: {' '.join(map(str, arm.positions))}")
    return int(end.mode is ArmMode.FAULT)


def perform(procedure: Procedure, link: ArmLink, arm: ArmReadings) -> ProcedureEnd:
    """Perform ``procedure`` with the arm behind ``link``, and return its end.

    Raises LinkLostError, and ArmRefusalError if the procedure cannot do without a refused request.
    """
    refusal: ArmRefusalError | None = None
    while True:
        try:
            step = next(procedure) if refusal is None else procedure.throw(refusal)
        except StopIteration as done:
            end: ProcedureEnd = done.value
            return end
        refusal = None
        if isinstance(step, float | int):
            time.sleep(step)
            continue
        try:
            arm.note(link.exchange(step), time.monotonic())
        except ArmRefusalError as error:
            refusal = error


def _is_confirmed(act: ArmAct, options: Namespace) -> bool:
    """Ask the questions, or return whether the option confirms them where nobody can be asked."""
    if not sys.stdin.isatty():
        if not options.confirmed:
            raise InputError(
                f"{HAZARDS[act]} Nobody can be asked here: run this in a terminal, or add "
                "--yes-i-hold-the-arm."
            )
        return True
    return all(
        input(f"{question} [{YES}/no] ").strip().lower() == YES for question in QUESTIONS[act]
    )

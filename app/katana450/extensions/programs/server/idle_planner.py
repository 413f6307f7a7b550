"""Planning of the scripts of the library while nobody uses the server.

So a demonstration begins at once when somebody asks for it. A plan is for one situation of the arm
and its scene, and is void in another one.
"""

from __future__ import annotations

from collections.abc import Callable

from katana450.arm.control.arm import ArmModel
from katana450.arm.control.state import State
from katana450.errors import KatanaError
from katana450.extensions.programs.script.script import parse
from katana450.extensions.programs.script.script_files import LIBRARY, script_text
from katana450.extensions.programs.server.program_planning import Planning

DELAY = 10.0
"""[s] Time without any use of the server after which planning begins."""

SPEED = 1.0
"""Fraction of a script's own speed for which it is planned: that of the buttons of the page."""

FIRST = "pour.yaml"
"""The script that a new user is offered, which is planned first."""


class IdlePlanner:
    """The planner of one script of the library after another, each for the present situation."""

    def __init__(self, plan: Callable[[str, float], Planning], arm: ArmModel) -> None:
        """Prepare to plan.

        Args:
            plan: starts to plan a script with a speed from the present situation.
            arm: the arm; scripts that do not suit it are left out.
        """
        self._plan = plan
        self._texts = _texts(arm)
        # Replaced and never changed: a command of any thread cancels the planning.
        self._plannings: tuple[Planning, ...] = ()
        self._used: float | None = None

    def tick(self, state: State, t: float, *, used: bool) -> None:
        """Begin or cancel planning.

        Args:
            state: the present state of the arm.
            t: time [s].
            used: whether somebody uses the arm or plans a program, or nobody watches it.
        """
        since = self._used
        if used or state.moving or since is None:
            self.cancel()
            self._used = t
        elif t - since >= DELAY and not any(each.busy for each in self._plannings):
            kept = tuple(each for each in self._plannings if not each.changed_to(state))
            known = [each.text for each in kept]
            text = next((each for each in self._texts if each not in known), None)
            if text is not None:
                kept = (*kept, self._plan(text, SPEED))
            self._plannings = kept
            if self._used is None:
                # A command came meanwhile.
                self.cancel()

    def cancel(self) -> None:
        """Cancel the planning that is under way, keep what is planned, and wait again."""
        self._used = None
        for each in self._plannings:
            each.cancel("The server is in use.")
        self._plannings = tuple(each for each in self._plannings if each.cancelled is None)

    def take(self, text: str, speed: float, state: State) -> Planning | None:
        """Return the planning of ``text`` that is done or under way for ``state``, and forget it.

        Returns None if there is none.
        """
        for each in self._plannings:
            same = (each.text, each.speed) == (text, speed) and each.refused is None
            if same and not each.changed_to(state):
                self._plannings = tuple(other for other in self._plannings if other is not each)
                return each
        return None


def _texts(arm: ArmModel) -> list[str]:
    """Return the scripts of the library that suit ``arm``."""
    found = []
    for path in sorted(LIBRARY.glob("*.yaml"), key=lambda each: (each.name != FIRST, each.name)):
        try:
            text = script_text(path)
            if parse(text).suits(arm):
                found.append(text)
        except KatanaError:
            # The panel reports it when the script is chosen.
            continue
    return found

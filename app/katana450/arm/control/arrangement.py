"""Transforms of a state by the commands about objects: where they are, and how they look."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from katana450.arm.control import commands as cmd
from katana450.arm.control import solid
from katana450.arm.control.looks import Choice, Look
from katana450.arm.control.pouring import Pouring
from katana450.arm.control.state import State
from katana450.arm.control.thing_commands import Dress, Shift
from katana450.arm.control.things import Environment, Thing, furnished_with, named, placed


def arranged(
    surroundings: Environment, pouring: Pouring | None, state: State, command: cmd.Command
) -> State:
    """``state`` after a command about objects, the water, or how they are shown."""
    x = state.x_setpoint
    match command:
        case cmd.Place(thing=thing):
            return replace(state, things=placed(state.things, thing))
        case cmd.Remove(name=name):
            return removed(state, name)
        case cmd.Shift():
            return shifted(state, command)
        case cmd.Dress():
            return dressed(state, command)
        case cmd.Attach(name=name, to=to):
            mounted = tuple(
                surroundings.mounted(each, to, x) if each.name == name else each
                for each in state.things
            )
            return replace(state, things=mounted)
        case cmd.Furnish(things=things, volume=volume):
            furnished = replace(state, things=furnished_with(state.things, things))
            return filled(pouring, furnished, volume)
        case cmd.Fill(volume=volume):
            return filled(pouring, state, volume)
    raise AssertionError(f"The table of transitions has no rule for {command!r}.")


def filled(pouring: Pouring | None, state: State, volume: float | None) -> State:
    """``state`` with ``volume`` [m^3] of water in the cup; None for no water."""
    if volume is None:
        return replace(state, poured=None)
    assert pouring is not None
    return replace(state, poured=pouring.fill(volume, state.things, state.x_setpoint))


def removed(state: State, name: str) -> State:
    """Without the thing of that name; what is held stays."""
    things = tuple(each for each in state.things if each.held or each.name != name)
    return replace(state, things=things)


def shifted(state: State, shift: Shift) -> State:
    """With the thing elsewhere, unless the hand has it."""

    def there(thing: Thing) -> Thing:
        if thing.name != shift.name or thing.carried:
            return thing
        T = np.array(thing.T)
        if shift.position is not None:
            T[:3, 3] = shift.position
        if shift.R is not None:
            T[:3, :3] = shift.R
        return replace(thing, T=T)

    return replace(state, things=tuple(map(there, state.things)))


def look_of(state: State, name: str) -> Look:
    """How the link or thing of that name is shown."""
    thing = named(state.things, name)
    return state.looks.of(name) if thing is None else _as_link(thing.look)


def dressed(state: State, dress: Dress) -> State:
    """With one trait of a look changed. Things bear theirs themselves."""

    def changed(thing: Thing) -> Thing:
        if thing.name != dress.name:
            return thing
        look = _as_link(thing.look).having(dress.trait, dress.value)
        return replace(thing, look=_as_thing(look))

    if any(each.name == dress.name for each in state.things):
        return replace(state, things=tuple(map(changed, state.things)))
    return replace(state, looks=state.looks.having(dress.name, dress.trait, dress.value))


PAINT = (204, 204, 204)
"""Of a thing that is to be painted when nobody has mixed a colour."""


def _as_link(look: solid.Look) -> Look:
    """A thing's look in the words for a link's."""
    painted = look.colour is not None or look.opacity < 1.0
    choice = Choice.HIDDEN if look.hidden else Choice.PAINTED if painted else Choice.MADE
    if look.colour is None:
        return Look(choice, None, 1.0 - look.opacity)
    red, green, blue = (part / 255.0 for part in look.colour)
    return Look(choice, (red, green, blue), 1.0 - look.opacity)


def _as_thing(look: Look) -> solid.Look:
    """The other way; a thing as it is made has no paint to come back to."""
    if look.choice is Choice.MADE:
        return solid.PLAIN
    colour = None if look.choice is Choice.HIDDEN else PAINT
    if look.colour is not None:
        red, green, blue = (round(255.0 * part) for part in look.colour)
        colour = red, green, blue
    opacity = max(1.0 - look.transparency, solid.FAINTEST)
    return solid.Look(colour, opacity, look.choice is Choice.HIDDEN)

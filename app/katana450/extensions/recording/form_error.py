"""The error of a value that has no text form, or of a text form that does not give a value."""

from __future__ import annotations

from katana450.errors import InputError


class FormError(InputError):
    """A form is invalid.

    Attributes:
        text: the reason.
        place: names of the fields, and numbers of the items, that lead to the value.
    """

    def __init__(self, text: str, place: tuple[str | int, ...] = ()) -> None:
        """State the reason ``text`` and the ``place`` of the value."""
        self.text, self.place = text, place
        where = "".join(f"[{each}]" if isinstance(each, int) else f".{each}" for each in place)
        super().__init__(f"{where.removeprefix('.')}: {text}" if place else text)

    def within(self, step: str | int) -> FormError:
        """Return the same error, with its value in the field or item ``step`` of another."""
        return FormError(self.text, (step, *self.place))


def shown(form: object) -> str:
    """Return ``form`` for an error message, shortened."""
    text = repr(form)
    return text if len(text) <= 60 else f"{text[:60]}..."

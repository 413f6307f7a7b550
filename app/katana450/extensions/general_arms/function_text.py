"""The lines of a function that is written out, from its terms."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence

from katana450.extensions.general_arms.functions import Number
from katana450.extensions.general_arms.term import COMPARISONS, Fork, Need, Term, TermBlock


class FunctionText:
    """The text of terms, in which those that are used more than once have names.

    What only the rare way of a fork needs is computed there.
    """

    def __init__(self, block: TermBlock, outputs: Sequence[Sequence[Number]]) -> None:
        needs = [each for each in block.items if isinstance(each, Need)]
        values = [
            *(each for row in outputs for each in row),
            *(each for need in needs for each in need.conditions),
        ]
        self._uses = _uses(values, rarely=True)
        self._often = _uses(values, rarely=False)
        self._named: dict[int, int] = {}
        self._values: dict[int, int] = {}
        self.lines = list(self._lines(block))

    def of(self, value: Number) -> str:
        """Return the text of ``value``."""
        if not isinstance(value, Term):
            return repr(float(value))
        if value.number in self._named:
            return f"t{self._named[value.number]}"
        return value.text.format(*map(self.of, value.arguments))

    def _lines(self, block: TermBlock) -> Iterator[str]:
        for item in block.items:
            if isinstance(item, Need):
                yield f"if not ({' and '.join(map(self.of, item.conditions))}): return None"
            elif isinstance(item, Fork):
                yield from self._forked(item)
            elif item.number in self._often:
                yield from self._named_line(item)

    def _named_line(self, term: Term) -> Iterator[str]:
        if self._is_named(term):
            name = self._values.get(term.number, term.number)
            yield f"t{name} = {self.of(term)}"
            self._named[term.number] = name

    def _is_named(self, term: Term) -> bool:
        if self._uses.get(term.number, 0) < 2 or _is_short(term):
            return False
        # A comparison of what has a name costs no more than its result.
        return term.text not in COMPARISONS or not all(
            self._uses[each.number] > 1 for each in term.arguments if isinstance(each, Term)
        )

    def _forked(self, fork: Fork) -> Iterator[str]:
        used = [k for k, term in enumerate(fork.terms) if term.number in self._uses]
        if not used:
            return
        outside, values_outside = dict(self._named), self._values
        for k, head in enumerate((f"if {self.of(fork.condition)}:", "else:")):
            values = [fork.values[k][place] for place in used]
            # A value that has a name in this way gets that of the fork at once.
            self._values = {
                value.number: fork.terms[place].number
                for place, value in zip(used, values, strict=True)
                if isinstance(value, Term) and value.number not in outside
            }
            yield head
            if k == fork.rare:
                waiting = [each for each in _reached(values) if each.number not in outside]
                for term in sorted(waiting, key=lambda each: each.number):
                    yield from (f"    {line}" for line in self._named_line(term))
            else:
                yield from (f"    {line}" for line in self._lines(fork.blocks[k]))
            for place, value in zip(used, values, strict=True):
                name = f"t{fork.terms[place].number}"
                if self.of(value) != name:
                    yield f"    {name} = {self.of(value)}"
            self._named, self._values = dict(outside), values_outside


def _uses(values: Iterable[Number], *, rarely: bool) -> dict[int, int]:
    """Return how often the text has each term, by its number; ``rarely``: also in rare ways."""
    found: dict[int, int] = {}
    forks: set[int] = set()
    waiting = list(values)
    while waiting:
        term = waiting.pop()
        if not isinstance(term, Term):
            continue
        found[term.number] = found.get(term.number, 0) + 1
        if found[term.number] > 1:
            continue
        for k, each in enumerate(term.arguments):
            waiting += [each] * term.text.count(f"{{{k}}}")
        if term.forked is not None:
            fork, place = term.forked
            waiting += [
                values[place] for k, values in enumerate(fork.values) if rarely or k != fork.rare
            ]
            if id(fork) not in forks:
                forks.add(id(fork))
                waiting.append(fork.condition)
    return found


def _reached(values: Iterable[Number]) -> list[Term]:
    """Return the terms of which ``values`` are made."""
    found: dict[int, Term] = {}
    waiting = list(values)
    while waiting:
        term = waiting.pop()
        if isinstance(term, Term) and term.number not in found:
            found[term.number] = term
            waiting += term.arguments
    return list(found.values())


def _is_short(term: Term) -> bool:
    """Return whether a term is an input, or made of a free angle, which is rarely used."""
    return all(isinstance(each, Term) and each.text.startswith("free") for each in term.arguments)

"""Randomization terms: what is drawn anew for each world, episode or push, and within which range."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import ClassVar

from kine2go_warp.env.terms.base import check_names, find_term
from kine2go_warp.errors import Kine2GoError
from kine2go_warp.quantities import PUSH_PARAMETERS, RANDOMIZED_PARAMETERS, RandomizedParameter
from kine2go_warp.settings import Named, check_ranges

INFINITE = float("inf")
PARAMETERS = {one.name: one for one in (*RANDOMIZED_PARAMETERS, *PUSH_PARAMETERS)}

Range = tuple[float, ...]
"""Least and greatest value of something that is drawn uniformly; empty if it is not drawn."""


@dataclass(frozen=True)
class RandomizationTerm(Named):
    """A uniform distribution of one parameter of the worlds.

    Several terms may draw the same parameter: each scales, shifts or sets what the one before has left, as the
    parameter's ``operation`` says. A term cannot reach other arrays of the model: the solver must be told of a change,
    and datasets and snapshots must hold it, which they do for what ``quantities.RANDOMIZED_PARAMETERS`` lists.
    """

    main_field: ClassVar[str] = "range"

    range: Range = ()
    """Least and greatest value; empty if it is not drawn."""
    parameter: str = ""
    """What is drawn, one of ``PARAMETERS``; by default the one of the term's own name."""
    shared: bool = False
    """Whether all joints, or axes, of a world share one draw."""

    def __post_init__(self) -> None:
        if self.drawn_name not in PARAMETERS:
            known = ", ".join(PARAMETERS)
            raise Kine2GoError(f"{self.name} draws an unknown parameter '{self.drawn_name}'; known are: {known}")
        if len(self.range) not in (0, 2) or (self.range and not self.range[0] <= self.range[1]):
            raise Kine2GoError(f"{self.name} is {list(self.range)}; it must be empty or [least, greatest]")
        check_ranges(self, range=(-INFINITE, INFINITE))
        if self.drawn.operation != "add" and any(value < 0.0 for value in self.range):
            raise Kine2GoError(f"{self.name} is {list(self.range)}; it must not be negative")

    @property
    def drawn_name(self) -> str:
        """Name of what is drawn."""
        return self.parameter or self.name

    @property
    def drawn(self) -> RandomizedParameter:
        """What is drawn."""
        return PARAMETERS[self.drawn_name]


RANDOMIZATION = tuple(RandomizationTerm(name) for name in PARAMETERS)
"""All parameters, none of them drawn."""


def randomized(terms: tuple[RandomizationTerm, ...] = RANDOMIZATION, **ranges: Range) -> tuple[RandomizationTerm, ...]:
    """Return terms with other ranges, such as ``friction=(0.5, 1.2)``.

    Raises:
        Kine2GoError: there is no such term, or a range is impossible.
    """
    changed = {name: replace(find_term(terms, name), range=limits) for name, limits in ranges.items()}
    terms = tuple(changed.get(term.name, term) for term in terms)
    check_randomization(terms)
    return terms


def active(terms: Sequence[RandomizationTerm], name: str) -> tuple[RandomizationTerm, ...]:
    """Return the terms that draw a parameter."""
    return tuple(term for term in terms if term.range and term.drawn_name == name)


def check_randomization(terms: Sequence[RandomizationTerm]) -> None:
    """Check that names differ and that pushes have both of their ranges, once each.

    Raises:
        Kine2GoError: they do not.
    """
    check_names(terms, "randomization")
    counts = {len(active(terms, one.name)) for one in PUSH_PARAMETERS}
    if counts not in ({0}, {1}):
        raise Kine2GoError(f"{' and '.join(one.name for one in PUSH_PARAMETERS)} are needed together, once each")

"""Termination terms: the conditions that end an episode."""

from dataclasses import dataclass

from kine2go_warp.env.terms.base import Params, Term, with_term
from kine2go_warp.errors import Kine2GoError

_KERNELS = "kine2go_warp.kernels.terminations"


@dataclass(frozen=True)
class TerminationTerm(Term):
    """One condition that ends an episode. Its kernel writes 1 where the condition holds, else 0.

    Where several hold, the first of the list is the reason, but a failure comes before a time-out.
    """

    unit: str = ""
    """Of its limit."""
    description: str = ""
    is_fault: bool = False
    """Whether it is the simulation's fault, not the policy's: it is counted, and ``--strict`` stops at it."""
    is_time_out: bool = False
    """Whether it is no failure: what would have followed is estimated by the value function."""
    enabled: bool = True
    """Whether it ends episodes at all; a fault always does."""

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.is_fault and not self.enabled:
            raise Kine2GoError(f"enabled is false, but {self.name} is a fault of the simulation")
        for name, value in self.params:
            if name.startswith("max_") and not value > 0.0:
                raise Kine2GoError(f"params of {self.name} have {name} {value:g}; it must be positive")


def _term(name: str, description: str, params: Params = (), unit: str = "", **kind: bool) -> TerminationTerm:
    """Return a term of the package's own kernel of that name."""
    return TerminationTerm(name, f"{_KERNELS}:{name}", params, unit, description, **kind)


TERMINATIONS = (
    _term("non_finite", "a coordinate is not a finite number", is_fault=True),
    _term("overflow", "the solver dropped contacts or constraints for which its buffers had no room", is_fault=True),
    _term("body_contact", "base or head touches the ground, but for where the reference does"),
    _term("distance", "the root is too far from its reference", (("max_distance", 1.0),), "m"),
    _term("rotation", "the root is turned too far from its reference", (("max_angle", 1.5708),), "rad"),
    _term(
        "time_out",
        "the longest time has passed, or a motion that is played once is over; the only end that is bootstrapped",
        is_time_out=True,
    ),
)
"""The paper's conditions (appendix, hyperparameter table, "Termination") and the simulation's faults."""


TRACKING = ("distance", "rotation")
"""Terms that end episodes whose root has left the reference."""


def with_limits(
    max_distance: float, max_angle: float, terms: tuple[TerminationTerm, ...] = TERMINATIONS
) -> tuple[TerminationTerm, ...]:
    """Return terms with limits of the root from its reference [m, rad], which are added where they are missing."""
    names = {term.name for term in terms}
    terms += tuple(term for term in TERMINATIONS if term.name in TRACKING and term.name not in names)
    terms = with_term(terms, "distance", max_distance=max_distance, enabled=True)
    return with_term(terms, "rotation", max_angle=max_angle, enabled=True)

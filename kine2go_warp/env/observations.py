"""The layout of the observation: one table for the environment, the policy's users and the documentation."""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import product
from typing import Any

from kine2go_warp.env.config import EnvConfig
from kine2go_warp.env.terms.observations import ObservationTerm
from kine2go_warp.quantities import LEG_NAMES
from kine2go_warp.robots import RobotSpec


@dataclass(frozen=True)
class ObservationField:
    """One row of the observation table."""

    name: str
    start: int
    stop: int
    unit: str
    description: str


@dataclass(frozen=True)
class PlacedTerm:
    """A term and where its values stand in the observation."""

    term: ObservationTerm
    start: int
    offset: int = 0
    """Control steps from now: negative in the history, positive for the reference."""
    is_alone: bool = False
    """Whether it is observed at one instant only."""

    @property
    def field(self) -> ObservationField:
        """The row of the table."""
        instant = "" if self.is_alone else f"[t{self.offset:+d}]" if self.offset else "[t]"
        term = self.term
        return ObservationField(term.name + instant, self.start, self.start + term.size, term.unit, term.description)


def state_size(config: EnvConfig) -> int:
    """Return the number of values in one state of the history."""
    return sum(term.size for term in enabled(config.observations))


def observation_size(config: EnvConfig) -> int:
    """Return the number of values in an observation."""
    last = place_terms(config)[-1]
    return last.start + last.term.size


def privileged_size(config: EnvConfig) -> int:
    """Return the number of values that only the critic sees, 0 without ``privileged``."""
    return sum(term.size for term in enabled(config.privileged_observations)) if config.privileged else 0


def place_terms(config: EnvConfig) -> tuple[PlacedTerm, ...]:
    """Return what stands where: the states from new to old, then the references from near to far."""
    blocks = [(-age, enabled(config.observations)) for age in range(config.history_length)]
    blocks += [(ahead, enabled(config.reference_observations)) for ahead in config.steps_ahead]
    placed, start = [], 0
    for offset, terms in blocks:
        for term in terms:
            placed.append(PlacedTerm(term, start, offset))
            start += term.size
    return tuple(placed)


def place_privileged(config: EnvConfig) -> tuple[PlacedTerm, ...]:
    """Return what stands where in the critic's own observation."""
    placed, start = [], 0
    for term in enabled(config.privileged_observations):
        placed.append(PlacedTerm(term, start, is_alone=True))
        start += term.size
    return tuple(placed)


def observation_layout(config: EnvConfig) -> tuple[ObservationField, ...]:
    """Return the rows of the observation table."""
    return tuple(placed.field for placed in place_terms(config))


def observation_record(config: EnvConfig, spec: RobotSpec) -> list[dict[str, Any]]:
    """Return name, unit, meaning and columns of each part of the observation, as a dataset keeps them."""
    labels = {"axis": ("x", "y", "z"), "joint": spec.joint_names, "foot": LEG_NAMES}
    record = []
    for placed in place_terms(config):
        field = placed.field
        parts = ("".join(f".{label}" for label in one) for one in product(*(labels[dim] for dim in placed.term.dims)))
        columns = [field.name + part for part in parts]
        record.append({"name": field.name, "unit": field.unit, "description": field.description, "columns": columns})
    return record


def enabled(terms: Sequence[ObservationTerm]) -> tuple[ObservationTerm, ...]:
    """Return the terms that are observed."""
    return tuple(term for term in terms if term.enabled)

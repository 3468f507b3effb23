"""What a sequence of motions says of its parts."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from kine2go_warp.errors import CatalogueError
from kine2go_warp.tables import counted


@dataclass(frozen=True)
class Part:
    """A motion within a sequence of motions."""

    name: str
    """Of the motion."""
    cycles: int = 0
    """How often a cycle is repeated."""
    seconds: float = 0.0
    """Or for how long at least [s]; without either for ``sequence.CYCLE_TIME``."""


def parse_parts(values: Sequence[Any], where: str) -> tuple[Part, ...]:
    """Return the parts that a catalogue lists.

    Args:
        values: Names, or tables of a motion and how often or for how long it is repeated.
        where: File and line.

    Raises:
        CatalogueError: one is neither, or there are fewer than two.
    """
    parts = []
    for one in values:
        table: Any = {"motion": one} if isinstance(one, str) else one
        cycles, seconds = (table.get(key, 0) if isinstance(table, dict) else -1 for key in ("cycles", "seconds"))
        is_known = isinstance(table, dict) and set(table) <= {"motion", "cycles", "seconds"}
        is_number = type(cycles) is int and type(seconds) in (int, float)
        is_known = is_known and is_number and 0 <= cycles <= 1000 and 0 <= seconds <= 600
        if not is_known or not isinstance(table.get("motion"), str) or (cycles and seconds):
            example = '{ motion = "walk", cycles = 4 } or { motion = "walk", seconds = 3.0 }'
            raise CatalogueError(f'{where}: parts has {one!r:.60}; each is a name, as in "walk", or {example}')
        parts.append(Part(table["motion"], cycles, float(seconds)))
    if len(parts) < 2:
        raise CatalogueError(f"{where}: parts names {counted(len(parts), 'motion')}; a sequence has at least two")
    return tuple(parts)

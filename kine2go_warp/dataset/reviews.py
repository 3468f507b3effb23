"""What people said of trajectories, kept in the dataset's folder beside the motions.

A verdict belongs to the content of a trajectory: it holds wherever the same rows are found in the motion, also after
gathering again, and lapses when the rows have changed.
"""

import getpass
import hashlib
import json
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass, fields
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import numpy as np

from kine2go_warp.dataset.motion import Motion, Trajectory, TrajectoryReference
from kine2go_warp.errors import DatasetError
from kine2go_warp.files import atomic_file, locked

FILE = "verdicts.json"
LOCK = ".verdicts.lock"
ACCEPTED, REJECTED = "accepted", "rejected"
FORMAT_VERSION = 1

STORED_NAMES = {"content_hash": "content", "reason": "why", "reviewer": "who"}
"""Names of fields in the file, where they differ."""


@dataclass(frozen=True)
class Review:
    """What a reviewer said of one trajectory."""

    motion: str
    index: int
    """Trajectory index at review time; it may change when the motion is gathered again."""
    content_hash: str
    """Of its rows."""
    verdict: str
    """``ACCEPTED`` or ``REJECTED``."""
    reason: str
    reviewer: str
    when: str
    """Date and time, ISO 8601 with the time zone."""

    @classmethod
    def from_json(cls, values: Any) -> "Review":
        """Return a review from a JSON object.

        Raises:
            ValueError: it is none.
        """
        names = {STORED_NAMES.get(field.name, field.name): field.name for field in fields(cls)}
        types = {stored: int if name == "index" else str for stored, name in names.items()}
        if not isinstance(values, dict) or {name: type(value) for name, value in values.items()} != types:
            raise ValueError(f"a verdict has {', '.join(types)}, not {str(values)[:80]}")
        if values["verdict"] not in (ACCEPTED, REJECTED):
            raise ValueError(f"a verdict is '{ACCEPTED}' or '{REJECTED}', not '{values['verdict'][:80]}'")
        return cls(**{name: values[stored] for stored, name in names.items()})

    def to_json(self) -> dict[str, Any]:
        """Return it as it is stored."""
        return {STORED_NAMES.get(name, name): value for name, value in asdict(self).items()}


def new_review(trajectory: Trajectory, verdict: str, reason: str, reviewer: str | None = None) -> Review:
    """Return a review of this moment.

    Args:
        trajectory: The trajectory with all its row arrays.
        verdict: ``ACCEPTED`` or ``REJECTED``.
        reason: Why.
        reviewer: Name of the person; by default the name that is logged in.
    """
    when = datetime.now(UTC).isoformat(timespec="seconds")
    return Review(
        trajectory.motion, trajectory.index, content_hash(trajectory), verdict, reason, reviewer or user(), when
    )


def user() -> str:
    """Return the name that is logged in, or ``unknown``."""
    try:
        return getpass.getuser()
    except (KeyError, OSError):
        return "unknown"


def content_hash(trajectory: Trajectory) -> str:
    """Return a hash of all rows of a trajectory: names, types and values of its arrays."""
    digest = hashlib.sha256()
    for name in sorted(trajectory.arrays):
        values = np.ascontiguousarray(trajectory.arrays[name])
        digest.update(f"{name} {values.dtype.str} {values.shape} ".encode())
        digest.update(values.tobytes())
    return digest.hexdigest()[:32]


def read_reviews(dataset: Path) -> tuple[Review, ...]:
    """Return all verdicts of a dataset, the oldest first, also those that have lapsed.

    Raises:
        DatasetError: the file cannot be read.
    """
    path = dataset / FILE
    try:
        content = json.loads(path.read_text(encoding="utf-8"))
    except FileNotFoundError:
        return ()
    except ValueError as error:
        raise DatasetError(f"{path}: not a file of verdicts ({error}); mend or remove it") from None
    if not isinstance(content, dict) or content.get("format_version") != FORMAT_VERSION:
        raise DatasetError(f"{path}: not a file of verdicts of format {FORMAT_VERSION}; mend or remove it")
    try:
        return tuple(Review.from_json(values) for values in content["verdicts"])
    except (KeyError, TypeError, ValueError) as error:
        raise DatasetError(f"{path}: {error}; mend or remove it") from None


def add_reviews(dataset: Path, verdicts: Sequence[Review]) -> None:
    """Add verdicts to those of a dataset; several processes may do so at once.

    Raises:
        DatasetError: the file that is there cannot be read.
    """
    _change(dataset, lambda known: (*known, *verdicts))


def remove_review(dataset: Path, verdict: Review) -> None:
    """Take a verdict back, the last one that is equal.

    Raises:
        DatasetError: the file cannot be read.
    """

    def without(known: tuple[Review, ...]) -> tuple[Review, ...]:
        places = [place for place, one in enumerate(known) if one == verdict]
        return known if not places else known[: places[-1]] + known[places[-1] + 1 :]

    _change(dataset, without)


def withdraw_reviews(dataset: Path, trajectories: Sequence[Trajectory]) -> int:
    """Take all verdicts on some trajectories back and return how many there were.

    Args:
        dataset: Folder of the dataset.
        trajectories: With all their row arrays.

    Raises:
        DatasetError: the file cannot be read.
    """
    named = {(one.motion, content_hash(one)) for one in trajectories}
    before = len(read_reviews(dataset))
    _change(dataset, lambda known: tuple(one for one in known if (one.motion, one.content_hash) not in named))
    return before - len(read_reviews(dataset))


def standing_reviews(motion: Motion, verdicts: Sequence[Review] | None = None) -> dict[int, Review]:
    """Return the last verdict on each trajectory of a motion that has one, by the place of the trajectory now.

    Rows are read only where there are verdicts: those of the trajectories that the verdicts name, and all others only
    if one of these has changed.

    Args:
        motion: The motion.
        verdicts: Verdicts of its dataset; by default they are read.

    Raises:
        DatasetError: the file of verdicts or an array cannot be read.
    """
    known = read_reviews(motion.path) if verdicts is None else verdicts
    last = {one.content_hash: one for one in known if one.motion == motion.name}
    if not last:
        return {}
    references = [one for one in motion.references() if one.length > 0]
    named = {one.index for one in last.values()}
    found = _matching(motion, [one for one in references if one.index in named], last)
    if {one.content_hash for one in found.values()} != set(last):
        found |= _matching(motion, [one for one in references if one.index not in named], last)
    return dict(sorted(found.items()))


def _matching(motion: Motion, references: Sequence[TrajectoryReference], last: dict[str, Review]) -> dict[int, Review]:
    """Return which of some trajectories have a verdict on their content."""
    contents = ((one.index, content_hash(one)) for one in motion.read(references, None))
    return {index: last[content] for index, content in contents if content in last}


def _change(dataset: Path, change: Callable[[tuple[Review, ...]], tuple[Review, ...]]) -> None:
    """Read, change and write the verdicts while nobody else does."""
    with locked(dataset / LOCK, wait=True):
        verdicts = [one.to_json() for one in change(read_reviews(dataset))]
        text = json.dumps({"format_version": FORMAT_VERSION, "verdicts": verdicts}, indent=1, ensure_ascii=False)
        with atomic_file(dataset / FILE) as temporary:
            temporary.write_text(text + "\n", encoding="utf-8")

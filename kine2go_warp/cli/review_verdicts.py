"""Verdicts that are given, listed and taken back by options."""

from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from kine2go_warp.cli.texts import say
from kine2go_warp.dataset.access import open_dataset
from kine2go_warp.dataset.reviews import (
    ACCEPTED,
    REJECTED,
    Review,
    add_reviews,
    new_review,
    read_reviews,
    standing_reviews,
    withdraw_reviews,
)
from kine2go_warp.errors import DatasetError
from kine2go_warp.tables import counted, make_table

if TYPE_CHECKING:
    from kine2go_warp.dataset.motion import Motion, Trajectory


def keep(dataset: Path, accept: Sequence[str], reject: Sequence[str], reason: str, reviewer: str | None) -> int:
    """Keep verdicts on trajectories that are named, MOTION or MOTION/K.

    Raises:
        DatasetError: there is no such motion or trajectory, or one has both verdicts.
    """
    both = set(accept) & set(reject)
    if both:
        raise DatasetError(f"'{min(both)}' is both accepted and rejected")
    reviews = [
        new_review(one, verdict, reason, reviewer)
        for verdict, names in ((ACCEPTED, accept), (REJECTED, reject))
        for name in names
        for one in named(dataset, name)
    ]
    add_reviews(dataset, reviews)
    for verdict in (ACCEPTED, REJECTED):
        count = sum(one.verdict == verdict for one in reviews)
        if count:
            say(f"{dataset}: {counted(count, 'trajectory')} {verdict}")
    return 0


def accept_rest(dataset: Path, motions: "Sequence[Motion]", reason: str, reviewer: str | None) -> int:
    """Accept every trajectory of some motions that has no verdict."""
    reviews = [new_review(one, ACCEPTED, reason, reviewer) for motion in motions for one in without_verdict(motion)]
    add_reviews(dataset, reviews)
    say(f"{dataset}: {counted(len(reviews), 'trajectory')} {ACCEPTED}, all that had no verdict")
    return 0


def without_verdict(motion: "Motion") -> "Iterator[Trajectory]":
    """Yield the trajectories of a motion that have no verdict."""
    done = standing_reviews(motion)
    yield from motion.read([one for one in motion.references() if one.length > 0 and one.index not in done], None)


def withdraw(dataset: Path, names: Sequence[str]) -> int:
    """Take all verdicts on trajectories that are named back.

    Raises:
        DatasetError: there is no such motion or trajectory.
    """
    count = withdraw_reviews(dataset, [one for name in names for one in named(dataset, name)])
    say(f"{dataset}: {counted(count, 'verdict')} withdrawn")
    return 0


def print_reviews(dataset: Path, motions: "Sequence[Motion]") -> int:
    """Print the verdicts on trajectories of some motions, and how many have lapsed with the rows that they were on."""
    from kine2go_warp.cli.tables import print_table

    reviews = read_reviews(dataset)
    rows, standing = [], set[Review]()
    for motion in motions:
        for index, one in standing_reviews(motion, reviews).items():
            standing.add(one)
            rows.append((f"{motion.name}/{index}", one.verdict, one.reason, one.reviewer, one.when))
    headings = ("trajectory", "verdict", "reason", "reviewer", "when")
    print_table(make_table(str(dataset), headings, rows, headings))
    # An earlier verdict on the same rows is neither in force nor lapsed.
    contents = {(one.motion, one.content_hash) for one in standing}
    names = {motion.name for motion in motions}
    lapsed = {(one.motion, one.content_hash) for one in reviews if one.motion in names} - contents
    counts = (sum(row[1] == verdict for row in rows) for verdict in (ACCEPTED, REJECTED))
    say("{} accepted, {} rejected, {} lapsed since their rows have changed".format(*counts, len(lapsed)))
    return 0


def named(dataset: Path, name: str) -> "list[Trajectory]":
    """Return the trajectories that MOTION or MOTION/K stands for, with all arrays.

    Raises:
        DatasetError: there is no such motion or trajectory.
    """
    motion_name, slash, number = name.partition("/")
    motion = open_dataset(dataset).motion(motion_name)
    references = [one for one in motion.references() if one.length > 0]
    if slash:
        references = [one for one in references if str(one.index) == number]
    if not references:
        count = len(motion.lengths)
        raise DatasetError(f"{dataset}: no trajectory '{name}'; {motion_name} has {count}, 0 to {count - 1}")
    return list(motion.read(references, None))

"""Going through trajectories in the terminal, one key a verdict."""

import math
import shutil
import sys
import textwrap
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path

from kine2go_warp.cli.data import check_data
from kine2go_warp.cli.review_views import Views
from kine2go_warp.cli.texts import printable, say
from kine2go_warp.dataset.limit_usage import STORED, LimitUsage, limit_usages
from kine2go_warp.dataset.motion import Motion
from kine2go_warp.dataset.reviews import (
    ACCEPTED,
    REJECTED,
    Review,
    add_reviews,
    new_review,
    remove_review,
    standing_reviews,
)
from kine2go_warp.errors import Kine2GoError
from kine2go_warp.metrics import FILTER_METRICS
from kine2go_warp.tables import counted

HELP = "a accept, r reject, s skip, u undo, t accept this and all that follow, f film, q quit"


@dataclass
class Steps:
    """A walk through trajectories: where it is, and what was said on the way."""

    dataset: Path
    motions: dict[str, Motion]
    queue: list[LimitUsage]
    who: str | None
    views: Views
    place: int = 0
    said: list[Review | None] = field(default_factory=list)
    """Of each trajectory before the present one; None where it was skipped."""

    @property
    def present(self) -> LimitUsage | None:
        """The trajectory to look at, None at the end."""
        return self.queue[self.place] if self.place < len(self.queue) else None

    def judge(self, verdict: str, why: str) -> None:
        """Keep a verdict on the present trajectory and go on."""
        reference = self.queue[self.place].reference
        (one,) = self.motions[reference.motion].read([reference], None)
        given = new_review(one, verdict, why, self.who)
        add_reviews(self.dataset, [given])
        self._go_on(given)

    def skip(self) -> None:
        """Go on without a verdict."""
        self._go_on(None)

    def undo(self) -> bool:
        """Go back by one trajectory and take its verdict back; return whether there was one before."""
        if not self.said:
            return False
        given = self.said.pop()
        if given is not None:
            remove_review(self.dataset, given)
        self.place -= 1
        return True

    def count(self, verdict: str) -> int:
        """Return how many trajectories were accepted or rejected on the way."""
        return sum(given is not None and given.verdict == verdict for given in self.said)

    def _go_on(self, given: Review | None) -> None:
        self.said.append(given)
        self.place += 1


def step_through(
    dataset: Path,
    motions: Sequence[Motion],
    who: str | None,
    again: bool,
    views: Views,
    by: str = "",
    worst: int | None = None,
) -> int:
    """Go through trajectories until the end, ``q``, or the end of the input.

    Args:
        dataset: The dataset.
        motions: Its motions to go through.
        who: Name of the person; by default the one that is logged in.
        again: Also show trajectories that have a verdict.
        views: What shows the trajectory in question.
        by: The metric by whose limit they are ordered.
        worst: Only so many.

    Raises:
        DatasetError: data of a motion are missing.
    """
    queue = by_limit_usage(motions, again, by)[:worst]
    steps = Steps(dataset, {motion.name: motion for motion in motions}, queue, who, views)
    say(f"{counted(len(queue), 'trajectory')} to look at, those closest to a limit first; {HELP}")
    while (usage := steps.present) is not None:
        motion = steps.motions[usage.reference.motion]
        say(f"\n[{steps.place + 1}/{len(queue)}] {described(usage, motion)}")
        views.show(motion, usage)
        if not answer(steps):
            break
    left = len(queue) - steps.place
    skipped = len(steps.said) - steps.count(ACCEPTED) - steps.count(REJECTED)
    say(
        f"\n{dataset}: {steps.count(ACCEPTED)} accepted, {steps.count(REJECTED)} rejected, {skipped} skipped, "
        f"{left} not looked at"
    )
    return 0


def by_limit_usage(motions: Sequence[Motion], again: bool, by: str = "") -> list[LimitUsage]:
    """Return the trajectories to look at, those closest to a limit first, or to that of one metric.

    Raises:
        DatasetError: data of a motion are missing.
    """
    from rich.console import Console

    from kine2go_warp.cli.progress import tracked

    found: list[LimitUsage] = []
    for motion in tracked(motions, "reading", Console(stderr=True)):
        done = set() if again else set(standing_reviews(motion))
        wanted = [one for one in motion.references() if one.length > 0 and one.index not in done]
        check_data(motion)
        found += limit_usages(motion, wanted)
    return sorted(found, key=lambda one: -one.ratio(by))


def described(usage: LimitUsage, motion: Motion) -> str:
    """Return the metrics of a trajectory in a few lines."""
    from kine2go_warp.recordings.summary import grouped, label, shown

    one = usage.reference
    share = "unknown" if math.isinf(usage.worst_limit_ratio) else f"{usage.worst_limit_ratio:.0%}"
    lines = [f"{one.motion}/{one.index}  limit usage {share}  {motion.time[one.length - 1]:.1f} s"]
    for limit, metric, bound in zip(FILTER_METRICS, usage.metrics, usage.limits, strict=True):
        if math.isnan(metric):
            continue
        of = "" if math.isnan(bound) else f" of {bound:g}"
        unit = "" if limit.unit == "1" else f" {limit.unit}"
        mark = "  <" if limit.label == usage.worst else ""
        lines.append(f"  {limit.label:<14} {metric:.4g}{of}{unit}{mark}")
    said = {STORED, *(f"quality/{limit.name}" for limit in FILTER_METRICS)}
    for title, names in grouped(motion).items():
        metrics = ", ".join(f"{label(motion, name)} {shown(one.values[name])}" for name in names if name not in said)
        indent = " " * 17
        width = shutil.get_terminal_size().columns
        lines.append(textwrap.fill(f"  {title:<14} {metrics}", width, subsequent_indent=indent, break_long_words=False))
    return printable("\n".join(lines))


def answer(steps: Steps) -> bool:
    """Ask for a key until it leads on; return whether to go on."""
    keys = {
        "a": lambda: steps.judge(ACCEPTED, ""),
        "r": lambda: reject(steps),
        "s": steps.skip,
        "u": lambda: steps.undo() or stay("nothing to undo"),
        "t": lambda: accept_all(steps),
        "f": lambda: stay(film(steps)),
    }
    while True:
        key = read_key("> ")
        if key in ("", "q"):
            return False
        if (keys[key]() if key in keys else stay(HELP)) is not False:
            return True


def stay(message: str) -> bool:
    """Print a message and return that the question stands."""
    say(message)
    return False


def reject(steps: Steps) -> bool | None:
    """Ask why and reject the present trajectory; return False if there is no reason."""
    why = read_line("why: ")
    return steps.judge(REJECTED, why) if why else stay("not rejected: a rejection needs a reason")


def accept_all(steps: Steps) -> bool | None:
    """Accept the present trajectory and all that follow, if that is meant; return False if not."""
    if read_line(f"accept {counted(len(steps.queue) - steps.place, 'trajectory')}? y/n: ").lower() != "y":
        return False
    while steps.present is not None:
        steps.judge(ACCEPTED, "")
    return None


def film(steps: Steps) -> str:
    """Write a film of the present trajectory and return where it is, or why there is none."""
    usage = steps.queue[steps.place]
    try:
        return f"film: {steps.views.film(steps.motions[usage.reference.motion], usage)}"
    except Kine2GoError as error:
        return f"no film: {error}"


def read_key(prompt: str) -> str:
    """Return the next key, an empty text at the end of the input. Without a terminal a line is a key."""
    if not sys.stdin.isatty():
        print(prompt, end="", flush=True)
        line = sys.stdin.readline()
        return line.strip()[:1].lower() or ("" if not line else "?")
    import termios
    import tty

    terminal = sys.stdin.fileno()
    before = termios.tcgetattr(terminal)
    try:
        # Before the prompt, and without a flush, so that no key is lost however early it is pressed.
        tty.setcbreak(terminal, termios.TCSADRAIN)
        print(prompt, end="", flush=True)
        key = sys.stdin.read(1).lower()
    finally:
        termios.tcsetattr(terminal, termios.TCSADRAIN, before)
    print(key, flush=True)
    return "" if key == "\x04" else key


def read_line(prompt: str) -> str:
    """Return the next line, an empty text at the end of the input."""
    print(prompt, end="", flush=True)
    return sys.stdin.readline().strip()

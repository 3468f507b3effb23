"""The texts of a recording: what a trajectory is, and a list of all of them."""

import math
from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from kine2go_warp.dataset.limit_usage import ROW_LIMITS, LimitUsage
from kine2go_warp.dataset.motion import Motion, Trajectory
from kine2go_warp.metrics import FILTER_METRICS
from kine2go_warp.tables import counted


def trajectory_text(motion: Motion, one: Trajectory, usage: LimitUsage, verdict: str) -> str:
    """Return what is known of a trajectory as a whole, in Markdown."""
    lines = [
        f"### {motion.name}/{one.index}",
        f"{one.length} rows, {motion.time[one.length - 1]:.1f} s. {usage_text(usage)}",
        *(["", f"**{verdict}**"] if verdict else []),
        "",
        "| filter | metric | limit | share |",
        "|---|--:|--:|--:|",
    ]
    for limit, metric, bound, share in zip(FILTER_METRICS, usage.metrics, usage.limits, usage.shares, strict=True):
        if not math.isnan(metric):
            known = (f"{bound:g}", f"{share:.0%}") if not math.isnan(share) else ("-", "-")
            lines.append(f"| {limit.label} [{limit.unit}] | {metric:.4g} | {known[0]} | {known[1]} |")
    if "push" in one.arrays:
        lines += ["", pushes_text(one.arrays["push"], motion.time)]
    for title, names in grouped(motion).items():
        lines += ["", f"| {title} | |", "|---|--:|"]
        lines += [f"| {label(motion, name)} | {shown(one.values[name])} |" for name in names]
    return "\n".join(lines)


def pushes_text(push: NDArray[Any], time: NDArray[Any]) -> str:
    """Return when a trajectory was pushed and how hard."""
    speed = np.linalg.norm(push, axis=-1)
    pushed = np.flatnonzero(speed > 0.0)
    if len(pushed) == 0:
        return "No pushes."
    texts = [f"{speed[row]:.2f} m/s at {time[row]:.2f} s" for row in pushed]
    return f"{counted(len(texts), 'push')}: {', '.join(texts)}"


def grouped(motion: Motion) -> dict[str, list[str]]:
    """Return the arrays of trajectories by their sub-group; those without one tell how a trajectory was drawn.

    What is only there to set a simulator up again is left out.
    """
    groups: dict[str, list[str]] = {}
    for name in sorted(motion.trajectory_arrays, key=lambda name: ("/" in name, name)):
        group = name.split("/")[0] if "/" in name else "draw"
        if name != "length" and group != "initial_state":
            groups.setdefault(group, []).append(name)
    return groups


def label(motion: Motion, name: str) -> str:
    """Return the name of an array with its unit."""
    unit = motion.trajectory_arrays[name].unit
    return name.rpartition("/")[2].replace("_", " ") + (f" [{unit}]" if unit not in ("1", "") else "")


def shown(value: Any) -> str:
    """Return a number, or up to four of them, or their range."""
    values = np.atleast_1d(np.asarray(value)).reshape(-1)
    if values.dtype.kind not in "iuf":
        return ", ".join(map(str, values[:4]))
    texts = [f"{one}" if values.dtype.kind in "iu" else f"{one:.4g}" for one in values]
    return ", ".join(texts) if len(texts) <= 4 else f"{values.min():.4g} to {values.max():.4g}"


def usage_text(usage: LimitUsage) -> str:
    """Return how close a trajectory came to its limits, in words."""
    if math.isinf(usage.worst_limit_ratio):
        return "Limit usage unknown: the motion's attributes have no limits."
    return f"Limit usage {usage.worst_limit_ratio:.0%}{f', by its {usage.worst}' if usage.worst else ''}."


def motion_text(motion: Motion, usages: Sequence[LimitUsage], verdicts: dict[int, str]) -> str:
    """Return a list of trajectories in Markdown, in the order in which they are given."""
    heads = [f"{limit.label} [{limit.unit}]" for limit in ROW_LIMITS]
    lines = [f"### {motion.name}: {counted(len(usages), 'trajectory')}, those closest to a limit first", ""]
    lines += [
        "| | limit usage | by | " + " | ".join(heads) + " | verdict |",
        "|--:|--:|---|" + "--:|" * len(heads) + "---|",
    ]
    for one in usages:
        share = "-" if math.isinf(one.worst_limit_ratio) else f"{one.worst_limit_ratio:.0%}"
        metrics = " | ".join(f"{metric:.3f}" for metric in one.metrics[: len(ROW_LIMITS)])
        verdict = verdicts.get(one.reference.index, "")
        lines.append(f"| {one.reference.index} | {share} | {one.worst} | {metrics} | {verdict} |")
    return "\n".join(lines)

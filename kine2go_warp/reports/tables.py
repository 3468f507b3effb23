"""The tables of a page: what stands in each cell, and what it is sorted by."""

import math
import re
from collections.abc import Mapping
from typing import Any

from kine2go_warp.scores.registry import METRICS
from kine2go_warp.scores.statistics import Estimate
from kine2go_warp.tables import Cell, Column, Table, make_table, number_text

HEADLINES = (
    *("joint_rmse", "root_error", "foot_error", "joint_emd", "body_emd"),
    *("foot_slip", "power", "cost_of_transport", "acceptance"),
)
"""Metrics of the scorecard; all others are with each motion."""

SHOWN_ELSEWHERE = {"motion", "source", "file", "start", "end", "licence", "citation", "accepted", "rejected",
                   "coordinates", "fidelity"}  # fmt: skip
"""Attributes of a motion that have a place of their own on the page."""


def named(name: str) -> Cell:
    """Return a cell with a name of the software's, which it is sorted by."""
    return Cell(name, name, code=True)


def number(value: float, name: str = "", hint: str = "") -> Cell:
    """Return a cell with a number of three significant digits."""
    if math.isnan(value):
        return Cell("-", None, name, hint)
    return Cell(number_text(value), float(value), name, hint)


def interval(estimate: Estimate) -> Cell:
    """Return a cell with a 95 % interval, sorted by its lower end."""
    return Cell(interval_text(estimate), None if math.isnan(estimate.low) else float(estimate.low))


def interval_text(estimate: Estimate) -> str:
    """Return a 95 % interval."""
    if math.isnan(estimate.low):
        return "-"
    return f"{number_text(estimate.low)} to {number_text(estimate.high)}"


def scorecard(
    motions: Mapping[str, Mapping[str, Estimate]],
    sizes: Mapping[str, tuple[int, float]],
    overall: Mapping[str, Estimate],
) -> Table:
    """Return a line a motion with its chief metrics.

    Args:
        motions: Estimates by motion and name.
        sizes: Number of trajectories and their duration together [s], by motion.
        overall: Estimates over all motions.
    """
    known = {metric.name: metric for metric in METRICS}
    columns = [Column("motion", number=False), Column("trajectories"), Column("duration", "s")]
    for metric in (known[name] for name in HEADLINES):
        hint = f"{metric.description}; {metric.better} is better"
        columns.append(Column(metric.heading, "" if metric.unit == "1" else metric.unit, hint))

    def line(label: Cell, size: tuple[int, float], estimates: Mapping[str, Estimate]) -> tuple[Cell, ...]:
        metrics = (number(estimates[name].value, name, f"95 %: {interval_text(estimates[name])}") for name in HEADLINES)
        return (label, number(size[0], "trajectories"), number(size[1], "duration"), *metrics)

    rows = tuple(line(named(name), sizes[name], one) for name, one in motions.items())
    together = (sum(size[0] for size in sizes.values()), sum(size[1] for size in sizes.values()))
    total = line(Cell("all motions"), together, overall) if len(motions) > 1 else ()
    return Table(tuple(columns), rows, total)


def all_metrics(estimates: Mapping[str, Estimate]) -> Table:
    """Return every metric of one motion with its interval and meaning."""
    headings = ("metric", "mean", "95 % interval", "unit", "better", "meaning")
    rows = []
    for metric in METRICS:
        one = estimates[metric.name]
        texts = (metric.unit, metric.better, metric.description)
        rows.append((named(metric.name), number(one.value, metric.name), interval(one), *texts))
    return make_table("", headings, rows, ("metric", "unit", "better", "meaning"))


def fidelity(attributes: Mapping[str, Any]) -> Table:
    """Return the fidelity metrics of a motion's reference; no rows if the dataset has none."""
    rows = []
    for name, one in dict(attributes.get("fidelity") or {}).items():
        value = math.nan if one.get("value") is None else float(one["value"])
        rows.append((named(name), number(value, name), one.get("units", ""), one.get("description", "")))
    return make_table("", ("metric", "value", "unit", "meaning"), rows, ("metric", "unit", "meaning"))


def rejections(attributes: Mapping[str, Mapping[str, Any]], stored: Mapping[str, int]) -> Table:
    """Return how many rollouts of each motion were accepted and rejected, by reason.

    Args:
        attributes: Of the motions, by name.
        stored: Trajectories of each motion, for those without the attribute ``accepted``.
    """
    counts = {name: dict(one.get("rejected") or {}) for name, one in attributes.items()}
    reasons = sorted({reason for one in counts.values() for reason in one})
    headings = ("motion", "rollouts", "accepted", "share accepted", *reasons)
    rows = []
    for name, one in attributes.items():
        accepted = int(one.get("accepted", stored[name]))
        total = accepted + sum(counts[name].values())
        share = accepted / total if total else math.nan
        metrics = {"rollouts": total, "accepted": accepted, "share accepted": share}
        metrics |= {reason: counts[name].get(reason, 0) for reason in reasons}
        rows.append((named(name), *(number(float(value), key) for key, value in metrics.items())))
    return make_table("", headings, rows, ("motion",))


def licences(attributes: Mapping[str, Mapping[str, Any]]) -> Table:
    """Return source, licence and citation of each motion."""
    columns = ("motion", "source", "file and frames", "licence", "citation")
    rows = []
    for name, one in attributes.items():
        frames = f"{one.get('file', '')} {one.get('start', '')}-{one.get('end', '')}".strip(" -")
        source, licence, citation = (str(one.get(key, "unknown")) for key in ("source", "licence", "citation"))
        texts = (source, frames or "unknown", licence, citation)
        rows.append((named(name), *(Cell(text, text) for text in texts)))
    return make_table("", columns, rows, columns)


def settings(attributes: Mapping[str, Mapping[str, Any]]) -> tuple[Table, Table]:
    """Return the settings that all motions share, and those that differ with a column a motion."""
    flat = {name: flattened(one) for name, one in attributes.items()}
    keys = sorted({key for one in flat.values() for key in one})
    shared, different = [], []
    for key in keys:
        texts = [as_text(one.get(key, "-")) for one in flat.values()]
        if len(set(texts)) == 1:
            shared.append((named(key), setting(texts[0])))
        else:
            different.append((named(key), *map(setting, texts)))
    both, each = ("setting", "value"), ("setting", *attributes)
    return make_table("", both, shared, both), make_table("", each, different, each)


def setting(text: str) -> Cell:
    """Return a cell with a setting; of a long hash it shows the beginning, and all of it when pointed at."""
    short = shortened(text)
    return Cell(short, hint="" if short == text else text)


def shortened(text: str) -> str:
    """Return the beginning of a hash of 40 digits or more, other texts as they are."""
    return re.sub(r"\b([0-9a-f]{12})[0-9a-f]{28,}", r"\1...", text)


def flattened(values: Mapping[str, Any], prefix: str = "") -> dict[str, Any]:
    """Return nested settings as one level, with names such as ``training_settings.env.seed``."""
    result: dict[str, Any] = {}
    for name, value in values.items():
        if not prefix and name in SHOWN_ELSEWHERE:
            continue
        if isinstance(value, Mapping) and value:
            result |= flattened(value, f"{prefix}{name}.")
        else:
            result[prefix + name] = value
    return result


def as_text(value: Any) -> str:
    """Return a setting as people write it."""
    if isinstance(value, list | tuple):
        return ", ".join(map(as_text, value))
    return f"{value:.6g}" if isinstance(value, float) else str(value)


def facts(attributes: Mapping[str, Any], units: Mapping[str, str]) -> list[tuple[str, Cell]]:
    """Return some attributes that are there, by what they are; ``units`` gives their names and units."""
    return [
        (name.replace("_", " "), setting(f"{as_text(attributes[name])} {unit}".strip()))
        for name, unit in units.items()
        if name in attributes
    ]

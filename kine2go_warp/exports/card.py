"""The card of an exported dataset: what it holds, whose it is, and how good it is, in Hugging Face's form."""

import json
from collections.abc import Iterable, Sequence

import numpy as np

from kine2go_warp.dataset.access import Dataset
from kine2go_warp.dataset.motion import Motion, TrajectoryReference
from kine2go_warp.dataset.selection import by_motion
from kine2go_warp.exports.fields import Field
from kine2go_warp.tables import counted, make_table, markdown

LICENCE_IDENTIFIERS = {
    "BSD-3-Clause": "bsd-3-clause",
    "CC BY-NC 4.0": "cc-by-nc-4.0",
    "CC BY-SA 4.0": "cc-by-sa-4.0",
}
"""How Hugging Face writes the licences of our sources."""

TAGS = ("kine2go", "robotics", "quadruped", "unitree-go2", "locomotion", "imitation-learning")

FORMAT_NAMES = {"lerobot": "LeRobot dataset v3.0", "npz": "one .npz file a trajectory"}


def dataset_card(dataset: Dataset, form: str, fields: Sequence[Field], loading: str) -> str:
    """Return the README.md of an export.

    Args:
        dataset: What was exported.
        form: The format.
        fields: The fields with one entry a row.
        loading: Python lines that load it.
    """
    groups = by_motion(dataset.references)
    first = dataset.motion(next(iter(groups)))
    hours = dataset.num_rows / dataset.rate / 3600.0
    title = f"Unitree Go2 state-action data, {counted(len(groups), 'motion')}"
    parts = [
        front_matter(dataset, groups, form, title),
        f"# {title}",
        f"{counted(len(dataset.references), 'trajectory')}, {dataset.num_rows} rows at {dataset.rate:g} Hz, "
        f"{hours:.3g} hours; "
        f"{FORMAT_NAMES[form]}. Rollouts of policies that track retargeted animal and robot motions, simulated by "
        f"kine2go_warp {dataset.attributes['software_version']} "
        f"(revision {dataset.attributes['software_revision']}).",
        f"## Load it\n\n```python\n{loading.rstrip()}\n```",
        f"## Motions\n\n{motion_table(dataset, groups)}",
        f"## Licences and citations\n\nThe data of a motion carry the licence of its source.\n\n"
        f"{licence_table(dataset, groups)}",
        f"## Quality\n\nMeans over the trajectories, from the metrics stored with the data.\n\n"
        f"{quality_table(dataset, groups)}",
        f"## Fields with one entry a row\n\n{field_table(first, fields)}",
        f"## Fields with one entry a trajectory\n\n{trajectory_table(first, form)}",
        f"## Conventions\n\n{dataset.attributes['conventions']}\n\n{robot_list(dataset)}",
    ]
    return "\n\n".join(parts) + "\n"


def front_matter(dataset: Dataset, motions: Iterable[str], form: str, title: str) -> str:
    """Return the header that Hugging Face reads, in YAML (whose texts may be written as in JSON)."""
    licences = {str(dataset.motion(name).attributes.get("licence", "unknown")) for name in motions}
    identifier = LICENCE_IDENTIFIERS.get(next(iter(licences))) if len(licences) == 1 else None
    lines = ["---", f"license: {identifier or 'other'}"]
    if identifier is None:
        lines += ["license_name: see-each-motion", "license_link: README.md"]
    lines += [f"pretty_name: {json.dumps(title)}", "task_categories:", "- robotics", "tags:"]
    lines += [f"- {tag}" for tag in (("LeRobot", *TAGS) if form == "lerobot" else TAGS)]
    if form == "lerobot":
        lines += ["configs:", "- config_name: default", "  data_files: data/*/*.parquet"]
    return "\n".join([*lines, "---"])


def motion_table(dataset: Dataset, groups: dict[str, list[TrajectoryReference]]) -> str:
    """Return how much there is of each motion, and where it comes from."""
    rows = []
    for name, references in groups.items():
        attributes = dataset.motion(name).attributes
        lengths = [one.length for one in references]
        frames = f"{attributes.get('file', '')} {attributes.get('start', '')}-{attributes.get('end', '')}".strip()
        rejected = sum(attributes.get("rejected", {}).values())
        minutes = f"{sum(lengths) / dataset.rate / 60.0:.2f}"
        spread = f"{min(lengths)}" if min(lengths) == max(lengths) else f"{min(lengths)}-{max(lengths)}"
        source = attributes.get("source", "unknown")
        rows.append((f"`{name}`", len(references), rejected, sum(lengths), spread, minutes, source, frames))
    headings = ("motion", "trajectories", "rejected", "rows", "rows each", "minutes", "source", "file and frames")
    return table(headings, rows)


def licence_table(dataset: Dataset, motions: Iterable[str]) -> str:
    """Return licence and citation of each motion."""
    rows = []
    for name in motions:
        attributes = dataset.motion(name).attributes
        known = (str(attributes.get(key, "unknown")) for key in ("source", "licence", "citation"))
        rows.append((f"`{name}`", *known))
    return table(("motion", "source", "licence", "citation"), rows)


def quality_table(dataset: Dataset, groups: dict[str, list[TrajectoryReference]]) -> str:
    """Return the mean of every metric of quality of each motion."""
    motion = dataset.motion(next(iter(groups)))
    metrics = [name for name, spec in motion.trajectory_arrays.items() if is_metric(name, spec.dims)]
    rows = []
    for name, references in groups.items():
        rows.append((f"`{name}`", *(mean_text([one.values[metric] for one in references]) for metric in metrics)))
    described = [motion.trajectory_arrays[metric] for metric in metrics]
    headings = [f"{metric.partition('/')[2]} [{spec.unit}]" for metric, spec in zip(metrics, described, strict=True)]
    meanings = [f"- `{spec.name.partition('/')[2]}`: {spec.description}" for spec in described]
    return "\n\n".join([table(("motion", *headings), rows), "\n".join(meanings)])


def mean_text(values: Sequence[float]) -> str:
    """Return the mean of those values that are numbers, as text."""
    known = np.asarray(values, dtype=np.float64)
    known = known[~np.isnan(known)]
    return f"{known.mean():.4g}" if len(known) else "-"


def is_metric(name: str, dims: tuple[str, ...]) -> bool:
    """Return whether an array of trajectories is a single metric of quality."""
    return name.startswith("quality/") and dims == ("trajectory",)


def field_table(motion: Motion, fields: Sequence[Field]) -> str:
    """Return name, unit and meaning of everything with one entry a row, with its columns where fields are joined."""
    rows = []
    for field in fields:
        first = 0
        for array in field.arrays:
            spec, columns = motion.spec(array), motion.column_names(array)
            place = f"[{first}:{first + len(columns)}]" if len(field.arrays) > 1 else ""
            rows.append(
                (f"`{field.name}{place}`", array, len(columns), spec.unit, spec.description, shortened(columns))
            )
            first += len(columns)
    return table(("field", "array", "numbers", "unit", "meaning", "columns"), rows)


def trajectory_table(motion: Motion, form: str) -> str:
    """Return name, unit and meaning of what is stored once a trajectory."""
    prefix = "kine2go/" if form == "lerobot" else ""
    where = "Columns of `meta/episodes`.\n\n" if form == "lerobot" else ""
    specs = [spec for name, spec in motion.trajectory_arrays.items() if not (prefix and name == "length")]
    rows = [(f"`{prefix}{one.name}`", " x ".join(one.dims), one.unit, one.description) for one in specs]
    return where + table(("field", "dimensions", "unit", "meaning"), rows)


def robot_list(dataset: Dataset) -> str:
    """Return what a user must know of robot and control."""
    attributes = dataset.attributes
    names = ("robot", "joint_names", "default_joint_position", "action_scale", "stiffness", "damping")
    names += ("control_frequency", "physics_substeps", "sdk_motor_order", "robot_model_sha256")
    return "\n".join(f"- {name}: {as_text(attributes[name])}" for name in names if name in attributes)


def as_text(value: object) -> str:
    """Return a value as people write it."""
    return ", ".join(map(str, value)) if isinstance(value, list | tuple) else str(value)


def shortened(columns: tuple[str, ...]) -> str:
    """Return the names of columns, the middle ones left out where there are many."""
    return ", ".join(columns) if len(columns) <= 5 else f"{columns[0]}, {columns[1]}, ..., {columns[-1]}"


def table(headings: Sequence[str], rows: Iterable[Sequence[object]]) -> str:
    """Return a table in Markdown."""
    return markdown(make_table("", headings, rows)).rstrip()

"""The card of an exported dataset: what it holds, whose it is, and how good it is, in Hugging Face's form."""

import json
from collections.abc import Iterable, Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from kine2go_warp.dataset.access import Dataset
from kine2go_warp.dataset.motion import Motion, TrajectoryReference
from kine2go_warp.dataset.selection import by_motion
from kine2go_warp.exports.features import Field
from kine2go_warp.tables import counted, make_table, markdown

if TYPE_CHECKING:
    from kine2go_warp.exports.export import ExportRecord
    from kine2go_warp.exports.target import Output, Target

LICENCE_IDENTIFIERS = {
    "BSD-3-Clause": "bsd-3-clause",
    "CC BY-NC 4.0": "cc-by-nc-4.0",
    "CC BY-SA 4.0": "cc-by-sa-4.0",
}
"""How Hugging Face writes the licences of our sources."""

TAGS = ("kine2go", "robotics", "quadruped", "unitree-go2", "locomotion", "imitation-learning")


def dataset_card(output: "Output", form: str, target: "Target") -> str:
    """Return the README.md of an export.

    Args:
        output: What was exported.
        form: Name of the format.
        target: The format.
    """
    dataset = output.dataset
    groups = by_motion(dataset.references)
    first = dataset.motion(next(iter(groups)))
    hours = dataset.num_rows / dataset.rate / 3600.0
    title = f"Unitree Go2 state-action data, {counted(len(groups), 'motion')}"
    loading = target.loading
    known = {"motion": first.name, "rate": f"{dataset.rate:.0f}", "robot": dataset.attributes["robot"]}
    for name, value in (known | {"folder": "THIS FOLDER"}).items():
        loading = loading.replace(f"{{{name}}}", value)
    parts = [
        front_matter(dataset, groups, form, target, title),
        f"# {title}",
        f"{counted(len(dataset.references), 'trajectory')}, {dataset.num_rows} rows at {dataset.rate:g} Hz, "
        f"{hours:.3g} hours; "
        f"{target.title}. Rollouts of policies that track retargeted animal and robot motions, simulated by "
        f"kine2go_warp {dataset.attributes['software_version']} "
        f"(revision {dataset.attributes['software_revision']}).",
        f"## Load it\n\n```python\n{loading.rstrip()}\n```",
        f"## Motions\n\n{motion_table(dataset, groups)}",
        f"## Licences and citations\n\nThe data of a motion carry the licence of its source.\n\n"
        f"{licence_table(dataset, groups)}",
        f"## Quality\n\nMeans over the trajectories, from the metrics stored with the data.\n\n"
        f"{quality_table(dataset, groups)}",
        f"## Fields with one entry a row\n\n{target.time_rule}\n\n{field_table(output.fields)}",
        *([f"## Fields with one entry a trajectory\n\n{trajectory_table(first, target)}"] if target.about else []),
        f"## Conventions\n\n{dataset.attributes['conventions']} {dataset.attributes['action_rule']}\n\n"
        "A vector in the frame `base` is turned as the base link is; `heading` is level, and its x axis points where "
        "the base looks.",
        f"## Robot\n\n{joint_table(dataset, first)}\n\n{robot_list(dataset)}",
        f"## Simulator\n\n{simulator_list(first)}",
    ]
    return "\n\n".join(parts) + "\n"


def overview(record: "ExportRecord", groups: Mapping[str, Sequence[str]]) -> str:
    """Return the README.md of an export of several licences, which has a folder for each."""
    rows = [(f"[{record.parts[licence]}]({record.parts[licence]}/README.md)", licence, ", ".join(names))
            for licence, names in groups.items()]  # fmt: skip
    return (
        f"# {record.dataset}: {record.format}, {counted(len(groups), 'licence')}\n\n"
        "Motions of different licences are in folders of their own.\n\n"
        f"{table(('folder', 'licence', 'motions'), rows)}\n"
    )


def front_matter(dataset: Dataset, motions: Iterable[str], form: str, target: "Target", title: str) -> str:
    """Return the header that Hugging Face reads, in YAML (whose texts may be written as in JSON)."""
    licences = {str(dataset.motion(name).attributes.get("licence", "unknown")) for name in motions}
    identifier = LICENCE_IDENTIFIERS.get(next(iter(licences))) if len(licences) == 1 else None
    lines = ["---", f"license: {identifier or 'other'}"]
    if identifier is None:
        lines += ["license_name: see-each-motion", "license_link: README.md"]
    lines += [f"pretty_name: {json.dumps(title)}", "task_categories:", "- robotics", "tags:"]
    lines += [f"- {tag}" for tag in (*target.tags, *TAGS)]
    if target.data_files:
        lines += ["configs:", "- config_name: default", f"  data_files: {target.data_files}"]
    if form == "parquet":
        lines += ["- config_name: trajectories", "  data_files: trajectories/**/*.parquet"]
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


def field_table(fields: Sequence[Field]) -> str:
    """Return content, unit and frame of everything with one entry a row, and where in its field it is."""
    rows = []
    for field in fields:
        first = 0
        for feature in field.features:
            columns = [one for one in field.columns if one.split(".")[0] == feature.name] or list(field.columns)
            place = f"[{first}:{first + len(columns)}]" if len(field.features) > 1 else ""
            named = (f"`{field.name}{place}`", feature.name, len(columns), feature.unit, feature.content)
            rows.append((*named, feature.frame, shortened(columns)))
            first += len(columns)
    return table(("field", "feature", "numbers", "unit", "content", "frame", "columns"), rows)


def trajectory_table(motion: Motion, target: "Target") -> str:
    """Return name, unit and meaning of what is stored once a trajectory."""
    prefix = target.about_prefix
    specs = [spec for name, spec in motion.trajectory_arrays.items() if not (prefix and name == "length")]
    rows = [(f"`{prefix}{one.name}`", " x ".join(one.dims), one.unit, one.description) for one in specs]
    return f"{target.about}\n\n{table(('field', 'dimensions', 'unit', 'meaning'), rows)}"


def joint_table(dataset: Dataset, motion: Motion) -> str:
    """Return the joints in the order of the data, with their number in the SDK, default pose and limits."""
    attributes, simulation = dataset.attributes, simulation_of(motion)
    names, limits = attributes["joint_names"], simulation.get("motor_limits", {})
    order = list(attributes["sdk_motor_order"])
    known = {
        "lower limit [rad]": simulation.get("joint_lower"),
        "upper limit [rad]": simulation.get("joint_upper"),
        "torque limit [N m]": limits.get("driving"),
        "speed without load [rad/s]": limits.get("no_load_speed"),
    }
    rows = [
        (index, f"`{name}`", order.index(name), attributes["default_joint_position"][index],
         *("-" if values is None else f"{values[index]:g}" for values in known.values()))
        for index, name in enumerate(names)
    ]  # fmt: skip
    return table(("index", "joint", "SDK index", "default pose [rad]", *known), rows)


def robot_list(dataset: Dataset) -> str:
    """Return what a user must know of robot and control besides the joints."""
    attributes = dataset.attributes
    names = ("robot", "action_scale", "stiffness", "damping", "control_frequency", "physics_substeps")
    names += ("robot_model_sha256",)
    return "\n".join(f"- {name}: {as_text(attributes[name])}" for name in names if name in attributes)


def simulation_of(motion: Motion) -> dict[str, Any]:
    """Return what a motion says of its simulation, nothing where it says nothing."""
    found = motion.attributes.get("simulation")
    return found if isinstance(found, dict) else {}


def simulator_list(motion: Motion) -> str:
    """Return simulator, time step and versions of packages."""
    simulation = simulation_of(motion)
    names = ("engine", "timestep", "substeps", "integrator", "solver", "cone", "ground")
    lines = [f"- {name}: {as_text(simulation[name])}" for name in names if name in simulation]
    packages = simulation.get("packages", {})
    lines += [f"- versions: {', '.join(f'{name} {version}' for name, version in packages.items())}"] if packages else []
    return "\n".join(lines) or "Not recorded."


def as_text(value: object) -> str:
    """Return a value as people write it."""
    return ", ".join(map(str, value)) if isinstance(value, list | tuple) else str(value)


def shortened(columns: Sequence[str]) -> str:
    """Return the names of columns, the middle ones left out where there are many."""
    return ", ".join(columns) if len(columns) <= 5 else f"{columns[0]}, {columns[1]}, ..., {columns[-1]}"


def table(headings: Sequence[str], rows: Iterable[Sequence[object]]) -> str:
    """Return a table in Markdown."""
    return markdown(make_table("", headings, rows)).rstrip()

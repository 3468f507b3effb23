"""Checks of the store itself: arrays, their metadata, labels and attributes."""

import json
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from kine2go_warp.dataset.checks.block import number
from kine2go_warp.dataset.checks.independence import DRAWS, DUPLICATES
from kine2go_warp.dataset.checks.layout import Layout
from kine2go_warp.dataset.checks.reading import READABLE, StoredMotion, common_size, quietly
from kine2go_warp.dataset.checks.records import Check, Finding
from kine2go_warp.dataset.reviews import read_reviews
from kine2go_warp.dataset.schema import COPIED, REJECTED, ArraySpec
from kine2go_warp.dataset.store import motion_folders
from kine2go_warp.dataset.writer import SimulationAttributes, robot_attributes
from kine2go_warp.errors import DatasetError
from kine2go_warp.robots import RobotSpec

ROOT = Check(
    "root attributes",
    "format, robot (names, orders, default pose, action scale, hash of the model), rates and gains are this software's",
    "exact",
)
REVIEWS = Check("reviews", "the file of reviews, where there is one, can be read", "exact")
INDEX = Check("index", "the index of all arrays, where there is one, is what the arrays themselves say", "exact")
READING = Check(READABLE, "metadata and data of every array can be read", "")
ARRAYS = Check("arrays", "every array of the schema is there; others are worth a remark", "exact")
METADATA = Check("metadata", "dimensions, sizes, type, unit, description and fill value are the schema's", "exact")
LABELS = Check("labels", "names along axes, joints, links, feet and reward terms are the schema's", "exact")
TIME = Check("time", "time is row / control frequency, trajectories are numbered 0, 1, 2, ...", "1e-09 s")
EARLIER_DESCRIPTIONS = {"phase": "place in the reference cycle, in [0, 1)"}
"""Of arrays in stores that were written before some motions were played once."""

ATTRIBUTES = Check("attributes", "origin, licence, policy and settings are there and agree with data and root", "exact")

STORE_CHECKS = (ROOT, REVIEWS, INDEX)
"""Checks of the whole store."""
MOTION_CHECKS = (READING, INDEX, ARRAYS, METADATA, LABELS, TIME, ATTRIBUTES, DUPLICATES, DRAWS)
"""Checks of each motion."""

SOFTWARE = ("software_version", "software_revision")
"""Attributes that may differ from this software's."""

ORIGIN = ("source", "file", "licence", "citation", "policy_sha256")
"""Texts that every motion's attributes hold."""

SHOWN = 60
"""Characters of a value that are shown."""


@dataclass(frozen=True)
class Complaint:
    """What is wrong with an array, or with a group as a whole."""

    what: str
    array: str | None = None
    is_remark: bool = False


def check_reviews(path: Path) -> Iterator[Complaint]:
    """Check that what people said of trajectories can be read: a damaged file is never taken for no reviews."""
    try:
        read_reviews(path)
    except DatasetError as error:
        yield Complaint(str(error))


def check_root(attributes: dict[str, Any], spec: RobotSpec) -> Iterator[Complaint]:
    """Check the attributes of a dataset."""
    for name, expected in robot_attributes(spec).items():
        if name not in attributes:
            yield Complaint(f"attribute {name} is missing")
        elif name not in SOFTWARE and attributes[name] != expected:
            yield Complaint(f"attribute {name} is {shown(attributes[name])}, not {shown(expected)}")
    for name in SimulationAttributes.__dataclass_fields__:
        value = number(attributes, name)
        if value is None or value <= 0.0:
            yield Complaint(f"attribute {name} is {shown(attributes.get(name))}, not a positive number")


def check_index(folder: Path) -> Iterator[Complaint]:
    """Check the index (consolidated metadata) of a group against the members' own metadata.

    Folders without readable metadata are left to other checks.
    """
    content = json.loads((folder / "zarr.json").read_text())
    listed = content.get("attributes", {}).get("motions", {})
    if listed and sorted(listed) != motion_folders(folder):
        yield Complaint("attribute motions does not list the motions that are there")
    index = content.get("consolidated_metadata")
    if not index:
        return
    listed = index.get("metadata", {}) if isinstance(index, dict) else None
    if not isinstance(listed, dict) or not all(isinstance(entry, dict) for entry in listed.values()):
        yield Complaint("the index is malformed")
        return
    found = {str(path.parent.relative_to(folder)) for path in folder.rglob("zarr.json")} - {"."}
    for name in sorted(found - set(listed)):
        yield Complaint("not in the index, so that readers that trust it do not see it", name)
    for name in sorted(set(listed) - found):
        yield Complaint("in the index, but not in the store", name)
    for name in sorted(found & set(listed)):
        try:
            own = json.loads((folder / name / "zarr.json").read_text())
        except (OSError, ValueError):
            continue
        if not isinstance(own, dict) or without_index(own) != without_index(listed[name]):
            yield Complaint("its metadata are not those in the index", name)


def without_index(metadata: dict[str, Any]) -> dict[str, Any]:
    """Return metadata without an index of their own, which is written empty in some places and left out in others."""
    return {name: value for name, value in metadata.items() if name != "consolidated_metadata"}


def check_arrays(motion: StoredMotion, layout: Layout) -> Iterator[Complaint]:
    """Check that the arrays of the schema are there, and remark on others."""
    known = {*layout.arrays, *layout.labels}
    for name in sorted(known - set(motion.arrays) - set(motion.unreadable)):
        yield Complaint("this array is missing", name)
    for name in sorted(set(motion.arrays) - known):
        if name.startswith(f"{REJECTED}/"):
            continue
        yield Complaint("an array that the schema does not know", name, is_remark=True)


def check_metadata(motion: StoredMotion, layout: Layout) -> Iterator[Complaint]:
    """Check dimensions, sizes, type, unit, description and fill value of every array of the schema."""
    sizes = layout.sizes
    for dimension in ("trajectory", "frame", "slot"):
        try:
            sizes[dimension] = common_size(motion, layout, dimension)
        except ValueError:
            continue
    for name, expected in layout.arrays.items():
        if name in motion.arrays:
            for what in differences(motion.arrays[name], expected, sizes):
                yield Complaint(what, name)


def differences(array: Any, expected: ArraySpec, sizes: dict[str, int]) -> Iterator[str]:
    """Yield how an array's metadata differ from the schema's."""
    dimensions = read_dimensions(array)
    if dimensions != expected.dims:
        yield f"its dimensions are {shown(list(dimensions))}, not {shown(list(expected.dims))}"
    shape = tuple(sizes.get(dimension) for dimension in expected.dims)
    if array.shape != shape:
        yield f"its shape is {list(array.shape)}, not {list(shape)}"
    if array.dtype != np.dtype(expected.dtype):
        yield f"its type is {array.dtype}, not {expected.dtype}"
    for attribute, value in (("units", expected.unit), ("description", expected.description)):
        if array.attrs.get(attribute) not in (value, EARLIER_DESCRIPTIONS.get(expected.name, value)):
            yield f"its attribute {attribute} is {shown(array.attrs.get(attribute))}, not {shown(value)}"
    fill = np.nan if np.dtype(expected.dtype).kind == "f" else 0
    if not np.array_equal(array.fill_value, fill, equal_nan=np.dtype(expected.dtype).kind == "f"):
        yield f"its fill value is {array.fill_value}, not {fill}"


def read_dimensions(array: Any) -> tuple[str | None, ...]:
    """Return the names of an array's dimensions, empty if it has none."""
    return tuple(array.metadata.dimension_names or ())


def check_labels(motion: StoredMotion, layout: Layout) -> Iterator[Complaint]:
    """Check the names along each labelled dimension."""
    for name, expected in layout.labels.items():
        values = quietly(lambda name=name: motion.read(name))
        if values is None:
            continue
        try:
            labels = tuple(str(value) for value in np.ravel(values))
        except (SystemError, ValueError):  # raised by NumPy for numbers that are no characters
            yield Complaint("its labels are no text", name)
            continue
        if labels != expected:
            yield Complaint(f"its labels are {shown(list(labels))}, not {shown(list(expected))}", name)
        dimensions = read_dimensions(motion.arrays[name])
        if dimensions != (name,):
            yield Complaint(f"its dimensions are {shown(list(dimensions))}, not ['{name}']", name)


def check_time(motion: StoredMotion, frequency: float | None) -> Iterator[Complaint]:
    """Check the time of rows and the numbers of trajectories."""
    time, numbers = motion.read("time"), motion.read("trajectory")
    if time is not None and time.ndim == 1 and frequency is not None:
        error = np.abs(time.astype(np.float64) - np.arange(len(time)) / frequency)
        if not np.all(error <= 1e-9):
            row = int(np.argmax(np.where(np.isnan(error), np.inf, error)))
            yield Complaint(f"row {row} is at {time[row]:g} s, not {row / frequency:g} s", "time")
    if numbers is not None and not np.array_equal(numbers, np.arange(len(numbers))):
        yield Complaint("trajectories are not numbered 0, 1, 2, ...", "trajectory")
    if motion.attributes.get("coordinates") != "time":
        yield Complaint("attribute coordinates is not 'time', so that xarray takes time for data", "time")


def check_attributes(
    motion: StoredMotion, root: dict[str, Any], trajectories: int | None, spec: RobotSpec
) -> Iterator[Complaint]:
    """Check the attributes of a motion.

    Args:
        motion: The motion.
        root: Attributes of the dataset.
        trajectories: How many the arrays hold, None if they cannot tell.
        spec: The robot.
    """
    attributes = motion.attributes
    for name in COPIED:
        if name in root and attributes.get(name) != root[name]:
            yield Complaint(f"attribute {name} is {shown(attributes.get(name))}, but the root says {shown(root[name])}")
    if attributes.get("motion") != motion.name:
        yield Complaint(f"attribute motion is {shown(attributes.get('motion'))}, not '{motion.name}'")
    for name in ORIGIN:
        if not isinstance(attributes.get(name), str) or not attributes[name]:
            yield Complaint(f"attribute {name} is missing or empty")
    for name in ("gather_settings", "training_settings", "rejected"):
        if not isinstance(attributes.get(name), dict):
            yield Complaint(f"attribute {name} is missing")
    accepted = attributes.get("accepted")
    if trajectories == 0:
        yield Complaint("holds no trajectory")
    if trajectories is not None and accepted != trajectories:
        yield Complaint(f"attribute accepted is {shown(accepted)}, but the arrays hold {trajectories} trajectories")
    wanted = number(attributes, "gather_settings", "trajectories")
    if isinstance(accepted, int) and wanted is not None and accepted > wanted:
        yield Complaint(f"{accepted} rollouts were accepted, but only {wanted:g} were wanted")
    yield from settings_disagreements(attributes, root, spec)


def settings_disagreements(attributes: dict[str, Any], root: dict[str, Any], spec: RobotSpec) -> Iterator[Complaint]:
    """Yield where the settings of a motion's training are not those in the root, which has the robot's own gains."""
    shared = {
        "control_frequency": (1.0, ("control_rate",)),
        "physics_substeps": (1.0, ("substeps",)),
        "stiffness": (spec.stiffness_factor, ("motor", "stiffness")),
        "damping": (spec.damping_factor, ("motor", "damping")),
    }
    for name, (factor, keys) in shared.items():
        setting = number(attributes, "training_settings", "env", *keys)
        value = None if setting is None else factor * setting
        if value is not None and number(root, name) is not None and value != number(root, name):
            yield Complaint(f"trained with {name} {value:g}, but the root says {shown(root[name])}")


def shown(value: Any) -> str:
    """Return a value as short text."""
    text = repr(value)
    return text if len(text) <= SHOWN else f"{text[: SHOWN - 3]}..."


def to_finding(check: Check, motion: str | None, complaint: Complaint) -> Finding:
    """Return a complaint as a finding of a check."""
    return Finding(check.name, motion, complaint.what, complaint.array, is_remark=complaint.is_remark)

"""Mean, spread and range of every column, computed in one pass over the data, for normalisation."""

import json
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from kine2go_warp.dataset.access import Dataset
from kine2go_warp.errors import DatasetError
from kine2go_warp.files import atomic_file

FORMAT = "kine2go statistics"


@dataclass(frozen=True)
class Moments:
    """What is known of some values, column by column; two of them can be merged."""

    count: NDArray[np.int64]
    """Values that are numbers, of each column."""
    mean: NDArray[np.float64]
    squares: NDArray[np.float64]
    """Sum of the squared deviations from the mean."""
    minimum: NDArray[np.float64]
    maximum: NDArray[np.float64]

    @property
    def std(self) -> NDArray[np.float64]:
        """Standard deviation of the values at hand (divided by their count)."""
        return np.sqrt(self.squares / np.maximum(self.count, 1))


def compute_moments(values: NDArray[Any]) -> Moments:
    """Return the moments of each column of values, shape [num_rows, ...]. NaN does not count."""
    values = np.asarray(values, dtype=np.float64)
    known = ~np.isnan(values)
    count = known.sum(axis=0)
    mean = np.where(known, values, 0.0).sum(axis=0) / np.maximum(count, 1)
    return Moments(
        count=count,
        mean=mean,
        squares=(np.where(known, values - mean, 0.0) ** 2).sum(axis=0),
        minimum=np.where(known, values, np.inf).min(axis=0, initial=np.inf),
        maximum=np.where(known, values, -np.inf).max(axis=0, initial=-np.inf),
    )


def merge(a: Moments, b: Moments) -> Moments:
    """Return the moments of the values of both (the formula of Chan, Golub and LeVeque)."""
    count = a.count + b.count
    share = b.count / np.maximum(count, 1)
    difference = b.mean - a.mean
    return Moments(
        count=count,
        mean=a.mean + difference * share,
        squares=a.squares + b.squares + difference**2 * a.count * share,
        minimum=np.minimum(a.minimum, b.minimum),
        maximum=np.maximum(a.maximum, b.maximum),
    )


@dataclass(frozen=True)
class ArrayStatistics:
    """One row array in figures. All arrays are of the shape of one row of it."""

    unit: str
    columns: tuple[str, ...]
    """Names of the columns, in C order."""
    count: NDArray[np.int64]
    mean: NDArray[np.float64]
    std: NDArray[np.float64]
    """Standard deviation, divided by the count."""
    minimum: NDArray[np.float64]
    maximum: NDArray[np.float64]

    def normalise(self, values: Any) -> Any:
        """Return values of this array with mean 0 and standard deviation 1; a column that is constant is only shifted.

        Args:
            values: A NumPy array of shape [..., *row].
        """
        return (values - self.mean) / np.where(self.std > 0.0, self.std, 1.0)


def compute_statistics(
    dataset: Dataset, arrays: Sequence[str] | None = None, on_trajectory: Callable[[int, int], None] | None = None
) -> dict[str, ArrayStatistics]:
    """Return the statistics of row arrays over all valid rows, in double precision, a trajectory at a time.

    Args:
        dataset: The dataset, or a selection of it, such as the part for training.
        arrays: Names of row arrays; by default all.
        on_trajectory: Called with the trajectories done and their total.

    Raises:
        DatasetError: the selection is empty, there is no such array, or one cannot be read.
    """
    found: dict[str, Moments] = {}
    for done, one in enumerate(dataset.trajectories(arrays=arrays), start=1):
        for name, values in one.arrays.items():
            moments = compute_moments(values)
            found[name] = merge(found[name], moments) if name in found else moments
        if on_trajectory is not None:
            on_trajectory(done, len(dataset.references))
    if not found:
        raise DatasetError(f"{dataset.path}: no statistics of nothing; the selection holds no trajectories or arrays")
    motion = dataset.motion(dataset.references[0].motion)
    return {
        name: ArrayStatistics(
            motion.spec(name).unit,
            motion.column_names(name),
            one.count,
            one.mean,
            one.std,
            one.minimum,
            one.maximum,
        )
        for name, one in found.items()
    }


def save_statistics(statistics: dict[str, ArrayStatistics], path: Path) -> None:
    """Write statistics as JSON, each figure a list in the order of ``columns``.

    Raises:
        DatasetError: a column holds no numbers, or infinite ones.
    """
    content: dict[str, Any] = {"format": FORMAT, "arrays": {}}
    for name, one in statistics.items():
        figures = {"mean": one.mean, "std": one.std, "minimum": one.minimum, "maximum": one.maximum}
        if not all(np.isfinite(figure).all() for figure in figures.values()):
            raise DatasetError(f"array '{name}' has a column without finite numbers; leave it out")
        content["arrays"][name] = {
            "unit": one.unit,
            "columns": list(one.columns),
            "shape": list(one.mean.shape),
            "count": one.count.ravel().tolist(),
            **{key: figure.ravel().tolist() for key, figure in figures.items()},
        }
    with atomic_file(path) as temporary:
        temporary.write_text(json.dumps(content, indent=1))


def load_statistics(path: Path) -> dict[str, ArrayStatistics]:
    """Read what :func:`save_statistics` wrote.

    Raises:
        DatasetError: the file is missing or holds something else.
    """
    try:
        content = json.loads(path.read_text())
        if content["format"] != FORMAT:
            raise ValueError("not made by kine2go")
        return {name: _from_json(one) for name, one in content["arrays"].items()}
    except FileNotFoundError:
        raise DatasetError(f"{path}: no such file of statistics") from None
    except (ValueError, KeyError, TypeError, AttributeError) as error:
        raise DatasetError(f"{path}: not a file of statistics ({error})") from None


def _from_json(content: dict[str, Any]) -> ArrayStatistics:
    shape = tuple(content["shape"])

    def figure(name: str) -> NDArray[np.float64]:
        return np.array(content[name], dtype=np.float64).reshape(shape)

    count = np.array(content["count"], dtype=np.int64).reshape(shape)
    names = ("mean", "std", "minimum", "maximum")
    return ArrayStatistics(content["unit"], tuple(content["columns"]), count, *(figure(name) for name in names))

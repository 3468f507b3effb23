"""Each part imports with the packages of its own extra: quickly by hiding the others, in full in environments of uv."""

import importlib.metadata
import re
import shutil
import subprocess
import sys

import pytest

from kine2go_warp.extras import DISTRIBUTIONS
from tests.conftest import REPOSITORY
from tests.test_architecture import run_without

DATA = ["dataset", "dataset.writer", "cli.main", "settings"]

PARTS = {
    "": DATA,
    "retarget": ["motions.retarget", "motions.inverse_kinematics", "motions.report"],
    "train": ["training.train", "training.runner", "rollouts.gather", "rollouts.collector", "evaluation.evaluate"],
    "review": ["recordings.motion", "recordings.viewer", "renders.renderer", "reports.report", "scores.report"],
    "export": ["exports.lerobot", "exports.npz"],
    "deploy": ["deployment.controller", "deployment.drive", "deployment.dds", "deployment.simulated_robot"],
    "cluster": ["pipelines.engines.cluster"],
}
"""What must be importable with the packages of an extra alone. ``gym`` is an addition to ``train``."""


def requirements_of(distribution: str, extra: str = "") -> set[str]:
    """What a distribution needs at first hand, and for an extra what that adds; none if it is not installed."""
    try:
        requirements = importlib.metadata.requires(distribution) or []
    except importlib.metadata.PackageNotFoundError:
        return set()
    found = set()
    for requirement in requirements:
        name, condition = re.match(r"([A-Za-z0-9_.-]+)[^;]*;?(.*)", requirement).groups()
        named = re.search(r"extra == ['\"]([a-z0-9_-]+)['\"]", condition)
        if named is None or named[1] == extra:
            found.add(re.sub(r"[-_.]+", "-", name).lower())
    return found


def modules_of(distributions: set[str]) -> set[str]:
    """The modules that distributions hold, as far as this test hides any of them."""
    return set(distributions) | {module for module, one in DISTRIBUTIONS.items() if one in distributions}


def everything_behind(distributions: set[str]) -> set[str]:
    """The distributions and all that they need."""
    known, new = set(), set(distributions)
    while new:
        known |= new
        new = set().union(*(requirements_of(one, "sim" if one == "newton" else "") for one in new)) - known
    return known


def importing(extra: str) -> str:
    return "\n".join(f"import kine2go_warp.{module}" for module in PARTS[extra])


@pytest.mark.parametrize("extra", PARTS)
def test_a_part_imports_with_the_packages_of_its_extra_alone(extra, tmp_path):
    ours = set().union(*(requirements_of("kine2go-warp", one) for one in (*PARTS, "gym")))
    hidden = modules_of(ours - everything_behind(requirements_of("kine2go-warp", extra)))
    assert len(hidden) > 3
    run_without(tuple(sorted(hidden)), importing(extra), tmp_path)


@pytest.mark.slow
@pytest.mark.parametrize("extra", PARTS)
def test_a_part_imports_in_an_environment_with_its_extra_alone(extra, tmp_path):
    if shutil.which("uv") is None:
        pytest.skip("uv is not on the PATH")
    requirements, environment = tmp_path / "requirements.txt", tmp_path / "environment"
    export = ["uv", "export", "--quiet", "--frozen", "--no-dev", "--no-editable", "-o", requirements]
    subprocess.run([*export, *(["--extra", extra] if extra else [])], cwd=REPOSITORY, check=True, capture_output=True)
    subprocess.run(["uv", "venv", "--quiet", "--python", sys.executable, environment], check=True)
    install = ["uv", "pip", "install", "--quiet", "--no-deps", "--python", environment / "bin" / "python"]
    subprocess.run([*install, "-r", requirements], cwd=REPOSITORY, check=True)
    subprocess.run([environment / "bin" / "python", "-c", importing(extra)], cwd=tmp_path, check=True)

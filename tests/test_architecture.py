"""What ARCHITECTURE.md promises of imports, read from the code and seen in running processes."""

import ast
import graphlib
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from tests.conftest import COMMITTED_CLIP, REPOSITORY

LEAVES = {
    "kine2go_warp",
    "device",
    "errors",
    "extras",
    "files",
    "interruption",
    "machine",
    "metrics",
    "names",
    "objects",
    "quantities",
    "revision",
    "rotations",
    "settings",
    "tables",
    "toml",
}

ALLOWED = {
    "kernels": {"kernels"},
    "robots": {"robots"},
    "motions": {"motions", "robots"},
    "env": {"env", "kernels", "motions", "robots"},
    "learning": {"learning", "env", "kernels", "motions", "robots"},
    "dataset": {"dataset", "robots"},
    "rollouts": {"rollouts", "scores", "dataset", "learning", "env", "kernels", "motions", "robots"},
    "training": {"training", "rollouts", "scores", "dataset", "learning", "env", "kernels", "motions", "robots"},
    "deployment": {"deployment", "learning", "env", "motions", "robots"},
    "evaluation": {
        "evaluation",
        "deployment",
        "training",
        "rollouts",
        "scores",
        "learning",
        "env",
        "kernels",
        "motions",
        "robots",
    },
    "benchmark": {
        "benchmark",
        "exports",
        "deployment",
        "rollouts",
        "scores",
        "dataset",
        "learning",
        "env",
        "motions",
        "robots",
    },
    "exports": {"exports", "dataset", "motions", "robots"},
    "recordings": {"recordings", "dataset", "motions", "robots"},
    "scores": {"scores", "dataset", "robots"},
    "renders": {"renders", "dataset", "robots"},
    "reports": {"reports", "renders", "scores", "dataset", "robots"},
    "pipelines": {
        "pipelines",
        "recordings",
        "training",
        "scores",
        "rollouts",
        "dataset",
        "learning",
        "motions",
        "robots",
    },
    "bench": {"bench", "training", "rollouts", "scores", "dataset", "learning", "env", "kernels", "motions", "robots"},
    "cli": {
        "cli",
        "bench",
        "pipelines",
        "reports",
        "renders",
        "recordings",
        "scores",
        "exports",
        "benchmark",
        "evaluation",
        "deployment",
        "training",
        "rollouts",
        "dataset",
        "learning",
        "env",
        "motions",
        "robots",
    },
}
"""Which parts each part of the package may import, besides the leaves."""


def folder_of(part: str) -> Path:
    top = REPOSITORY / part
    return top if top.is_dir() else REPOSITORY / "kine2go_warp" / part


def imported_parts(path: Path) -> set[str]:
    """The parts of the package that a file imports, wherever in it."""
    parts = set()
    for node in ast.walk(ast.parse(path.read_text())):
        names = []
        if isinstance(node, ast.ImportFrom) and node.module:
            names = [node.module]
            if node.module == "kine2go_warp":
                names = [f"kine2go_warp.{alias.name}" for alias in node.names]
        elif isinstance(node, ast.Import):
            names = [alias.name for alias in node.names]
        for name in names:
            pieces = name.split(".")
            if pieces[0] == "kine2go_warp":
                part = pieces[1] if len(pieces) > 1 else "kine2go_warp"
                parts.add("kine2go_warp" if part == "__version__" else part)
    return parts


@pytest.mark.parametrize("part", ALLOWED)
def test_imports_run_one_way(part):
    files = list(folder_of(part).rglob("*.py"))
    assert files
    for path in files:
        beyond = imported_parts(path) - ALLOWED[part] - LEAVES
        assert not beyond, f"{path.relative_to(REPOSITORY)} imports {beyond}"


def module_files() -> dict[str, Path]:
    """All files of the package by the name under which they are imported."""
    files = {}
    for part in ALLOWED:
        folder = folder_of(part)
        for path in folder.rglob("*.py"):
            pieces = (part, *path.relative_to(folder).with_suffix("").parts)
            files[".".join(("kine2go_warp", *pieces)).removesuffix(".__init__")] = path
    return files


def imported_modules(path: Path, known: set[str]) -> set[str]:
    """The files of the package that a file imports, also inside functions, but not for type checking alone."""
    tree = ast.parse(path.read_text())
    for node in ast.walk(tree):
        if isinstance(node, ast.If) and isinstance(node.test, ast.Name) and node.test.id == "TYPE_CHECKING":
            node.body = []
    names = set()
    for node in ast.walk(tree):
        if isinstance(node, ast.ImportFrom) and node.module:
            # A name is a file of the folder, or is defined in the file.
            names |= {name if (name := f"{node.module}.{alias.name}") in known else node.module for alias in node.names}
        elif isinstance(node, ast.Import):
            names |= {alias.name for alias in node.names}
    return names & known


def test_no_file_imports_itself_by_way_of_others_also_inside_functions():
    files = module_files()
    imports = {name: imported_modules(path, set(files)) for name, path in files.items()}
    sorter = graphlib.TopologicalSorter(imports)
    try:
        sorter.prepare()
    except graphlib.CycleError as error:
        pytest.fail(" <- ".join(error.args[1]))
    assert len(files) > 200
    assert sum(map(len, imports.values())) > 500, "imports are found"


def test_every_part_of_the_package_is_in_the_table():
    folder = REPOSITORY / "kine2go_warp"
    parts = {path.name for path in folder.iterdir() if path.is_dir() and path.name != "__pycache__"}
    assert parts == set(ALLOWED)


HIDE = """
import importlib.machinery

find_spec = importlib.machinery.PathFinder.find_spec

def find_others(_, name, path=None, target=None):
    return None if name.split(".")[0] in {packages!r} else find_spec(name, path, target)

importlib.machinery.PathFinder.find_spec = classmethod(find_others)
"""


def run_without(packages: tuple[str, ...], script: str, folder: Path) -> str:
    """Run a script in a process in which some packages are not there, and return what it prints."""
    command = [sys.executable, "-c", HIDE.format(packages=packages) + script]
    result = subprocess.run(command, cwd=folder, capture_output=True, text=True, check=False)
    assert result.returncode == 0, result.stdout + result.stderr
    return result.stdout


def test_retargeting_needs_no_torch_and_no_simulator(tmp_path):
    script = "from kine2go_warp.cli.main import main; assert main(['retarget', 'dog_trot', '--out', '.']) == 0"
    run_without(("torch", "newton", "warp", "rsl_rl", "zarr", "rerun"), script, tmp_path)


NOT_ON_A_GPU_NODE = (
    *("placo", "pinocchio", "ezc3d"),
    *("rerun", "av", "jinja2", "pyarrow", "onnx", "onnxruntime", "onnxscript", "gymnasium"),
    *("playwright", "xarray", "netCDF4"),
)
"""Packages of other extras than ``train``, and of the tests of those."""


def test_a_gpu_node_trains_gathers_evaluates_replays_and_measures_with_the_extra_train_alone(tmp_path):
    shutil.copy(COMMITTED_CLIP, tmp_path)
    script = """
from kine2go_warp.cli.main import main
assert main("train dog_trot.npz --out policy --device cpu --iterations 1 --num-worlds 4".split()) == 0
assert main("gather policy --out data.zarr --device cpu --trajectories 2 --rows 5 --max-distance 9 --max-angle 4"
            " --max-joint-rmse 9 --max-leg-contact 2 --max-foot-slip 99 --max-joint-jerk 1e9"
            " --max-joint-limit 2 --max-torque-saturation 2 --max-action-saturation 2".split()) == 0
assert main("replay data.zarr dog_trot --device cpu".split()) == 0
assert main("eval policy --device cpu --worlds 2 --seconds 0.5".split()) == 0
assert main("bench env train --clip dog_trot.npz --device cpu --num-worlds 4 --repeats 1 --steps 2".split()) == 0
"""
    run_without(NOT_ON_A_GPU_NODE, script, tmp_path)


def test_the_tests_of_a_gpu_are_found_without_the_tools_of_other_stages():
    script = """
import sys, pytest
sys.exit(pytest.main("-m gpu --collect-only -q -p no:cacheprovider -W ignore tests".split()))
"""
    found = run_without(NOT_ON_A_GPU_NODE, script, REPOSITORY)
    for name in ("env/test_gpu.py", "env/test_graph.py", "training/test_resume.py"):
        assert f"tests/{name}" in found
    assert "error" not in found.lower()


def test_driving_a_robot_with_an_exported_policy_needs_no_simulator_and_no_torch(exported, tmp_path):
    script = f"""
import numpy as np
from pathlib import Path
from kine2go_warp.deployment.controller import ExportedPolicy, PolicyController
from kine2go_warp.deployment.observer import MeasuredState
policy = ExportedPolicy.load(Path({str(exported)!r}))
controller = PolicyController(policy)
controller.begin(phase=0.5, ground=(0.0, 0.0), turn=1.0)
standing = np.array(policy.metadata.default_joint_position)
state = MeasuredState(np.array([0.0, 0.0, 0.3]), np.array([1.0, 0, 0, 0]), *np.zeros((2, 3)), standing, np.zeros(12))
assert [controller.act(state).shape for _ in range(3)] == [(12,)] * 3
"""
    run_without(("torch", "newton", "warp", "mujoco", "rsl_rl", "zarr", "rerun", "placo"), script, tmp_path)


def test_files_fit_in_a_head():
    for part in ALLOWED:
        for path in folder_of(part).rglob("*.py"):
            assert len(path.read_text().splitlines()) <= 400, path

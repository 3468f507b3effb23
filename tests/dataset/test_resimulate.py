"""A trajectory is simulated anew from the store by a script that knows nothing of this package."""

import re
import subprocess
import sys

from tests.conftest import REPOSITORY

SCRIPT = REPOSITORY / "docs" / "resimulate.py"

ALONE = """
import importlib.abc, runpy, sys

class Refused(importlib.abc.MetaPathFinder):
    def find_spec(self, name, path=None, target=None):
        if name.partition(".")[0] in {"kine2go_warp", "kernels", "robots", "newton", "warp", "mujoco_warp", "torch",
                                      "scipy", "xarray", "pandas"}:
            raise ImportError(f"{name} is not in the environment of somebody who has only the store")

sys.meta_path.insert(0, Refused())
sys.argv = sys.argv[1:]
runpy.run_path(sys.argv[0], run_name="__main__")
"""


def test_zarr_numpy_and_mujoco_follow_every_trajectory_for_120_rows(clean_dataset, tmp_path):
    for index in range(5):
        command = [sys.executable, "-c", ALONE, str(SCRIPT), str(clean_dataset), "dog_trot", str(index)]
        done = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, check=False)
        assert done.returncode == 0, done.stderr
        match = re.fullmatch(r"largest difference of a joint over 120 rows: (\S+) rad\n", done.stdout)
        assert match, done.stdout
        assert float(match[1]) < 1e-4


def test_the_script_is_short():
    lines = [line for line in SCRIPT.read_text().splitlines() if line.strip()]
    assert len(lines) <= 75

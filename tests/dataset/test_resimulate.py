"""A trajectory is simulated anew from the store by a script that knows nothing of this package."""

import re
import subprocess
import sys

import zarr

from tests.conftest import REPOSITORY

SCRIPT = REPOSITORY / "docs" / "resimulate.py"

ALONE = """
import importlib.abc, runpy, sys

class Refused(importlib.abc.MetaPathFinder):
    def find_spec(self, name, path=None, target=None):
        if name.partition(".")[0] in {"kine2go_warp", "kernels", "robots", "newton", "warp", "mujoco_warp", "torch",
                                      "scipy", "xarray", "pandas"}:
            raise ImportError(f"{name} is not needed to read and simulate the store")

sys.meta_path.insert(0, Refused())
sys.argv = sys.argv[1:]
runpy.run_path(sys.argv[0], run_name="__main__")
"""


def test_zarr_numpy_and_mujoco_follow_120_rows_also_where_a_leg_touches_the_ground(clean_dataset, tmp_path):
    touches = zarr.open_group(clean_dataset / "dog_trot", mode="r")["leg_contact"][:, :120] > 0.0
    assert touches.any()
    for index in range(len(touches)):
        command = [sys.executable, "-c", ALONE, str(SCRIPT), str(clean_dataset), "dog_trot", str(index)]
        done = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, check=False)
        assert done.returncode == 0, done.stderr
        match = re.fullmatch(r"largest difference of a joint over 120 rows: (\S+) rad\n", done.stdout)
        assert match, done.stdout
        assert float(match[1]) < 1e-4

"""The built wheel, installed in an environment of its own and run from another folder."""

import shutil
import subprocess
import sys
import zipfile

import pytest

from tests.conftest import REPOSITORY


@pytest.fixture(scope="module")
def wheel(tmp_path_factory):
    if shutil.which("uv") is None:
        pytest.skip("uv is not on the PATH")
    folder = tmp_path_factory.mktemp("dist")
    subprocess.run(["uv", "build", "--wheel", "--quiet", "--out-dir", folder], cwd=REPOSITORY, check=True)
    return next(folder.glob("*.whl"))


def test_the_wheel_holds_one_package_with_all_its_folders_and_data(wheel):
    names = zipfile.ZipFile(wheel).namelist()
    assert {name.split("/")[0] for name in names if ".dist-info" not in name} == {"kine2go_warp"}
    for name in (
        "kernels/rewards.py",
        "robots/go2/go2.urdf",
        "motions/catalogue.toml",
        "motions/data/dog_trot.txt",
        "pipelines/demo.toml",
        "cli/main.py",
        "reports/page/page.html.j2",
        "reports/page/page.css",
        "reports/page/page.js",
    ):
        assert f"kine2go_warp/{name}" in names, name


def test_the_installed_wheel_starts_in_another_folder(wheel, tmp_path):
    environment, elsewhere = tmp_path / "environment", tmp_path / "elsewhere"
    elsewhere.mkdir()
    requirements = tmp_path / "requirements.txt"
    export = [
        "uv",
        "export",
        "--quiet",
        "--frozen",
        "--no-dev",
        "--extra",
        "all",
        "--no-emit-project",
        "-o",
        requirements,
    ]
    subprocess.run(export, cwd=REPOSITORY, check=True, capture_output=True)
    subprocess.run(["uv", "venv", "--quiet", "--python", sys.executable, environment], check=True)
    install = ["uv", "pip", "install", "--quiet", "--python", environment / "bin" / "python", "--no-deps"]
    subprocess.run([*install, "-r", requirements, wheel], check=True)
    for arguments in (["retarget", "dog_trot", "--out", "clips"], ["doctor"]):
        result = subprocess.run(
            [environment / "bin" / "kine2go", *arguments], cwd=elsewhere, capture_output=True, text=True, check=False
        )
        assert result.returncode == 0, result.stderr
    assert (elsewhere / "clips" / "dog_trot.npz").is_file()

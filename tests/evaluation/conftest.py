import pytest

from kine2go_warp.deployment.export import export_policy


@pytest.fixture(scope="session")
def exported(policy, tmp_path_factory):
    """The folder of an exported policy."""
    folder = tmp_path_factory.mktemp("exported") / "trot"
    export_policy(policy, folder)
    return folder

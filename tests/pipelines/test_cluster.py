"""A real Ray cluster on this machine: a node is lost in the middle of a training and another takes over."""

from dataclasses import replace

import pytest

from kine2go_warp.errors import PipelineError
from kine2go_warp.pipelines.engines.cluster import RayEngine
from kine2go_warp.pipelines.job import read_progress
from kine2go_warp.pipelines.workspace import Workspace
from tests.pipelines.helpers import TINY, content, run

ray = pytest.importorskip("ray", reason="Ray is not installed (uv sync --extra cluster)")


@pytest.fixture
def cluster():
    from ray.cluster_utils import Cluster

    # The head decides only; each node has room for one stage.
    cluster = Cluster(initialize_head=True, head_node_args={"num_cpus": 0})
    yield cluster
    ray.shutdown()
    cluster.shutdown()


@pytest.mark.faults
def test_a_node_that_is_lost_while_training_changes_nothing(cluster, tmp_path):
    recipe = replace(TINY, train=TINY.train.override({"ppo.iterations": 12}))
    node = cluster.add_node(num_cpus=1)
    folder = tmp_path / "run"
    lost = []

    def replace_the_node() -> bool:
        note = read_progress(Workspace(folder).progress("dog_trot"))
        if not lost and note is not None and note.stage == "train" and note.done >= 2:
            lost.append(note)
            cluster.add_node(num_cpus=1)
            cluster.remove_node(node, allow_graceful=False)
        return False

    engine = RayEngine(cluster.address, "cpu")
    result, listener = run(recipe, folder, None, engine, replace_the_node)
    assert (sorted(result.finished), result.failed) == (["dog_trot"], {})
    assert lost
    assert [event.stage for event in listener.of("worker_died")] == ["train"]
    run(recipe, tmp_path / "whole")
    assert content(folder) == content(tmp_path / "whole")


def test_a_cluster_that_does_not_answer_is_said_in_one_line():
    with pytest.raises(PipelineError, match=r"no Ray cluster at '127\.0\.0\.1:1'"):
        RayEngine("127.0.0.1:1")

"""A real Ray cluster on this machine: two nodes, one of which is lost in the middle of a training."""

from dataclasses import replace

import pytest

from kine2go_warp.errors import PipelineError
from kine2go_warp.pipelines.engines.cluster import RayEngine
from kine2go_warp.pipelines.job import read_progress
from kine2go_warp.pipelines.workspace import Workspace
from tests.pipelines.helpers import TWO, content, run, write_sources

ray = pytest.importorskip("ray", reason="Ray is not installed (uv sync --extra cluster)")


@pytest.fixture
def cluster():
    from ray.cluster_utils import Cluster

    # The head decides only; each node has room for one stage.
    cluster = Cluster(initialize_head=True, head_node_args={"num_cpus": 0})
    yield cluster
    ray.shutdown()
    cluster.shutdown()


def test_a_node_that_is_lost_while_training_changes_nothing(cluster, tmp_path):
    recipe = replace(TWO, train=TWO.train.override({"ppo.iterations": 30}))
    data = write_sources(tmp_path / "data")
    nodes = [cluster.add_node(num_cpus=1, resources={f"node{number}": 1}) for number in range(2)]
    folder = tmp_path / "run"
    lost = []

    def lose_a_node() -> bool:
        note = read_progress(Workspace(folder).progress("dog_trot"))
        if not lost and note is not None and note.stage == "train" and note.done >= 2:
            # Whichever node trains the trot: one with a lone worker is as good as the other.
            lost.append(note)
            cluster.remove_node(nodes[0], allow_graceful=False)
        return False

    engine = RayEngine(cluster.address, "cpu")
    result, listener = run(recipe, folder, data, engine, lose_a_node)
    assert (sorted(result.finished), result.failed) == (sorted(TWO.motions), {})
    assert lost
    assert listener.of("worker_died"), "the node had a stage of one of the motions"
    run(recipe, tmp_path / "whole", data)
    assert content(folder) == content(tmp_path / "whole")


def test_a_cluster_that_does_not_answer_is_said_in_one_line():
    with pytest.raises(PipelineError, match=r"no Ray cluster at '127\.0\.0\.1:1'"):
        RayEngine("127.0.0.1:1")

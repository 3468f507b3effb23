"""Whatever is done to the files of a dataset, the checks end with a report or an error made for people."""

import contextlib
import json
import random

import pytest

from kine2go_warp.dataset.checks.run import check_dataset
from kine2go_warp.errors import Kine2GoError
from kine2go_warp.robots import GO2

NONSENSE = (None, [], {}, 1, "x", -5, [1, 2], True, 1e300)


def damaged(content, is_metadata, chance):
    """Content with bits flipped, cut short, partly zero, or with one entry of nonsense."""
    kind = chance.choice(["flip", "cut", "zero", "nonsense"])
    if kind == "nonsense" and is_metadata:
        whole = json.loads(content)
        part = chance.choice([whole, whole.get("attributes") or whole])
        part[chance.choice(list(part))] = chance.choice(NONSENSE)
        return json.dumps(whole).encode()
    place = chance.randrange(len(content))
    if kind == "cut":
        return content[:place]
    if kind == "zero":
        return content[:place] + bytes(len(content[place : place + 40])) + content[place + 40 :]
    return content[:place] + bytes([content[place] ^ 1 << chance.randrange(8)]) + content[place + 1 :]


def survives(dataset, seed):
    chance = random.Random(seed)
    files = sorted(path for path in dataset.rglob("*") if path.is_file())
    if seed % 2:
        files = [path for path in files if path.name == "zarr.json"]
    victim = chance.choice(files)
    before = victim.read_bytes()
    victim.write_bytes(damaged(before, victim.name == "zarr.json", chance))
    with contextlib.suppress(Kine2GoError):
        json.dumps(check_dataset(dataset, GO2).to_json(), allow_nan=False)
    victim.write_bytes(before)


@pytest.mark.filterwarnings("ignore")
@pytest.mark.parametrize("seed", range(20))
def test_a_damaged_file_never_ends_in_a_traceback(seed, dataset_copy):
    survives(dataset_copy, seed)


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore")
def test_many_damaged_files_never_end_in_a_traceback(dataset_copy):
    for seed in range(20, 400):
        survives(dataset_copy, seed)

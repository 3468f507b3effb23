"""Readers meet anything: they return a motion or raise ClipError, and nothing else."""

import numpy as np
import pytest
import torch
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from kine2go_warp.errors import ClipError
from kine2go_warp.motions.generator import DogGait, generate, write_ai4animation
from kine2go_warp.motions.sources import AI4Animation, Solo8, Vhdc
from tests.motions.test_solo8 import trot
from tests.motions.test_vhdc import horse, write

FUZZ = settings(max_examples=60, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])

NUMBERS = st.sampled_from(["", "nan", "inf", "-inf", "1e400", "0x10", "1_0", "--1", "1,1", "\x00", '"', "9" * 400, " "])


@st.composite
def damage(draw, text):
    """Replace, remove or repeat pieces of a text."""
    for _ in range(draw(st.integers(1, 3))):
        start = draw(st.integers(0, max(len(text) - 1, 0)))
        end = draw(st.integers(start, min(start + 200, len(text))))
        text = text[:start] + draw(st.one_of(NUMBERS, st.text(max_size=8))) + text[end:]
    return text


def read_or_refuse(source, path):
    try:
        motion = source.load(path)
    except ClipError as error:
        assert path.name.split(":")[0] in str(error)  # noqa: PT017 - either outcome is right
    else:
        assert np.all(np.isfinite(motion.position))
        assert np.all(np.diff(motion.time) > 0.0)


@pytest.fixture(scope="module")
def dog_text(tmp_path_factory):
    path = tmp_path_factory.mktemp("fuzz") / "dog.txt"
    write_ai4animation(generate(DogGait(), 8).points, path)
    return path.read_text()


@pytest.fixture(scope="module")
def horse_text(tmp_path_factory):
    return write(tmp_path_factory.mktemp("fuzz") / "horse.csv", *horse(num_frames=12)).read_text()


@FUZZ
@given(data=st.data())
def test_dogs(dog_text, tmp_path, data):
    path = tmp_path / "dog.txt"
    path.write_text(data.draw(damage(dog_text)), encoding="utf-8", errors="surrogatepass")
    read_or_refuse(AI4Animation(), path)


@FUZZ
@given(data=st.data())
def test_horses(horse_text, tmp_path, data):
    path = tmp_path / "horse.csv"
    path.write_text(data.draw(damage(horse_text)), encoding="utf-8", errors="surrogatepass")
    read_or_refuse(Vhdc(), path)


@FUZZ
@given(noise=st.binary(max_size=2000))
def test_any_bytes(tmp_path, noise):
    for source, name in ((AI4Animation(), "a.txt"), (Vhdc(), "a.csv"), (Solo8(), "a.pt")):
        path = tmp_path / name
        path.write_bytes(noise)
        read_or_refuse(source, path.with_name(name + ":0") if name.endswith("pt") else path)


@FUZZ
@given(data=st.data())
def test_tensors(tmp_path, data):
    rows = trot(10)[None].repeat(2, axis=0)
    for _ in range(data.draw(st.integers(0, 3))):
        place = tuple(data.draw(st.integers(0, size - 1)) for size in rows.shape)
        rows[place] = data.draw(st.sampled_from([np.nan, np.inf, -np.inf, 1e30, 0.0, -1.0]))
    tensor = torch.tensor(rows[..., : data.draw(st.sampled_from([33, 32, 1]))])
    torch.save(data.draw(st.sampled_from([tensor, [tensor], tensor.to_sparse(), tensor.half()])), tmp_path / "solo8.pt")
    read_or_refuse(Solo8(), tmp_path / f"solo8.pt:{data.draw(st.integers(0, 3))}")


@FUZZ
@given(data=st.data())
def test_damaged_tensor_files(tmp_path, data):
    path = tmp_path / "solo8.pt"
    torch.save(torch.tensor(trot(10)[None]), path)
    content = bytearray(path.read_bytes())
    for _ in range(data.draw(st.integers(1, 10))):
        content[data.draw(st.integers(0, len(content) - 1))] = data.draw(st.integers(0, 255))
    path.write_bytes(bytes(content[: data.draw(st.integers(1, len(content)))]))
    read_or_refuse(Solo8(), tmp_path / "solo8.pt:0")

from collections import Counter
from dataclasses import replace

import pytest

from kine2go_warp.errors import CatalogueError, ClipError
from kine2go_warp.motions.catalogue import load_catalogue, motion_named, parse_catalogue
from kine2go_warp.motions.config import RetargetConfig
from kine2go_warp.motions.retarget import retarget


def test_the_papers_tables_are_in_the_catalogue():
    canter = motion_named("ai4_dog_canter")
    assert (canter.file, canter.frames.start, canter.frames.end, canter.length, canter.sample) == (
        "ai4animation/dog_run00_joint_pos.txt",
        430,
        459,
        571,
        True,
    )
    others = ("generated", "ai4animation_postures")
    papers = [entry for entry in load_catalogue().values() if entry.collection not in others]
    assert len(papers) == 40
    assert Counter(entry.name.split("_")[0] for entry in papers if entry.sample) == {"ai4": 4, "solo8": 2, "vhdc": 2}
    assert sorted({entry.length for entry in papers}) == [300, 571, 960, 1171]
    slow = motion_named("solo8_crawl_slow")
    assert (slow.file, slow.frames.start, slow.frames.end) == ("solo8/solo8_motion_data.pt:0", 25, -1)
    assert all(entry.licence and entry.citation for entry in load_catalogue().values())


def test_an_unknown_motion_brings_similar_names():
    with pytest.raises(CatalogueError, match=r"unknown motion 'ai4-dog-trot'; .*ai4_dog_trot_00|dog_trot"):
        motion_named("ai4-dog-trot")


def test_a_motion_without_data_folder_says_how_to_name_one():
    with pytest.raises(CatalogueError, match="--data"):
        motion_named("ai4_dog_pace").path(None)


def test_a_missing_file_is_named(solver, tmp_path):
    with pytest.raises(ClipError, match=r"dog_walk00_joint_pos\.txt: no such motion file"):
        retarget(motion_named("ai4_dog_pace"), tmp_path, solver, RetargetConfig())


def test_half_flip_jump_says_that_its_reference_is_another_motions():
    jump, walk = (motion_named(f"ai4_dog_synth_{name}") for name in ("half_flip_jump", "ellipse_walk"))
    assert (jump.file, jump.frames) == (walk.file, walk.frames)
    assert "ellipse walk" in jump.description


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (("rate = 60\n", ""), r"catalogue\.toml, line 1, \[collection\.c\]: lacks rate; the fields are source"),
        (('collection = "c"\n', ""), r"line 8, \[\[motion\]\]: lacks collection"),
        (("start = 0", "begin = 0"), r"line 8, \[\[motion\]\]: has unknown begin"),
        (("start = 0", 'start = "0"'), r"line 8, \[\[motion\]\]: start is '0', not a whole number"),
        (('collection = "c"', 'collection = "d"'), r"there is no \[collection\.d\]"),
        (("rate = 60", "rate = 0"), "rate is 0; choose"),
        (("start = 0", 'time_scale = "slow"'), r"line 8, \[\[motion\]\]: time_scale is 'slow', not a number or froude"),
        (("start = 0", "time_scale = 0"), "time_scale is 0; choose 0.1 to 10"),
        (("[[motion]]", "[[motion"), "not TOML"),
    ],
)
def test_a_damaged_catalogue_is_refused_with_its_line(change, message):
    """What docs/adding-a-source.md asks for, with one mistake."""
    collection = '[collection.c]\nsource = "vhdc"\nfolder = "c/"\nlicence = "CC0"\ncitation = "us"\nrate = 60\n\n'
    text = collection + '[[motion]]\nname = "m"\ncollection = "c"\nfile = "m.csv"\nstart = 0\n'
    (entry,) = parse_catalogue(text, "catalogue.toml").values()
    assert (entry.frames.start, entry.frames.end, entry.length, entry.rate) == (0, -1, 571, 60)
    with pytest.raises(CatalogueError, match=message):
        parse_catalogue(text.replace(*change), "catalogue.toml")


def test_a_file_with_another_checksum_is_remarked_on():
    entry = motion_named("dog_trot")
    assert entry.file_remarks(entry.sha256) == ()
    assert entry.file_remarks("0" * 64) == ("dog_trot.txt is not the catalogue's file (its checksum differs)",)
    assert replace(entry, sha256="").file_remarks("0" * 64) == ()


def test_a_file_that_holds_no_motion_and_no_source_is_no_catalogue(tmp_path):
    own = tmp_path / "own.toml"
    own.write_text("")
    with pytest.raises(CatalogueError, match=r"own\.toml: holds no \[\[motion\]\] and no \[source\.NAME\]"):
        load_catalogue(own)

"""The cache of maps: a help that can be lost, cut short or forbidden without harm."""

import os

import numpy as np
import pytest
from sanguine.app.map_cache import MapCache, key_of


@pytest.fixture
def cache(tmp_path):
    return MapCache(tmp_path / "maps")


def array(value=1.0):
    return np.full((8, 8, 2), value, dtype=np.float32)


def test_what_was_made_once_is_read_again(cache):
    first = cache.get("a", array)
    again = MapCache(cache.folder)
    np.testing.assert_array_equal(again.get("a", lambda: pytest.fail("made twice")), first)
    assert (cache.made, cache.hits, again.made, again.hits) == (1, 0, 0, 1)


@pytest.mark.parametrize("damage", [b"", b"\x93NUMPY", b"not an array at all", b"\x93NUMPY\x01\x00\xff\xff{"])
def test_a_damaged_file_is_made_again(cache, damage):
    cache.get("a", array)
    (path,) = cache.folder.iterdir()
    path.write_bytes(damage)
    np.testing.assert_array_equal(cache.get("a", array), array())
    assert cache.made == 2


def test_a_file_cut_short_is_made_again(cache):
    cache.get("a", array)
    (path,) = cache.folder.iterdir()
    path.write_bytes(path.read_bytes()[:-1])
    assert cache.get("a", array).shape == (8, 8, 2)
    assert cache.made == 2


def test_a_pickle_is_never_loaded(cache, tmp_path):
    cache.folder.mkdir()
    np.save(cache.folder / "a.npy", np.array([{}], dtype=object), allow_pickle=True)
    np.testing.assert_array_equal(cache.get("a", array), array())


def test_without_a_folder_or_a_place_to_write_it_still_makes(tmp_path):
    nowhere = tmp_path / "file"
    nowhere.write_text("in the way")
    for cache in (MapCache(None), MapCache(nowhere / "below")):
        np.testing.assert_array_equal(cache.get("a", array), array())
        assert cache.made == 1


def test_what_was_unused_for_longest_goes_first(cache):
    size = 8 * 8 * 2 * 4 + 128
    cache.max_bytes = 2 * size
    for age, key in ((30, "old"), (20, "middle")):
        cache.get(key, array)
        past = os.stat(cache.folder / f"{key}.npy").st_mtime - age
        os.utime(cache.folder / f"{key}.npy", (past, past))
    cache.get("old", array)  # used again: now the middle one is the oldest
    cache.get("new", array)
    assert sorted(path.stem for path in cache.folder.iterdir()) == ["new", "old"]


def test_keys_differ_by_value_type_shape_and_order():
    a = np.arange(6, dtype=np.float32)
    keys = [
        key_of(a), key_of(a.reshape(2, 3)), key_of(a.astype(np.float64)), key_of(a, 1), key_of(1, a), key_of(a + 1),
        key_of("1"), key_of(1), key_of({"b": 1, "a": 2}),
    ]
    assert len(set(keys)) == len(keys)
    assert key_of({"a": 2, "b": 1}) == keys[-1]
    assert key_of(a[::-1][::-1]) == keys[0]

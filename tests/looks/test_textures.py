"""Textures: what is seen of them near and far, and the files that are no pictures."""

import numpy as np
import pytest

from scenegen.looks.configuration import read_looks
from scenegen.looks.textures import PATTERNS, TEXTURE_NAMES, Textures, check_image, image_of, list_files, mean_of
from tests.looks.pictures import four_colors

RED, GREEN, BLUE, WHITE = (1, 0, 0), (0, 1, 0), (0, 0, 1), (1, 1, 1)


def shares(folder, points, pixel, size=0.4):
    name = four_colors(folder)
    textures = Textures({name: (folder / name).read_bytes()})
    x, y = np.array(points, dtype=np.float64).T
    return textures.shares(name, size, x, y, np.full(len(x), pixel))


def test_a_texture_begins_at_the_origin_goes_up_and_to_the_right_and_repeats(tmp_path):
    """It is 0.4 m wide, so 0.2 m high: its lower half is blue and white."""
    middles = {(0.1, 0.05): BLUE, (0.3, 0.05): WHITE, (0.1, 0.15): RED, (0.3, 0.15): GREEN}
    for (x, y), color in middles.items():
        for across, up in ((0, 0), (1, 0), (0, 1), (-3, 7)):
            at = (x + 0.4 * across, y + 0.2 * up)
            np.testing.assert_allclose(shares(tmp_path, [at], 1e-4), [color], atol=1e-6)


def test_from_afar_a_texture_is_its_mean(tmp_path):
    points = np.random.default_rng(0).uniform(-5.0, 5.0, (50, 2))
    np.testing.assert_allclose(shares(tmp_path, points, 10.0), np.full((50, 3), 0.5), atol=0.01)


@pytest.mark.parametrize("pixel", [0.0005, 0.01, 0.05, 0.2])
def test_the_mean_of_a_surface_does_not_depend_on_the_size_of_pixels(tmp_path, pixel):
    """On average over whole repeats every level has the same colour, which is what rules out shimmering."""
    grid = (np.arange(128) + 0.5) / 128
    points = np.stack(np.meshgrid(0.4 * grid, 0.2 * grid), axis=-1).reshape(-1, 2)
    np.testing.assert_allclose(shares(tmp_path, points, pixel).mean(axis=0), 0.5, atol=0.01)


@pytest.mark.parametrize("name", PATTERNS)
def test_patterns_are_greys_that_darken_a_little_and_repeat_without_a_seam(name):
    image = image_of(name, {}).astype(int)
    assert (image[..., 0] == image[..., 1]).all() and 100 < image.min() < image.max() <= 255
    assert 0.75 < mean_of(image.astype(np.uint8))[0] < 0.95
    inside = np.abs(np.diff(image[..., 0], axis=1)).max()
    assert np.abs(image[:, 0, 0] - image[:, -1, 0]).max() <= inside


def test_plain_is_without_a_texture():
    assert (Textures({}).shares("plain", 1.0, np.zeros(3), np.zeros(3), np.ones(3)) == 1.0).all()
    assert "plain" in TEXTURE_NAMES and Textures({}).mean("plain") == (1.0, 1.0, 1.0)


@pytest.mark.parametrize("data", [b"", b"no picture", b"GIF89a" + bytes(40)])
def test_what_is_no_picture_is_refused(data):
    with pytest.raises(ValueError, match="not a PNG or JPEG"):
        check_image(data)


def test_pictures_cut_short_or_huge_are_refused(tmp_path):
    data = (tmp_path / four_colors(tmp_path, size=(400, 400))).read_bytes()
    with pytest.raises(ValueError, match="damaged"):
        check_image(data[: len(data) // 2])
    huge = bytearray(data)
    huge[16:24] = (60_000).to_bytes(4, "big") * 2  # the size that its header announces
    with pytest.raises(ValueError, match=r"pixels|damaged"):
        check_image(bytes(huge))


def test_files_are_found_below_the_folder_in_order(tmp_path):
    for name in ("b.png", "a/c.png", "a/b.jpg"):
        four_colors(tmp_path, name)
    (tmp_path / "a" / "notes.txt").write_text("no picture")
    assert list_files(tmp_path, "**/*") == ["a/b.jpg", "a/c.png", "b.png"]
    for pattern in ("../*.png", "/etc/*", "none/*.png", ""):
        with pytest.raises(ValueError):
            list_files(tmp_path, pattern)


def test_a_file_of_looks_may_begin_with_a_byte_order_mark(tmp_path):
    text = '[ground]\ntexture = "speckle"\n'
    for name, mark in (("a.toml", b""), ("b.toml", b"\xef\xbb\xbf")):
        (tmp_path / name).write_bytes(mark + text.encode())
    assert read_looks(tmp_path / "a.toml").draw_look(3, 1) == read_looks(tmp_path / "b.toml").draw_look(3, 1)

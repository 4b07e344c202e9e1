"""Pictures in and out, on files built byte by byte or written and read back."""

import hashlib
import struct
import zlib

import numpy as np
import pytest

from lib.formats import pictures
from lib.maps.colour import linear_to_srgb, srgb_to_linear
from lib.refusal import Refusal

GREY, RGB, PALETTE, GREY_ALPHA, RGBA = 0, 2, 3, 4, 6  # PNG colour types
CODE = 1 / 255


def chunk(name, data):
    return struct.pack(">I", len(data)) + name + data + struct.pack(">I", zlib.crc32(name + data))


def png(path, width, height, depth, colour_type, raw, extra=b""):
    """Write a PNG of given rows, each with its filter byte."""
    head = chunk(b"IHDR", struct.pack(">IIBBBBB", width, height, depth, colour_type, 0, 0, 0))
    path.write_bytes(b"\x89PNG\r\n\x1a\n" + head + extra + chunk(b"IDAT", zlib.compress(raw)) + chunk(b"IEND", b""))
    return path


def png_rgb(path, codes):
    """Write uint8 or uint16 codes (h, w, 3)."""
    h, w, _ = codes.shape
    depth = 8 * codes.dtype.itemsize
    rows = b"".join(b"\0" + row.astype(f">u{codes.dtype.itemsize}").tobytes() for row in codes)
    return png(path, w, h, depth, RGB, rows)


def no_warning(text):
    raise AssertionError(text)


# ---- what is read


def test_rows_start_at_the_top_and_srgb_is_decoded_exactly(tmp_path):
    codes = np.random.default_rng(0).integers(0, 256, (3, 5, 3), np.uint8)
    got = pictures.read_linear(png_rgb(tmp_path / "a.png", codes), "srgb", no_warning)
    assert got.dtype == np.float32 and np.array_equal(got, srgb_to_linear(codes / 255).astype(np.float32))
    assert np.array_equal(pictures.read_linear(tmp_path / "a.png", "linear"), (codes / 255).astype(np.float32))


def test_one_pixel(tmp_path):
    white = png_rgb(tmp_path / "a.png", np.full((1, 1, 3), 255, np.uint8))
    assert pictures.read_linear(white).tolist() == [[[1, 1, 1]]]


def test_sixteen_bit_copy_is_the_same_picture(tmp_path):
    codes = np.random.default_rng(0).integers(0, 256, (4, 6, 3), np.uint8)
    eight = pictures.read_linear(png_rgb(tmp_path / "8.png", codes))
    sixteen = pictures.read_linear(png_rgb(tmp_path / "16.png", codes.astype(np.uint16) * 257))
    assert np.abs(eight - sixteen).max() < 1e-6
    between = pictures.read_linear(png_rgb(tmp_path / "b.png", np.full((1, 1, 3), 100, np.uint16)), "linear")
    assert np.allclose(between, 100 / 65535)  # not rounded to 8 bits


def test_grey_of_one_eight_and_sixteen_bits(tmp_path):
    one = pictures.read_linear(png(tmp_path / "1.png", 3, 1, 1, GREY, b"\0\xa0"), "linear")
    assert one.tolist() == [[[1] * 3, [0] * 3, [1] * 3]]
    eight = pictures.read_linear(png(tmp_path / "8.png", 2, 1, 8, GREY, b"\0\x33\xff"), "linear")
    assert np.allclose(eight, [[[0.2] * 3, [1] * 3]])


def test_palette(tmp_path):
    path = png(
        tmp_path / "a.png", 3, 1, 8, PALETTE, b"\0\2\0\1", chunk(b"PLTE", bytes([255, 0, 0, 0, 255, 0, 51, 102, 204]))
    )
    got = pictures.read_linear(path, "linear", no_warning)
    assert np.allclose(got, [[[0.2, 0.4, 0.8], [1, 0, 0], [0, 1, 0]]])


def test_alpha_is_ignored_with_one_warning(tmp_path):
    said = []
    path = png(tmp_path / "a.png", 2, 1, 8, RGBA, b"\0" + bytes([51, 102, 204, 128, 255, 51, 0, 0]))
    got = pictures.read_linear(path, "linear", said.append)
    assert np.allclose(got, [[[0.2, 0.4, 0.8], [1, 0.2, 0]]])  # as stored, neither multiplied nor composited
    assert len(said) == 1 and str(path) in said[0] and "alpha" in said[0]
    grey = png(tmp_path / "g.png", 1, 1, 8, GREY_ALPHA, b"\0" + bytes([51, 128]))
    assert np.allclose(pictures.read_linear(grey, "linear"), 0.2)
    opaque = png(tmp_path / "o.png", 1, 1, 8, RGBA, b"\0" + bytes([51, 102, 204, 255]))
    pictures.read_linear(opaque, "linear", no_warning)


@pytest.mark.parametrize(
    "orientation, expected",
    [
        (1, "12/34/56"),
        (2, "21/43/65"),
        (3, "65/43/21"),
        (4, "56/34/12"),
        (5, "135/246"),
        (6, "531/642"),
        (7, "642/531"),
        (8, "246/135"),
    ],
)
def test_exif_orientation_is_applied(orientation, expected, tmp_path):
    codes = np.repeat(np.array([[1, 2], [3, 4], [5, 6]], np.uint8)[..., None] * 40, 3, axis=2)
    path = tmp_path / "a.tif"
    pictures._write(path, "tif", codes, "uint8", {"Orientation": orientation})
    got = np.rint(pictures.read_linear(path, "linear")[..., 0] * 255 / 40).astype(int)
    assert "/".join("".join(map(str, row)) for row in got) == expected
    header = pictures.read_header(path)
    assert (header.height, header.width) == got.shape


def test_header_tells_size_without_decoding(tmp_path):
    header = pictures.read_header(png(tmp_path / "a.png", 3, 1, 8, RGBA, b"\0" + bytes(12)))
    assert header == pictures.Header(3, 1, 4, False, True)


def test_float_pictures_are_linear_and_must_be_reflectances(tmp_path):
    said = []
    pictures.write_exr(tmp_path / "a.exr", np.full((2, 3, 3), 0.25, np.float32))
    assert np.all(pictures.read_linear(tmp_path / "a.exr", "srgb", said.append) == 0.25) and "linear" in said[0]
    assert pictures.read_header(tmp_path / "a.exr").is_float
    for value in (1.001, -0.001):
        texels = np.full((2, 3, 3), 0.25, np.float32)
        texels[1, 2, 0] = value
        pictures.write_exr(tmp_path / "b.exr", texels)
        with pytest.raises(Refusal, match=f"b.exr: pixel row 1, column 2: {value:g}.*0 <= rho <= 1"):
            pictures.read_linear(tmp_path / "b.exr", "linear")
    texels[1, 2, 0] = np.nan
    pictures._write(tmp_path / "n.exr", "exr", texels, "float", {})
    with pytest.raises(Refusal, match="n.exr: pixel row 1, column 2: nan"):
        pictures.read_linear(tmp_path / "n.exr", "linear")


# ---- what is refused


def broken_files(folder):
    codes = np.random.default_rng(0).integers(0, 256, (64, 64, 3), np.uint8)
    whole = png_rgb(folder / "whole.png", codes).read_bytes()
    pictures._write(folder / "whole.jpg", "jpg", codes, "uint8", {})
    pictures.write_exr(folder / "whole.exr", codes / np.float32(255))
    (folder / "cut.png").write_bytes(whole[:-200])
    (folder / "no_end.png").write_bytes(whole[:-12])
    (folder / "head.png").write_bytes(whole[:20])
    (folder / "bad_crc.png").write_bytes(whole[:3000] + bytes(20) + whole[3020:])
    for name in ("whole.jpg", "whole.exr"):
        data = (folder / name).read_bytes()
        (folder / name.replace("whole", "cut")).write_bytes(data[: len(data) // 2])
    (folder / "empty.png").write_bytes(b"")
    (folder / "text.png").write_text("a picture? no")
    (folder / "pointer.png").write_text("version https://git-lfs.github.com/spec/v1\noid sha256:0\nsize 1\n")
    (folder / "folder.png").mkdir()
    png(folder / "huge.png", 60000, 60000, 8, RGB, b"\0")
    png(folder / "wide.png", 2**31 - 1, 1, 8, RGB, b"\0")


@pytest.mark.parametrize(
    "name, reason",
    [
        ("missing.png", "not found"),
        ("folder.png", "folder"),
        ("empty.png", "empty"),
        ("text.png", "not a picture"),
        ("pointer.png", "git lfs pull"),
        ("cut.png", "cut off"),
        ("no_end.png", "cut off"),
        ("head.png", "cut off"),
        ("cut.jpg", "cut off"),
        ("cut.exr", "cut off"),
        ("bad_crc.png", "damaged"),
        ("huge.png", "60000 x 60000"),
        ("wide.png", "2147483647 x 1"),
        ("a\0b.png", "can not be read"),
    ],
)
def test_what_is_no_whole_picture_is_refused_by_name(name, reason, tmp_path):
    broken_files(tmp_path)
    for path in (tmp_path / "whole.png", tmp_path / "whole.jpg", tmp_path / "whole.exr"):
        pictures.read_linear(path)
    with pytest.raises(Refusal) as refused:
        pictures.read_linear(f"{tmp_path}/{name}")
    assert f"{tmp_path}/{name}: " in str(refused.value) and reason in str(refused.value)
    if reason != "damaged" and name != "cut.exr":  # everything else is found before a pixel is decoded
        with pytest.raises(Refusal):
            pictures.read_header(f"{tmp_path}/{name}")


def test_unknown_colour_space(tmp_path):
    with pytest.raises(Refusal, match="colour_space: 'sRBG', allowed are srgb and linear"):
        pictures.read_linear(png_rgb(tmp_path / "a.png", np.zeros((1, 1, 3), np.uint8)), "sRBG")


# ---- what is written


def test_exr_keeps_bits_rows_and_metadata(tmp_path):
    value = np.random.default_rng(0).random((5, 9, 3)).astype(np.float32) * 1e5
    said = {"unit": "W/m^2", "uv_domain": (0, 1, 0, 1), "rho_avg": (0.25, 0.5, 1)}
    pictures.write_exr(tmp_path / "a.exr", value, said)
    got, metadata = pictures.read_exr(tmp_path / "a.exr")
    assert np.array_equal(got, value)
    assert {name: metadata[name] for name in said} == said
    assert "DateTime" not in metadata  # so that the same map gives the same bytes tomorrow
    assert [p.name for p in tmp_path.iterdir()] == ["a.exr"]


def test_same_input_same_bytes(tmp_path):
    value = np.random.default_rng(0).random((33, 17, 3))
    for name, write in (("exr", pictures.write_exr), ("png", pictures.write_png_srgb)):
        digests = set()
        for k in range(2):
            write(tmp_path / f"{k}.{name}", value)
            digests.add(hashlib.sha256((tmp_path / f"{k}.{name}").read_bytes()).hexdigest())
        assert len(digests) == 1


def test_a_map_with_nan_is_never_written(tmp_path):
    for write in (pictures.write_exr, pictures.write_png_srgb):
        with pytest.raises(ValueError, match="finite"):
            write(tmp_path / "a", np.full((2, 2, 3), np.nan))
    assert not list(tmp_path.iterdir())


def test_dither_keeps_codes_and_the_mean_of_an_even_wall():
    codes = np.repeat(np.arange(256)[None, :, None], 3, axis=2)
    assert np.array_equal(pictures.quantise_srgb(srgb_to_linear(codes / 255)), codes)
    for code in (12.3, 100.5, 254.9):
        wall = pictures.quantise_srgb(np.full((64, 64, 3), srgb_to_linear(code / 255)))
        assert np.abs(wall.mean((0, 1)) - code).max() < 0.01 and np.ptp(wall) == 1
        blocks = wall.reshape(8, 8, 8, 8, 3).mean((1, 3))  # no clumps: every 8 x 8 block has nearly the mean
        assert np.abs(blocks - code).max() < 0.1
    assert pictures.quantise_srgb(np.array([[[-1, 0, 7.0]]])).tolist() == [[[0, 0, 255]]]


def test_png_comes_back_to_half_a_code(tmp_path):
    value = np.linspace(0, 1, 64 * 3).reshape(4, 16, 3)
    pictures.write_png_srgb(tmp_path / "a.png", value)
    assert np.abs(pictures.read_png8(tmp_path / "a.png") / 255 - linear_to_srgb(value)).max() <= CODE
    assert pictures.read_header(tmp_path / "a.png") == pictures.Header(16, 4, 3, False, False)


@pytest.mark.parametrize("channels", [1, 3, 4])
def test_png8_keeps_codes_alpha_too(channels, tmp_path):
    codes = np.random.default_rng(0).integers(0, 256, (5, 7, channels), np.uint8)
    pictures.write_png8(tmp_path / "a.png", codes)
    assert np.array_equal(pictures.read_png8(tmp_path / "a.png"), codes)


def test_nothing_is_left_where_writing_fails(tmp_path):
    from lib.formats.artefact import ArtefactError

    (tmp_path / "a.exr").mkdir()
    with pytest.raises(ArtefactError, match="a.exr"):
        pictures.write_exr(tmp_path / "a.exr", np.zeros((2, 2, 3)))
    assert [p.name for p in tmp_path.iterdir()] == ["a.exr"]


def test_codes_are_those_of_the_curve_itself():
    """The chords of texel_kernels.codes only tell where a code is in no doubt: values near codes and others."""
    rng = np.random.default_rng(5)
    codes = srgb_to_linear(rng.integers(0, 256, (64, 128, 3)) / 255)
    values = [rng.random(codes.shape), 10 ** rng.uniform(-6, 0.1, codes.shape), rng.uniform(0.003, 0.0033, codes.shape)]
    row = (0.5 + np.arange(64)[:, None] * pictures.R2[1] + np.arange(3) / 3) % 1
    column = np.arange(128) * pictures.R2[0] % 1
    threshold = row.astype(np.float32)[:, None] + column.astype(np.float32)[:, None]
    threshold = (threshold - (threshold >= 1)) * np.float32(0.998) + np.float32(0.001)
    for value in [*values, codes, np.nextafter(codes.astype(np.float32), np.float32(0))]:
        scaled = linear_to_srgb(value.astype(np.float32)) * 255 + threshold
        assert np.array_equal(pictures.quantise_srgb(value), np.minimum(scaled, 255).astype(np.uint8))


def test_a_png_in_memory_is_that_of_a_file(tmp_path):
    codes = np.random.default_rng(7).integers(0, 256, (9, 5, 3), np.uint8)
    pictures.write_png8(tmp_path / "a.png", codes)
    assert pictures.png_bytes(codes) == (tmp_path / "a.png").read_bytes()


def test_only_noise_is_packed_in_a_hurry(tmp_path):
    codes = np.repeat(np.linspace(0, 255, 512).astype(np.uint8), 3 * 256).reshape(512, 256, 3)
    noise = np.random.default_rng(6).integers(0, 256, codes.shape, np.uint8)
    assert [pictures._png_level(picture) for picture in (codes, noise, noise[:9])] == [6, 2, 6]
    pictures.write_png8(tmp_path / "noise.png", noise)
    assert np.array_equal(pictures.read_png8(tmp_path / "noise.png"), noise)

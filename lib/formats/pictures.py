"""Pictures in and out: textures of any common format, EXR maps, 8-bit PNG.  The one importer of OpenImageIO.

Conventions: an array is (h, w, 3), row 0 = the top row of the picture as it is looked at.  Linear means linear light in
Rec. 709 primaries.  An EXR map breaks the first rule on purpose: its row 0 is v = 0, as glTF's t runs downwards too.

Rules for what a texture file may hold:
- grey becomes three equal channels; palettes are expanded; 16 bit is read as 16 bit; an Exif orientation is applied;
- alpha is ignored: the colours are taken as stored, not composited (one warning if any pixel is not opaque);
- integer files are decoded by `colour_space` (srgb or linear); float files (EXR, HDR, ...) are linear whatever it says;
- every value must be a reflectance, 0 <= rho <= 1; of emission pictures a finite number >= 0.
"""

from __future__ import annotations

import os
import stat
import struct
import zlib
from dataclasses import dataclass
from functools import cache

import numpy as np

from lib.formats.artefact import ArtefactError, atomic
from lib.maps import texel_kernels as kernels
from lib.maps.colour import linear_to_srgb, srgb_to_linear
from lib.refusal import Refusal

COLOUR_SPACES = ("srgb", "linear")
MAX_SIDE = 32768
MAX_PIXELS = 1 << 26  # 8192 x 8192; 0.8 GB as float32 RGB
ANY = float(np.finfo(np.float32).max)  # largest value of a picture that is no reflectance
INTEGERS = {"uint8": np.uint8, "uint16": np.uint16}
# How long to search for repetitions (zlib's level, OpenImageIO's own is 6) in a picture that a quick look shrinks to
# this part at best.  Measured on baked textures: level 2 takes half the time or less for 0 to 3 % more bytes where
# a photograph shows, level 4 a third for 5 %; on smooth light both would cost 10 to 35 % more.
PNG_LEVELS = ((0.55, 2), (0.42, 4), (0.0, 6))
PNG_LEVEL, SMALL = 6, 1 << 18  # the level of a picture of fewer bytes: it takes no time
LOOKED_AT = 16  # of so many rows one


@dataclass(frozen=True)
class Header:
    """What a picture file says of itself, upright: width, height [pixels], channels, is_float, has_alpha."""

    width: int
    height: int
    channels: int
    is_float: bool
    has_alpha: bool


def _openimageio():
    """Loaded with the first picture: most scenes have none when they are read."""
    import OpenImageIO

    return OpenImageIO


def read_header(path):
    """Return the Header of a picture file without decoding pixels.

    Raises Refusal naming the file: missing, unreadable, a directory, empty, no picture, cut off (PNG, JPEG), too large.
    """
    source, spec = _open(path)
    source.close()
    width, height = spec.width, spec.height
    if _orientation(spec) >= 5:
        width, height = height, width
    return Header(width, height, spec.nchannels, _format(spec) not in INTEGERS, spec.alpha_channel >= 0)


def read_linear(path, colour_space="srgb", warn=None, most=1.0):
    """Read a texture as reflectance, or as emission.

    Parameters
    ----------
    path : picture file
    colour_space : "srgb" or "linear", how integer files are encoded
    warn : callable(text) or None; told about ignored alpha and about float files called sRGB
    most : the largest value allowed, 1 or ANY

    Returns
    -------
    (h, w, 3) float32, linear RGB in [0, most], row 0 = top.

    Raises Refusal as read_header does, and for damaged pixels or a texel that is negative, above `most` or NaN.
    """
    texels, light = read_codes(path, colour_space, warn, most)
    return texels if light is None else light[texels]


def read_codes(path, colour_space="srgb", warn=None, most=1.0):
    """Read a texture as stored: (texels (h, w, 3), light), row 0 = top.

    Integer codes, and the linear light of each as `light` (k,) float32; or linear float32, and None. Arguments and
    refusals are those of read_linear.
    """
    if colour_space not in COLOUR_SPACES:
        raise Refusal(f"{path}: colour_space: {colour_space!r}, allowed are {' and '.join(COLOUR_SPACES)}")
    source, spec = _open(path)
    kind = _format(spec)
    pixels = source.read_image(kind if kind in INTEGERS else "float")
    fault = source.geterror()
    source.close()
    if pixels is None or fault or pixels.size != spec.width * spec.height * spec.nchannels:
        raise Refusal(f"{path}: is cut off or damaged: {_first_line(fault) or 'pixels are missing'}")
    pixels = pixels.reshape(spec.height, spec.width, spec.nchannels)

    if spec.alpha_channel >= 0 and warn is not None:
        opaque = np.iinfo(INTEGERS[kind]).max if kind in INTEGERS else 1
        if np.any(pixels[..., spec.alpha_channel] != opaque):
            warn(f"{path}: alpha is ignored, colours are taken as stored")
    if kind not in INTEGERS and colour_space == "srgb" and warn is not None:
        warn(f"{path}: holds floating point values, taken as linear")

    channels = _colour_channels(spec)
    colour = pixels if channels == list(range(spec.nchannels)) else pixels[..., channels]
    colour = np.ascontiguousarray(_upright(colour, _orientation(spec)))
    if kind in INTEGERS:
        return colour, _light(colour.dtype, colour_space)
    _check_values(path, colour, most)
    return np.ascontiguousarray(colour, dtype=np.float32), None


def _light(dtype, colour_space):
    """Linear light of every code of an integer type, a table (k,) float32."""
    top = np.iinfo(dtype).max
    table = np.arange(top + 1) / top
    return (srgb_to_linear(table) if colour_space == "srgb" else table).astype(np.float32)


def _check_values(path, colour, most):
    bad = ~((colour >= 0) & (colour <= most))
    if bad.any():
        row, column, channel = (int(x) for x in np.argwhere(bad)[0])
        found = float(colour[row, column, channel])
        what = "a reflectance must be 0 <= rho <= 1" if most == 1 else "an emission must be a finite number >= 0"
        raise Refusal(f"{path}: pixel row {row}, column {column}: {found:g}, {what}")


def _open(path):
    """Return (ImageInput, spec) of a file that passed every check a header allows."""
    path = os.fspath(path)
    try:
        status = os.stat(path)
        if stat.S_ISDIR(status.st_mode):
            raise Refusal(f"{path}: is a folder, expected a picture file")
        if not stat.S_ISREG(status.st_mode):
            raise Refusal(f"{path}: is not a regular file, expected a picture file")
        if status.st_size == 0:
            raise Refusal(f"{path}: is empty, expected a picture file")
        with open(path, "rb") as file:
            _check_complete(path, file, status.st_size)
    except FileNotFoundError:
        raise Refusal(f"{path}: not found") from None
    except (OSError, ValueError) as error:
        raise Refusal(f"{path}: can not be read: {getattr(error, 'strerror', None) or error}") from None
    oiio = _openimageio()
    wish = oiio.ImageSpec()
    wish.attribute("oiio:UnassociatedAlpha", 1)  # colours as stored, not multiplied by alpha
    source = oiio.ImageInput.open(path, wish)
    if source is None:
        raise Refusal(f"{path}: not a picture that can be read: {_first_line(oiio.geterror())}")
    spec = source.spec()
    if not (0 < spec.width <= MAX_SIDE and 0 < spec.height <= MAX_SIDE and spec.width * spec.height <= MAX_PIXELS):
        source.close()
        raise Refusal(
            f"{path}: {spec.width} x {spec.height} pixels, allowed are up to {MAX_SIDE} a side and {MAX_PIXELS} in all"
        )
    if spec.depth > 1 or spec.nchannels < 1:
        source.close()
        raise Refusal(f"{path}: depth {spec.depth}, {spec.nchannels} channels, expected a flat picture")
    return source, spec


def _check_complete(path, file, size):
    """Refuse a PNG or JPEG whose end is missing or whose header asks for too much, by its marks alone."""
    head = file.read(24)
    if head.startswith(b"version https://git-lfs"):
        raise Refusal(f"{path}: is a Git LFS pointer, not the picture itself; fetch it with: git lfs pull")
    if head.startswith(b"\x89PNG\r\n\x1a\n"):
        if len(head) == 24:
            width, height = struct.unpack(">II", head[16:24])
            if width > MAX_SIDE or height > MAX_SIDE or width * height > MAX_PIXELS:
                raise Refusal(
                    f"{path}: {width} x {height} pixels, allowed are up to {MAX_SIDE} a side and {MAX_PIXELS} in all"
                )
        at = 8
        while at + 12 <= size:
            file.seek(at)
            length, name = struct.unpack(">I4s", file.read(8))
            at += 12 + length
            if name == b"IEND" and at <= size:
                return
        raise Refusal(f"{path}: is cut off: the PNG has no end")
    if head.startswith(b"\xff\xd8\xff"):
        file.seek(0)
        data = file.read()
        at = 2
        while at + 4 <= size and data[at] == 0xFF and data[at + 1] != 0xDA:  # walk the segments before the scan
            at += 2 + struct.unpack(">H", data[at + 2 : at + 4])[0] if data[at + 1] != 0xFF else 1
        if data.rfind(b"\xff\xd9") < at:
            raise Refusal(f"{path}: is cut off: the JPEG has no end")


def _format(spec):
    """Name of the pixel type to decode to: uint8, uint16, or anything else for float."""
    return str(spec.format)


def _colour_channels(spec):
    """Indices of the channels read as R, G, B: by name, else the first three, else the first thrice (grey)."""
    names = [name.upper() for name in spec.channelnames]
    if all(name in names for name in "RGB"):
        return [names.index(name) for name in "RGB"]
    colours = [k for k in range(spec.nchannels) if k != spec.alpha_channel] or [0]
    return colours[:3] if len(colours) >= 3 else [colours[0]] * 3


def _orientation(spec):
    return spec.get_int_attribute("Orientation", 1)


def _upright(pixels, orientation):
    """Turn a picture as stored to the way it is looked at (Exif orientation 1 to 8)."""
    if orientation >= 5:
        pixels = pixels.transpose(1, 0, 2)
    flips = {2: (0, 1), 3: (1, 1), 4: (1, 0), 6: (0, 1), 7: (1, 1), 8: (1, 0)}
    flip_rows, flip_columns = flips.get(orientation, (0, 0))
    return pixels[:: -1 if flip_rows else 1, :: -1 if flip_columns else 1]


def _first_line(text):
    return (text or "").strip().split("\n")[0].rstrip(".")


# Radical inverse of the plane's golden section [Roberts 2018]: its fractional parts spread evenly, like blue noise.
R2 = (0.7548776662466927, 0.5698402909980532)


def _thresholds(h, w):
    """What the thresholds of a fixed pattern without clumps are made of, shifted by channel: (h, 3), (w,) float32."""
    row = (0.5 + np.arange(h)[:, None] * R2[1] + np.arange(3) / 3) % 1
    return row.astype(np.float32), (np.arange(w) * R2[0] % 1).astype(np.float32)


@cache
def _chords():
    """The chords of 255 sRGB(x) that texel_kernels.codes takes for it, (a, b) of each: to 1e-5 of a code."""
    first = np.int64(kernels.FIRST_PIECE)
    x = ((first + np.arange(kernels.N_PIECES + 1)) << kernels.KEPT).astype(np.int32).view(np.float32).astype(np.float64)
    y = 255 * np.where(x < 1, linear_to_srgb(x), 1)
    b = np.diff(y) / np.diff(x)
    return np.stack([y[:-1] - b * x[:-1], b], axis=1).astype(np.float32)


def quantise_srgb(linear):
    """Return 8-bit sRGB codes (h, w, 3) of linear RGB, clipped to [0, 1], dithered without a clock or random numbers.

    A value that is a code exactly keeps it; the mean of an even area is kept to about 1/100 of a code.
    """
    linear = np.ascontiguousarray(linear, dtype=np.float32)
    h, w, _ = linear.shape
    row, column = _thresholds(h, w)
    codes, unsure = np.empty(linear.shape, np.uint8), np.empty(linear.size, np.int64)
    n = kernels.codes(linear, linear.view(np.int32), row, column, _chords(), codes, unsure)
    # About one in a thousand lies so near to the next code that the curve itself has to say which it is.
    some = unsure[:n]
    texel, channel = np.divmod(some, 3)
    codes.reshape(-1)[some] = _codes(linear.reshape(-1)[some], row[texel // w, channel] + column[texel % w])
    return codes


def _codes(linear, threshold):
    """8-bit sRGB codes of linear light, rounded up from a threshold on; both float32, thresholds in [0, 2)."""
    threshold -= threshold >= 1
    threshold *= kernels.SHRUNK
    threshold += kernels.RAISED
    scaled = linear_to_srgb(linear)
    scaled *= 255
    scaled += threshold
    return np.minimum(scaled, 255, out=scaled).astype(np.uint8)


def write_png_srgb(path, linear):
    """Write linear RGB (h, w, 3), row 0 = top, as a dithered 8-bit sRGB PNG: its bytes. Raises ValueError,
    ArtefactError.
    """
    linear = np.asarray(linear)
    if linear.ndim != 3 or linear.shape[2] != 3 or not np.isfinite(linear).all():
        raise ValueError(f"linear: expected finite (h, w, 3), found {linear.shape}")
    write_png8(path, quantise_srgb(linear))
    with open(path, "rb") as file:
        return file.read()


def write_png8(path, codes):
    """Write uint8 codes (h, w), (h, w, 1), (h, w, 3) or (h, w, 4) as a PNG, row 0 = top. Raises ArtefactError."""
    _write(path, "png", *_png(codes))


def png_bytes(codes):
    """The bytes of the PNG that write_png8 writes, made in memory."""
    with os.fdopen(os.memfd_create("png"), "rb") as file:
        fault = _encode(f"/proc/self/fd/{file.fileno()}", "png", *_png(codes))
        if fault:
            raise ArtefactError(f"picture: can not be written: {fault}")
        return file.read()


def _png(codes):
    """Pixels, type and attributes of a PNG."""
    codes = np.asarray(codes)
    if codes.dtype != np.uint8:
        raise ValueError(f"codes: expected uint8, found {codes.dtype}")
    codes = codes.reshape(*codes.shape[:2], -1)
    return codes, "uint8", {"oiio:UnassociatedAlpha": 1, "png:compressionLevel": _png_level(codes)}


def _png_level(codes):
    """zlib's level for codes (h, w, channels): noise is not worth a long search."""
    if codes.size < SMALL:
        return PNG_LEVEL
    some = codes[::LOOKED_AT]
    step = some.copy()
    step[:, 1:] -= some[:, :-1]
    part = len(zlib.compress(step.tobytes(), 1)) / step.size
    return next(level for least, level in PNG_LEVELS if part >= least)


def write_exr(path, linear, metadata=None):
    """Write a map (h, w, 3) float32 as lossless 32-bit EXR, row 0 = v 0 = first line of the file.

    metadata: {name: str, number, or sequence of numbers}. The bytes depend on the arguments alone: no time stamp.
    Raises ValueError for NaN or Inf (never in a map), ArtefactError when the file can not be written.
    """
    linear = np.asarray(linear, np.float32)
    if linear.ndim != 3 or linear.shape[2] != 3 or not np.isfinite(linear).all():
        raise ValueError(f"{path}: expected finite (h, w, 3), found {linear.shape}")
    _write(path, "exr", linear, "float", {"compression": "zip", "DateTime": "", **(metadata or {})})


def _write(path, extension, pixels, kind, attributes):
    with atomic(path) as file:
        fault = _encode(file.name, extension, pixels, kind, attributes)
        if fault:
            raise ArtefactError(f"{path}: can not be written: {fault}")


def _encode(name, extension, pixels, kind, attributes):
    """Write a picture into a file of any name: why that failed, "" if it did not."""
    h, w, channels = pixels.shape
    oiio = _openimageio()
    spec = oiio.ImageSpec(w, h, channels, kind)
    for key, value in attributes.items():
        if isinstance(value, str | int | float):
            spec.attribute(key, value)
        else:
            numbers = tuple(float(x) for x in value)
            spec.attribute(key, f"float[{len(numbers)}]", numbers)
    out = oiio.ImageOutput.create(f"x.{extension}")
    done = out.open(name, spec) and out.write_image(np.ascontiguousarray(pixels))
    done = out.close() and done
    return "" if done else _first_line(out.geterror()) or "disk full?"


def read_exr(path):
    """Read an EXR map: ((h, w, 3) float32 as stored, dict of its metadata). Raises Refusal as read_header does."""
    pixels, spec = _pixels(path, "float")
    metadata = {p.name: p.value for p in spec.extra_attribs}
    return np.ascontiguousarray(pixels[..., _colour_channels(spec)], np.float32), metadata


def read_png8(path):
    """Read a picture's 8-bit codes as stored: (h, w, channels) uint8. Raises Refusal as read_header does."""
    return _pixels(path, "uint8")[0]


def _pixels(path, kind):
    """((h, w, channels) numbers of a picture as `kind`, its ImageSpec)."""
    source, spec = _open(path)
    pixels = source.read_image(kind)
    fault = source.geterror()
    source.close()
    if pixels is None or fault:
        raise Refusal(f"{path}: is cut off or damaged: {_first_line(fault)}")
    return pixels.reshape(spec.height, spec.width, spec.nchannels), spec

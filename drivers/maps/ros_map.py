"""Occupancy maps as ROS keeps them: a ``.yaml`` that describes an image, and the image (``.pgm``, ``.png``).

The files are east-north-up: x east, y north, the image's first row the northernmost, ``origin`` the place of its
lower left corner. An :class:`OccupancyMap` is north-east: row 0 the southernmost, ``[row, column]`` for
(north, east). The conversion happens here and nowhere else. A map that is turned (``origin`` with a yaw other than
zero) is refused: its cells do not lie along north and east, and would have to be drawn anew.

With s the mean of a pixel's colours between 0 (black) and 1 (white), its occupancy p is 1 - s, or s with
``negate``. The modes are those of nav2's map server:

``trinary``
    occupied (1) if p > ``occupied_thresh``, free (0) if p < ``free_thresh``, otherwise unknown (NaN). An image's
    transparency, if it has any, counts as one of its colours.
``scale``
    the same at both ends, between them (p - ``free_thresh``) / (``occupied_thresh`` - ``free_thresh``); unknown
    where the image is transparent.
``raw``
    the pixel's value from 0 to 100 is the occupancy in per cent, whatever ``negate`` and the thresholds say; above
    that it is unknown.

PyYAML and Pillow read and write the files; they come with the extra ``maps``.
"""

from __future__ import annotations

import importlib
import io
import math
import os
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any, Literal, NamedTuple, cast

import msgspec
import numpy as np
from numpy.typing import NDArray

Mode = Literal["trinary", "scale", "raw"]
Occupancy = NDArray[np.float64]

LARGEST_YAML = 1 << 16
LARGEST_IMAGE = 1 << 28
"""Most bytes of the two files."""
MOST_PIXELS = 1 << 26

_FORMATS = ("PPM", "PNG", "BMP")
_UNKNOWN_TRINARY, _FREE_TRINARY, _OCCUPIED_TRINARY = 205, 254, 0
_UNKNOWN_RAW = 255
_BANDS_WITH_TRANSPARENCY = 4


class MapError(ValueError):
    """A map that cannot be read or written; the text begins with the path of the file."""


class OccupancyMap(NamedTuple):
    """What is where, in north and east.

    Attributes
    ----------
    resolution : float
        Side of a cell, metres.
    north, east : float
        South-west corner of the cell [0, 0], metres from the map's origin.
    occupancy : (rows, columns) float64
        Probability that a cell is occupied; rows go north, columns east; NaN where nothing is known.
    """

    resolution: float
    north: float
    east: float
    occupancy: Occupancy


class _Description(msgspec.Struct, forbid_unknown_fields=False):
    """The ``.yaml``, as nav2 and map_server read it."""

    image: str
    resolution: float
    origin: tuple[float, float, float]
    occupied_thresh: float
    free_thresh: float
    negate: bool | int = False
    mode: Mode = "trinary"


def read_map(path: Path) -> OccupancyMap:
    """Read a map by its ``.yaml``; the image's path is taken from the folder that this lies in.

    Raises
    ------
    MapError
        A file that is missing, too large or damaged, a field that is missing or makes no sense, or a map that
        is turned.
    ModuleNotFoundError
        The extra ``maps`` is not installed.
    """
    description = _description(path)
    image = path.parent / description.image
    occupancy = _occupancy(description, _image(image))
    east, north, _ = description.origin
    return OccupancyMap(description.resolution, north, east, np.ascontiguousarray(occupancy[::-1]))


def write_map(path: Path, given: OccupancyMap, mode: Mode = "trinary") -> Path:
    """Write a map as ``path`` (``.yaml``) and an image of the same name beside it (``.pgm``).

    ``trinary`` keeps free, occupied and unknown, divided at 0.196 and 0.65; ``raw`` keeps per cents; ``scale``
    keeps 255 shades, but a ``.pgm`` of that mode has none for unknown.

    Returns
    -------
    Path
        The image.

    Raises
    ------
    MapError
        A map that makes no sense, unknown cells in mode ``scale``, or a file that cannot be written.
    ModuleNotFoundError
        The extra ``maps`` is not installed.
    """
    _check_map(path, given)
    if path.suffix not in {".yaml", ".yml"}:
        raise MapError(f"{path}: the description of a map ends in .yaml")
    pixels, occupied, free = _pixels(path, given.occupancy, mode)
    image = path.with_suffix(".pgm")
    description = {
        "image": image.name,
        "mode": mode,
        "resolution": given.resolution,
        "origin": [given.east, given.north, 0.0],
        "negate": 0,
        "occupied_thresh": occupied,
        "free_thresh": free,
    }
    packed = io.BytesIO()
    _module("PIL.Image").fromarray(np.ascontiguousarray(pixels[::-1])).save(packed, "PPM")
    text = cast(str, _module("yaml").safe_dump(description, sort_keys=False, default_flow_style=None))
    try:
        _replace(image, packed.getvalue())
        _replace(path, text.encode())
    except OSError as error:
        raise MapError(f"{path}: cannot be written: {error.strerror or error}") from error
    return image


def _module(name: str) -> Any:
    try:
        return importlib.import_module(name)
    except ModuleNotFoundError as error:
        raise ModuleNotFoundError(
            f"maps are read and written with {name.partition('.')[0]}: pip install 'beliefd[maps]'"
        ) from error


def _bytes(path: Path, most: int) -> bytes:
    try:
        with path.open("rb") as file:
            content = file.read(most + 1)
    except (OSError, ValueError) as error:  # ValueError: a name with a zero byte
        raise MapError(f"{path}: cannot be read: {getattr(error, 'strerror', None) or error}") from error
    if len(content) > most:
        raise MapError(f"{path}: larger than {most} bytes")
    return content


def _description(path: Path) -> _Description:
    yaml = _module("yaml")
    text = _bytes(path, LARGEST_YAML)
    try:
        fields: object = yaml.safe_load(text)
        description = msgspec.convert(fields, _Description, strict=True)
    except Exception as error:  # PyYAML's constructors raise whatever they stumble over
        raise MapError(f"{path}: no description of a map: {error}") from error
    fault = _fault(description)
    if fault is not None:
        raise MapError(f"{path}: {fault}")
    return description


def _fault(description: _Description) -> str | None:
    """What is wrong with the numbers of a description."""
    free, occupied = description.free_thresh, description.occupied_thresh
    yaw = description.origin[2]
    rules: Mapping[str, bool] = {
        f"resolution must be positive and finite, got {description.resolution}": 0.0
        < description.resolution
        < math.inf,
        f"origin must be finite, got {description.origin}": all(map(math.isfinite, description.origin)),
        f"origin has a yaw of {yaw} rad; only maps along north and east (yaw 0) can be read": yaw == 0.0,
        f"0 <= free_thresh < occupied_thresh <= 1 is needed, got {free} and {occupied}": 0.0
        <= free
        < occupied
        <= 1.0,
        f"negate must be 0 or 1, got {description.negate}": description.negate in (0, 1),
        "image has no name": bool(description.image),
    }
    return next((fault for fault, holds in rules.items() if not holds), None)


def _image(path: Path) -> NDArray[Any]:
    """Pixels with their bands, (rows, columns, bands), of 1, 8 or 16 bits; the first row is the top."""
    module = _module("PIL.Image")
    content = _bytes(path, LARGEST_IMAGE)
    opening = cast(Callable[..., Any], module.open)
    try:
        with opening(io.BytesIO(content), formats=_FORMATS) as image:
            return _bands(image)
    except Exception as error:  # Pillow's decoders raise whatever they stumble over
        raise MapError(f"{path}: no image that can be read: {error}") from error


def _bands(image: Any) -> NDArray[Any]:
    if image.width * image.height > MOST_PIXELS:
        raise ValueError(f"{image.width} by {image.height} pixels are too many")
    if image.mode in {"P", "LA", "PA"}:
        image = image.convert("RGBA" if image.has_transparency_data else "RGB")
    pixels = np.asarray(image)
    return pixels.reshape(*pixels.shape[:2], -1)


def _shade(bands: NDArray[Any]) -> Occupancy:
    """Mean of the bands as a share of white."""
    white = {np.dtype(np.bool_): 1.0, np.dtype(np.uint8): 255.0}.get(bands.dtype, 65535.0)
    return cast(Occupancy, bands.mean(axis=2, dtype=np.float64) / white)


def _occupancy(description: _Description, bands: NDArray[Any]) -> Occupancy:
    """Occupancy of each pixel by the description's mode."""
    transparency = bands.shape[2] == _BANDS_WITH_TRANSPARENCY
    colours = bands[:, :, :-1] if transparency else bands
    if description.mode == "raw":
        per_cent = np.round(_shade(colours) * 255.0)
        return np.where(per_cent <= 100.0, per_cent / 100.0, np.nan)
    trinary = description.mode == "trinary"
    shade = _shade(bands if trinary else colours)
    free, occupied = description.free_thresh, description.occupied_thresh
    p = shade if description.negate else 1.0 - shade
    between = np.full(p.shape, np.nan) if trinary else (p - free) / (occupied - free)
    scaled = np.where(p > occupied, 1.0, np.where(p < free, 0.0, between))
    if transparency and not trinary:
        scaled[bands[:, :, -1] != np.iinfo(bands.dtype).max] = np.nan
    return scaled


def _pixels(path: Path, occupancy: Occupancy, mode: Mode) -> tuple[NDArray[np.uint8], float, float]:
    """Shade of each cell, and the two thresholds that belong to them."""
    unknown = np.isnan(occupancy)
    known = np.where(unknown, 0.0, occupancy)
    if mode == "raw":
        return np.where(unknown, _UNKNOWN_RAW, np.round(100.0 * known)).astype(np.uint8), 0.65, 0.196
    if mode == "scale":
        if unknown.any():
            raise MapError(f"{path}: mode scale has no shade for {unknown.sum()} unknown cells; use raw")
        return np.round(255.0 * (1.0 - known)).astype(np.uint8), 1.0, 0.0
    trinary = np.full(occupancy.shape, _UNKNOWN_TRINARY, np.uint8)
    trinary[occupancy > 0.65] = _OCCUPIED_TRINARY
    trinary[occupancy < 0.196] = _FREE_TRINARY
    return trinary, 0.65, 0.196


def _check_map(path: Path, given: OccupancyMap) -> None:
    occupancy = given.occupancy
    if occupancy.ndim != 2 or occupancy.size == 0:
        raise MapError(f"{path}: a map has rows and columns, got shape {occupancy.shape}")
    if ((occupancy < 0.0) | (occupancy > 1.0)).any():
        raise MapError(f"{path}: occupancy lies in 0 to 1, or is NaN where unknown")
    if not (0.0 < given.resolution < math.inf and math.isfinite(given.north) and math.isfinite(given.east)):
        raise MapError(
            f"{path}: resolution must be positive and the corner finite, got {given.resolution}, "
            f"north {given.north}, east {given.east}"
        )


def _replace(path: Path, content: bytes) -> None:
    """Write a file so that a reader meets the old one or the new one, never half of it."""
    beside = path.with_name(f"{path.name}.{os.getpid()}.tmp")
    try:
        beside.write_bytes(content)
        beside.replace(path)
    finally:
        beside.unlink(missing_ok=True)

"""The messages between a bench and its front end, as records.

`tools/bench/protocol.py` writes ``bench/front/src/protocol.ts`` from this module, so that both sides have the same
definitions. Lengths are metres unless they are text with a unit. A message is JSON; pictures and files follow it
as buffers of bytes.
"""

from __future__ import annotations

from typing import Any, Literal, NotRequired, TypedDict

Value = Any
"""What a camera file may contain: text, a number, a truth value, a list or a table."""
Table = dict[str, Value]
Where = list[str | int]
"""A path in the document, without "camera": ["elements", 0, "z"]."""
Pair = tuple[float, float]
Shape = tuple[int, int]


class Camera(TypedDict):
    """The tables of a camera file."""

    elements: NotRequired[list[Table]]
    sensor: Table


class ViewRange(TypedDict):
    """Selected views: (first, last) row and column."""

    rows: Shape
    columns: Shape


class ViewsPlane(TypedDict):
    """The position of the plane of the views."""

    z: str
    decentre: Value


class BenchDocument(TypedDict):
    """The state of a bench."""

    camera: Camera
    light_field: str
    views: ViewRange | None
    aperture: ViewsPlane
    wavelengths: list[str] | None
    exposure: float | None
    noise: bool


# --- what can be added and set ---

Takes = Literal["number", "whole number", "text", "truth", "list", "array", "name", "table"]


class Parameter(TypedDict):
    """A parameter of an element, the sensor or a pattern; ``family`` names the list from which it is chosen."""

    name: str
    words: str
    unit: Literal["length", "angle", "time"] | None
    needed: bool
    default: Value
    takes: list[Takes]
    choices: list[str]
    family: NotRequired[str]
    parameters: NotRequired[list[Parameter]]


class Kind(TypedDict):
    """A kind of element or pattern.

    ``addable``: whether a bench can add such an element; ``cells``: whether such a pattern is an array of cells.
    """

    kind: str
    words: str
    addable: NotRequired[bool]
    cells: NotRequired[bool]
    parameters: list[Parameter]


class Preset(TypedDict):
    """A camera to begin with; its thumbnail is the buffer of the same number."""

    title: str
    label: str
    words: str


class Parts(TypedDict):
    """What a bench offers."""

    light_fields: list[str]
    kinds: list[Kind]
    families: dict[str, list[Kind]]
    sensor: list[Parameter]
    gallery: list[str]
    presets: list[Preset]


# --- the side view ---


class Snap(TypedDict):
    """A position that brings something into focus."""

    z: float
    words: str


class Handle(TypedDict):
    """A handle that changes a parameter of an element or the sensor.

    Args:
        where: the parameter, in the element's table.
        words: its name.
        value: now; as a length in metres, an angle in radians, or the extent of slopes, both signs together.
        z: where the handle stands, relative to the element.
        height: likewise, from the axis.
        rate: change of the value for each metre that the handle is dragged along ``along``.
        along: the direction in which it is dragged.
        unit: of the value.
        pair: place in a list of two, if the parameter may be a list.
        other: the other value of that list.
    """

    where: list[str]
    words: str
    value: float
    z: float
    height: float
    rate: float
    along: Literal["z", "height"]
    unit: Literal["length", "angle", "slope"]
    pair: int | None
    other: float | None


class SideElement(TypedDict):
    """An element in the drawing; heights from the axis, upwards.

    Args:
        drawn: the symbol.
        converging: of a lens.
        towards: of a prism: the side on which it is thick.
        beam: of a block: half the height of the light in it if no rim is known.
        half: half the height; None if unbounded.
        openings: [z, low, high] of each rim.
        profile: [height, depth from 0 to 1] of glass, towards the scene.
        shades: [low, high, transmission].
        roughness: [height, strength from 0 to 1].
        snaps: positions that bring the scene into focus.
        handles: parameters to drag.
    """

    element: int
    kind: str
    name: str
    label: list[str]
    z: float
    length: float
    decentre: float
    drawn: Literal["lens", "block", "prism", "glass", "frosted", "mask", "sheet"]
    half: float | None
    converging: NotRequired[bool]
    towards: NotRequired[float]
    beam: NotRequired[float]
    openings: NotRequired[list[tuple[float, float, float]]]
    profile: NotRequired[list[Pair]]
    shades: NotRequired[list[tuple[float, float, float]]]
    roughness: NotRequired[list[Pair]]
    snaps: list[Snap]
    handles: list[Handle]


class SideSensor(TypedDict):
    """The sensor in the drawing."""

    label: list[str]
    z: float
    half: float
    decentre: float
    handles: list[Handle]


class SideAperture(TypedDict):
    """The plane of the views: its position and the borders of the views' cells."""

    label: list[str]
    z: float
    decentre: float
    borders: list[float]
    snaps: list[Snap]


class Rays(TypedDict):
    """A fan of rays from a point.

    Args:
        role: why it is drawn.
        distance: of the point; None for infinity.
        words: as text.
        paths: points [z, height, remaining light] of each ray; one that is stopped ends before the sensor.
        meet: [z, height] of the image of the point, if it is near the sensor.
    """

    role: Literal["focused", "near", "far", "off axis", "given"]
    distance: float | None
    words: str
    paths: list[list[tuple[float, float, float]]]
    meet: Pair | None


class Side(TypedDict):
    """The side view of a camera; ``start``, ``end`` and ``half`` are the range to draw.

    Args:
        axis: the direction across the axis that points upwards: x, which is to the right in the scene, or y.
    """

    axis: Literal["x", "y"]
    start: float
    end: float
    half: float
    elements: list[SideElement]
    sensor: SideSensor
    aperture: SideAperture | None
    rays: list[Rays]
    snaps: list[Snap]
    words: list[str]


# --- the image ---


class Look(TypedDict):
    """How the image is shown.

    Args:
        black: the irradiance shown as black, as a share of white.
        linear: whether codes are proportional to irradiance; otherwise sRGB.
        channel: the only channel shown, from 0; None for all.
        photodiodes: "sum", or "apart" for the images of photodiodes side by side.
        axis: the direction that points upwards in the side view.
    """

    black: float
    linear: bool
    channel: int | None
    photodiodes: Literal["sum", "apart"]
    axis: Literal["x", "y"]


class Histogram(TypedDict):
    """Counts of pixels by irradiance, between 0 and ``most``.

    Args:
        most: the upper end.
        counts: of each channel.
        below: share of the channel values at or below black.
        above: share above white.
    """

    most: float
    counts: list[list[int]]
    below: float
    above: float


class Note(TypedDict):
    """A warning, and the element that it names."""

    element: int | None
    words: str


class Pin(TypedDict):
    """A kept state. Its thumbnail is a buffer.

    Args:
        number: its name, counted from 1.
        words: the difference from the previous pin, or the camera.
        psnr: of its image against the reference, dB; None if equal, or if it cannot be compared.
        same: whether its image equals the reference.
        compared: whether it is the reference.
    """

    number: int
    words: str
    psnr: float | None
    same: bool
    compared: bool


class Curve(TypedDict):
    """Values along a line across the image.

    Args:
        places: distance from the start on the sensor, metres.
        values: irradiance of each channel at these.
    """

    places: list[float]
    values: list[list[float]]


class Plane(TypedDict):
    """A plane of phase space: range of positions and slopes."""

    title: str
    z: float
    place: Pair
    slope: Pair
    shape: Shape


class Extent(TypedDict):
    """Ranges of position and slope."""

    place: Pair
    slope: Pair


# --- from the bench ---


class KeyMessage(TypedDict):
    """The key that restores a session after a lost connection."""

    key: str


class PartsMessage(Parts):
    """What the bench offers, once."""


class StateMessage(TypedDict):
    """The document is absent while something moves: the front end has changed its own copy already."""

    turn: int
    document: BenchDocument | None
    undo: bool
    redo: bool
    grid: list[int] | None
    bands: list[float] | None
    side: Side


class PictureMessage(TypedDict):
    """An image; its buffer is a JPEG, upright.

    Args:
        turn: number of the message that requested it.
        coarse: whether it has fewer pixels or rays than the sensor's image, or is less accurate.
        moving: whether it was made during a drag.
        shape: rows and columns of the JPEG.
        white: irradiance shown as white.
        look: how it is shown.
        channels: of the image; 0 for a grey one.
        photodiodes: rows and columns in a pixel.
        missing: share of the rays that the light field lacks.
        took: milliseconds.
        psnr: against the reference pin, dB.
        same: whether it equals that.
        histogram: of a whole image.
    """

    turn: int
    coarse: bool
    moving: bool
    shape: Shape
    white: float
    look: Look
    channels: int
    photodiodes: Shape
    missing: float
    took: float
    psnr: float | None
    same: bool
    histogram: Histogram | None


class ValueMessage(TypedDict):
    """The values of a pixel, and its position on the sensor: right and down as displayed, metres."""

    x: int
    y: int
    place: Pair
    irradiance: list[float]
    recorded: list[float] | None


class NotesMessage(TypedDict):
    """Warnings about the image of a turn."""

    turn: int
    notes: list[Note]


class NoPictureMessage(TypedDict):
    """Why there is no image."""

    turn: int
    words: str


class FailedMessage(TypedDict):
    """A bug in the program."""

    words: str


class PinsMessage(TypedDict):
    """All pins; the buffers are the thumbnails, then the image of the reference.

    Args:
        psnr: of the image that is shown against the reference, dB.
        same: whether it equals that.
    """

    pins: list[Pin]
    psnr: float | None
    same: bool


class FileMessage(TypedDict):
    """A file to save; its buffer has the bytes."""

    name: str
    type: str


class RefusedMessage(TypedDict):
    """A request that was refused, or a remark on one that was done in another way than asked.

    Args:
        words: what is wrong and what to do.
        where: the parameter.
        do: of the message.
        turn: of the message.
        done: whether it was done all the same.
    """

    words: str
    where: Value
    do: str
    turn: int
    done: NotRequired[bool]


class ProgressMessage(TypedDict):
    """The progress of long work."""

    done: int
    total: int
    words: str


class ExplainAnswer(TypedDict):
    """The text of ``explain``."""

    words: str


class PointAnswer(TypedDict):
    """The image of a point, its JPEG as a buffer."""

    words: str
    shape: Shape
    distance: float | None
    outside: float
    remark: str | None


class MtfAnswer(TypedDict):
    """Contrast by frequency: [cycles per millimetre, contrast]."""

    unit: str
    across: list[Pair]
    down: list[Pair]
    pixels: float
    distance: float | None
    remark: str | None


class PhaseSpaceAnswer(TypedDict):
    """Planes of phase space, their JPEGs as buffers; ``frame`` is the range of all planes if one was requested."""

    planes: list[Plane]
    frame: Extent | None
    remark: str | None


class ProfileAnswer(Curve):
    """The image along a line: (x, y) of its ends in pixels."""

    ends: tuple[int, int, int, int]


class ScrubAnswer(TypedDict):
    """The frames of a sweep as JPEGs, with the value of each."""

    label: str
    values: list[str]
    took: float


class DecodedAnswer(TypedDict):
    """Decoded views, or only ``why`` there are none; None stands for an infinite distance."""

    why: NotRequired[str]
    words: NotRequired[str]
    remarks: NotRequired[list[str]]
    views: NotRequired[Shape]
    shape: NotRequired[Shape]
    nearest: NotRequired[float | None]
    farthest: NotRequired[float | None]
    focus: NotRequired[float | None]
    distance: NotRequired[float | None]


class RefocusedAnswer(TypedDict):
    """A refocused image, its JPEG as a buffer."""

    distance: float | None


FROM_BENCH = {
    "key": KeyMessage,
    "parts": PartsMessage,
    "state": StateMessage,
    "picture": PictureMessage,
    "value": ValueMessage,
    "notes": NotesMessage,
    "no picture": NoPictureMessage,
    "failed": FailedMessage,
    "pins": PinsMessage,
    "file": FileMessage,
    "refused": RefusedMessage,
    "progress": ProgressMessage,
}
"""Messages from the bench by the value of ``is``."""

ANSWERS = {
    "explain": ExplainAnswer,
    "point spread": PointAnswer,
    "mtf": MtfAnswer,
    "phase space": PhaseSpaceAnswer,
    "profile": ProfileAnswer,
    "scrub": ScrubAnswer,
    "decoded": DecodedAnswer,
    "refocused": RefocusedAnswer,
}
"""Messages whose ``is`` is "answer", by the value of ``what``."""

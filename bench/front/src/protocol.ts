/** Written by tools/bench/protocol.py from vcc/bench/messages.py: change that. */

export type Value = null | boolean | number | string | Value[] | { [name: string]: Value };
export type Table = { [name: string]: Value };
/** A path in the document, without "camera": ["elements", 0, "z"]. */
export type Where = (string | number)[];

/** The tables of a camera file. */
export interface Camera {
  elements?: Table[];
  sensor: Table;
}

/** Selected views: (first, last) row and column. */
export interface ViewRange {
  rows: [number, number];
  columns: [number, number];
}

/** The position of the plane of the views. */
export interface ViewsPlane {
  z: string;
  decentre: Value;
}

/** The state of a bench. */
export interface BenchDocument {
  camera: Camera;
  light_field: string;
  views: ViewRange | null;
  aperture: ViewsPlane;
  wavelengths: string[] | null;
  exposure: number | null;
  noise: boolean;
}

/** A parameter of an element, the sensor or a pattern; `family` names the list from which it is chosen. */
export interface Parameter {
  name: string;
  words: string;
  unit: "length" | "angle" | "time" | null;
  needed: boolean;
  default: Value;
  takes: ("number" | "whole number" | "text" | "truth" | "list" | "array" | "name" | "table")[];
  choices: string[];
  family?: string;
  parameters?: Parameter[];
}

/** A kind of element or pattern. */
export interface Kind {
  kind: string;
  words: string;
  addable?: boolean;
  cells?: boolean;
  parameters: Parameter[];
}

/** A camera to begin with; its thumbnail is the buffer of the same number. */
export interface Preset {
  title: string;
  label: string;
  words: string;
}

/** What a bench offers. */
export interface Parts {
  light_fields: string[];
  kinds: Kind[];
  families: { [name: string]: Kind[] };
  sensor: Parameter[];
  gallery: string[];
  presets: Preset[];
}

/** A position that brings something into focus. */
export interface Snap {
  z: number;
  words: string;
}

/** A handle that changes a parameter of an element or the sensor. */
export interface Handle {
  /** The parameter, in the element's table. */
  where: string[];
  /** Its name. */
  words: string;
  /** Now; as a length in metres, an angle in radians, or the extent of slopes, both signs together. */
  value: number;
  /** Where the handle stands, relative to the element. */
  z: number;
  /** Likewise, from the axis. */
  height: number;
  /** Change of the value for each metre that the handle is dragged along ``along``. */
  rate: number;
  /** The direction in which it is dragged. */
  along: "z" | "height";
  /** Of the value. */
  unit: "length" | "angle" | "slope";
  /** Place in a list of two, if the parameter may be a list. */
  pair: number | null;
  /** The other value of that list. */
  other: number | null;
}

/** An element in the drawing; heights from the axis, upwards. */
export interface SideElement {
  element: number;
  kind: string;
  name: string;
  label: string[];
  z: number;
  length: number;
  decentre: number;
  /** The symbol. */
  drawn: "lens" | "block" | "prism" | "glass" | "frosted" | "mask" | "sheet";
  /** Half the height; None if unbounded. */
  half: number | null;
  /** Of a lens. */
  converging?: boolean;
  /** Of a prism: the side on which it is thick. */
  towards?: number;
  /** Of a block: half the height of the light in it if no rim is known. */
  beam?: number;
  /** [z, low, high] of each rim. */
  openings?: [number, number, number][];
  /** [height, depth from 0 to 1] of glass, towards the scene. */
  profile?: [number, number][];
  /** [low, high, transmission]. */
  shades?: [number, number, number][];
  /** [height, strength from 0 to 1]. */
  roughness?: [number, number][];
  /** Positions that bring the scene into focus. */
  snaps: Snap[];
  /** Parameters to drag. */
  handles: Handle[];
}

/** The sensor in the drawing. */
export interface SideSensor {
  label: string[];
  z: number;
  half: number;
  decentre: number;
  handles: Handle[];
}

/** The plane of the views: its position and the borders of the views' cells. */
export interface SideAperture {
  label: string[];
  z: number;
  decentre: number;
  borders: number[];
  snaps: Snap[];
}

/** A fan of rays from a point. */
export interface Rays {
  /** Why it is drawn. */
  role: "focused" | "near" | "far" | "off axis" | "given";
  /** Of the point; None for infinity. */
  distance: number | null;
  /** As text. */
  words: string;
  /** Points [z, height, remaining light] of each ray; one that is stopped ends before the sensor. */
  paths: [number, number, number][][];
  /** [z, height] of the image of the point, if it is near the sensor. */
  meet: [number, number] | null;
}

/** The side view of a camera; `start`, `end` and `half` are the range to draw. */
export interface Side {
  /** The direction across the axis that points upwards: x, which is to the right in the scene, or y. */
  axis: "x" | "y";
  start: number;
  end: number;
  half: number;
  elements: SideElement[];
  sensor: SideSensor;
  aperture: SideAperture | null;
  rays: Rays[];
  snaps: Snap[];
  words: string[];
}

/** How the image is shown. */
export interface Look {
  /** The irradiance shown as black, as a share of white. */
  black: number;
  /** Whether codes are proportional to irradiance; otherwise sRGB. */
  linear: boolean;
  /** The only channel shown, from 0; None for all. */
  channel: number | null;
  /** "sum", or "apart" for the images of photodiodes side by side. */
  photodiodes: "sum" | "apart";
  /** The direction that points upwards in the side view. */
  axis: "x" | "y";
}

/** Counts of pixels by irradiance, between 0 and `most`. */
export interface Histogram {
  /** The upper end. */
  most: number;
  /** Of each channel. */
  counts: number[][];
  /** Share of the channel values at or below black. */
  below: number;
  /** Share above white. */
  above: number;
}

/** A warning, and the element that it names. */
export interface Note {
  element: number | null;
  words: string;
}

/** A kept state. Its thumbnail is a buffer. */
export interface Pin {
  /** Its name, counted from 1. */
  number: number;
  /** The difference from the previous pin, or the camera. */
  words: string;
  /** Of its image against the reference, dB; None if equal, or if it cannot be compared. */
  psnr: number | null;
  /** Whether its image equals the reference. */
  same: boolean;
  /** Whether it is the reference. */
  compared: boolean;
}

/** Values along a line across the image. */
export interface Curve {
  /** Distance from the start on the sensor, metres. */
  places: number[];
  /** Irradiance of each channel at these. */
  values: number[][];
}

/** A plane of phase space: range of positions and slopes. */
export interface Plane {
  title: string;
  z: number;
  place: [number, number];
  slope: [number, number];
  shape: [number, number];
}

/** Ranges of position and slope. */
export interface Extent {
  place: [number, number];
  slope: [number, number];
}

/** The key that restores a session after a lost connection. */
export interface KeyMessage {
  key: string;
}

/** What the bench offers, once. */
export interface PartsMessage {
  light_fields: string[];
  kinds: Kind[];
  families: { [name: string]: Kind[] };
  sensor: Parameter[];
  gallery: string[];
  presets: Preset[];
}

/** The document is absent while something moves: the front end has changed its own copy already. */
export interface StateMessage {
  turn: number;
  document: BenchDocument | null;
  undo: boolean;
  redo: boolean;
  grid: number[] | null;
  bands: number[] | null;
  side: Side;
}

/** An image; its buffer is a JPEG, upright. */
export interface PictureMessage {
  /** Number of the message that requested it. */
  turn: number;
  /** Whether it has fewer pixels or rays than the sensor's image, or is less accurate. */
  coarse: boolean;
  /** Whether it was made during a drag. */
  moving: boolean;
  /** Rows and columns of the JPEG. */
  shape: [number, number];
  /** Irradiance shown as white. */
  white: number;
  /** How it is shown. */
  look: Look;
  /** Of the image; 0 for a grey one. */
  channels: number;
  /** Rows and columns in a pixel. */
  photodiodes: [number, number];
  /** Share of the rays that the light field lacks. */
  missing: number;
  /** Milliseconds. */
  took: number;
  /** Against the reference pin, dB. */
  psnr: number | null;
  /** Whether it equals that. */
  same: boolean;
  /** Of a whole image. */
  histogram: Histogram | null;
}

/** The values of a pixel, and its position on the sensor: right and down as displayed, metres. */
export interface ValueMessage {
  x: number;
  y: number;
  place: [number, number];
  irradiance: number[];
  recorded: number[] | null;
}

/** Warnings about the image of a turn. */
export interface NotesMessage {
  turn: number;
  notes: Note[];
}

/** Why there is no image. */
export interface NoPictureMessage {
  turn: number;
  words: string;
}

/** A bug in the program. */
export interface FailedMessage {
  words: string;
}

/** All pins; the buffers are the thumbnails, then the image of the reference. */
export interface PinsMessage {
  pins: Pin[];
  /** Of the image that is shown against the reference, dB. */
  psnr: number | null;
  /** Whether it equals that. */
  same: boolean;
}

/** A file to save; its buffer has the bytes. */
export interface FileMessage {
  name: string;
  type: string;
}

/** A request that was refused, or a remark on one that was done in another way than asked. */
export interface RefusedMessage {
  /** What is wrong and what to do. */
  words: string;
  /** The parameter. */
  where: Value;
  /** Of the message. */
  do: string;
  /** Of the message. */
  turn: number;
  /** Whether it was done all the same. */
  done?: boolean;
}

/** The progress of long work. */
export interface ProgressMessage {
  done: number;
  total: number;
  words: string;
}

/** The text of `explain`. */
export interface ExplainAnswer {
  words: string;
}

/** The image of a point, its JPEG as a buffer. */
export interface PointAnswer {
  words: string;
  shape: [number, number];
  distance: number | null;
  outside: number;
  remark: string | null;
}

/** Contrast by frequency: [cycles per millimetre, contrast]. */
export interface MtfAnswer {
  unit: string;
  across: [number, number][];
  down: [number, number][];
  pixels: number;
  distance: number | null;
  remark: string | null;
}

/** Planes of phase space, their JPEGs as buffers; `frame` is the range of all planes if one was requested. */
export interface PhaseSpaceAnswer {
  planes: Plane[];
  frame: Extent | null;
  remark: string | null;
}

/** The image along a line: (x, y) of its ends in pixels. */
export interface ProfileAnswer {
  places: number[];
  values: number[][];
  ends: [number, number, number, number];
}

/** The frames of a sweep as JPEGs, with the value of each. */
export interface ScrubAnswer {
  label: string;
  values: string[];
  took: number;
}

/** Decoded views, or only `why` there are none; None stands for an infinite distance. */
export interface DecodedAnswer {
  why?: string;
  words?: string;
  remarks?: string[];
  views?: [number, number];
  shape?: [number, number];
  nearest?: number | null;
  farthest?: number | null;
  focus?: number | null;
  distance?: number | null;
}

/** A refocused image, its JPEG as a buffer. */
export interface RefocusedAnswer {
  distance: number | null;
}

export type Answer =
  | { is: "answer"; what: "explain" } & ExplainAnswer
  | { is: "answer"; what: "point spread" } & PointAnswer
  | { is: "answer"; what: "mtf" } & MtfAnswer
  | { is: "answer"; what: "phase space" } & PhaseSpaceAnswer
  | { is: "answer"; what: "profile" } & ProfileAnswer
  | { is: "answer"; what: "scrub" } & ScrubAnswer
  | { is: "answer"; what: "decoded" } & DecodedAnswer
  | { is: "answer"; what: "refocused" } & RefocusedAnswer;

export type FromHost =
  | ({ is: "key" } & KeyMessage)
  | ({ is: "parts" } & PartsMessage)
  | ({ is: "state" } & StateMessage)
  | ({ is: "picture" } & PictureMessage)
  | ({ is: "value" } & ValueMessage)
  | ({ is: "notes" } & NotesMessage)
  | ({ is: "no picture" } & NoPictureMessage)
  | ({ is: "failed" } & FailedMessage)
  | ({ is: "pins" } & PinsMessage)
  | ({ is: "file" } & FileMessage)
  | ({ is: "refused" } & RefusedMessage)
  | ({ is: "progress" } & ProgressMessage)
  | Answer;

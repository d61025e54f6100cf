/** What goes between the front end and its host; the Python side is vcc.bench.session. */

/** A length in words ("41.5 mm"), a number, a list or a table: what a camera file holds. */
export type Value = null | boolean | number | string | Value[] | { [name: string]: Value };
export type Table = { [name: string]: Value };
/** A path in the document, without "camera": ["elements", 0, "z"]. */
export type Where = (string | number)[];

export interface Camera {
  elements?: Table[];
  sensor: Table;
}

export interface BenchDocument {
  camera: Camera;
  light_field: string;
  views: null | { rows: [number, number]; columns: [number, number] };
  /** Where the plane of its views stands. */
  aperture: { z: string; decentre: Value };
  exposure: null | number;
  noise: boolean;
}

/** What may be written for a parameter. */
export type Takes = "number" | "whole number" | "text" | "truth" | "list" | "array" | "name" | "table";

export interface Parameter {
  name: string;
  words: string;
  unit: "length" | "angle" | "time" | null;
  needed: boolean;
  /** As a camera file has it. */
  default: Value;
  takes: Takes[];
  choices: string[];
  /** Of a pattern, kernel or surface: which of `families` it is one of. */
  family?: string;
  /** Of a table. */
  parameters?: Parameter[];
}

export interface Kind {
  kind: string;
  words: string;
  parameters: Parameter[];
}

export interface Parts {
  light_fields: string[];
  kinds: Kind[];
  families: { [family: string]: Kind[] };
  sensor: Parameter[];
  gallery: string[];
}

export interface Snap {
  z: number;
  words: string;
}

/** An element from the side; metres, heights from the axis, upwards as drawn. */
export interface SideElement {
  label: string[];
  z: number;
  length: number;
  decentre: number;
  drawn: "lens" | "block" | "prism" | "glass" | "frosted" | "mask" | "sheet";
  converging?: boolean;
  /** Of a prism: the side on which it is thick. */
  towards?: number;
  /** Of a block: half the height of the light in it, where no rim is known. */
  beam?: number;
  half: number | null;
  /** [z, low, high] of each rim. */
  openings?: [number, number, number][];
  /** [height, depth from 0 to 1] of glass, towards the scene. */
  profile?: [number, number][];
  /** [low, high, share of light that passes]. */
  shades?: [number, number, number][];
  /** [height, strength from 0 to 1]. */
  roughness?: [number, number][];
  /** Where it would have to stand for what matters in the scene to be sharp on the sensor. */
  snaps?: Snap[];
}

export interface SideSensor {
  label: string[];
  z: number;
  half: number;
  decentre: number;
}

/** The plane of the light field's views: where it stands, and the borders of the views' cells. */
export interface SideAperture {
  label: string[];
  z: number;
  decentre: number;
  borders: number[];
  snaps: Snap[];
}

export interface Rays {
  colour: string;
  distance: number | null;
  words: string;
  /** Points [z, height, what is left of the ray on the way there]; one that is stopped ends before the sensor. */
  paths: [number, number, number][][];
}

export interface Side {
  from: number;
  to: number;
  half: number;
  elements: SideElement[];
  sensor: SideSensor;
  /** Null until the light field has been opened. */
  aperture: SideAperture | null;
  rays: Rays[];
  /** Where the sensor would have to stand for what matters in the scene to be sharp. */
  snaps: Snap[];
  words: string[];
}

export interface Note {
  element: number | null;
  words: string;
}

export interface PartsMessage extends Parts {
  is: "parts";
}

export interface StateMessage {
  is: "state";
  turn: number;
  document: BenchDocument;
  undo: boolean;
  redo: boolean;
  /** (rows, columns, …) of the light field's views, when it has been opened. */
  grid: number[] | null;
  side: Side;
}

export interface PictureMessage {
  is: "picture";
  turn: number;
  coarse: boolean;
  /** Whether it was made while something moves. */
  moving: boolean;
  shape: [number, number];
  white: number;
  missing: number;
  took: number;
  psnr: number | null;
  /** Whether it is the pinned picture, to the bit. */
  same?: boolean;
}

export interface ValueMessage {
  is: "value";
  x: number;
  y: number;
  irradiance: number[];
  recorded: number[] | null;
}

/** [frequency in cycles per millimetre, contrast]. */
export type Curve = [number, number][];

/** A plane of phase space: places across it and slopes there, both from the least to the greatest. */
export interface Plane {
  title: string;
  z: number;
  place: [number, number];
  slope: [number, number];
  shape: [number, number];
}

export type AnswerMessage =
  | { is: "answer"; what: "explain"; words: string }
  | { is: "answer"; what: "point spread"; words: string; shape: [number, number]; distance: number | null }
  | { is: "answer"; what: "mtf"; across: Curve; down: Curve; distance: number | null }
  | { is: "answer"; what: "phase space"; planes: Plane[]; frame: { place: [number, number]; slope: [number, number] } | null };

/** The decoded views of a camera, or why there are none; metres, null for infinitely far. */
export type DecodedMessage = { is: "answer"; what: "decoded" } & (
  | { why: string }
  | {
      why?: undefined;
      words: string;
      remarks: string[];
      views: [number, number];
      shape: [number, number];
      nearest: number | null;
      farthest: number | null;
      focus: number | null;
      distance: number | null;
    }
);

export interface RefocusedMessage {
  is: "answer";
  what: "refocused";
  distance: number | null;
}

export type FromHost =
  | { is: "key"; key: string }
  | PartsMessage
  | StateMessage
  | PictureMessage
  | ValueMessage
  | AnswerMessage
  | DecodedMessage
  | RefocusedMessage
  | { is: "notes"; turn: number; notes: Note[] }
  | { is: "no picture"; turn: number; words: string }
  | { is: "failed"; words: string }
  | { is: "pinned" }
  | { is: "file"; name: string; type: string }
  | { is: "refused"; words: string; where?: Where | null; do?: string; turn?: number }
  | { is: "progress"; done: number; total: number; words: string };

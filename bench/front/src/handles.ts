/** Handles of what is selected: points of the drawing that change a parameter when they are dragged. */

import { nothing, svg } from "lit";

import type { Bench, Selected } from "./bench";
import type { Mapping } from "./frame";
import { inMillimetres, plain, short } from "./numbers";
import type { Handle, Snap, Value, Where } from "./protocol";

/** Lengths that are dragged stay at or above this, metres. */
const LEAST = 1e-5;
const RADIUS = 5;

/** What is dragged: a handle, or a part by its place on the axis. */
export interface Held {
  which: Selected;
  handle: Handle;
  where: Where;
  value: number;
  /** What the document had when it began. */
  from: Value;
  /** Of the pointer when it began, pixels; along the axis from the part. */
  x: number;
  y: number;
  grip: number;
  moved: boolean;
  /** Places to which a part is pulled, as they were when it began, and the one that is near. */
  snaps: Snap[];
  snap: Snap | null;
}

const PLACE = "place";

/** A part's place on the axis, as handles have their parameters. */
export function placeHandle(value: number): Handle {
  return { where: ["z"], words: PLACE, value, z: 0, height: 0, rate: 1, along: "z", unit: "length", pair: null, other: null };
}

export function isPlace({ handle }: Held): boolean {
  return handle.words === PLACE;
}

/** Of the selected part; those of the light field's plane are its place alone. */
export function handlesOf(bench: Bench): Handle[] {
  const { selected } = bench;
  if (selected === "light field") return [];
  return (selected === "sensor" ? bench.side?.sensor.handles : bench.side?.elements[selected]?.handles) ?? [];
}

/** Of a handle; one that lies outside of the drawing stands at its border. */
export function placeOf(bench: Bench, handle: Handle, scale: Mapping): { x: number; y: number } {
  const x = scale.x(bench.placeOf(bench.selected) + handle.z);
  return { x: handle.z ? Math.min(Math.max(x, scale.left), scale.right) : x, y: Math.min(Math.max(scale.y(handle.height), scale.top - 2), scale.bottom + 2) };
}

/** The parameter's value as a document has it, after the pointer has moved. */
export function valueAt(held: Held, x: number, y: number, scale: Mapping): { value: number; words: Value } {
  const { handle } = held;
  const moved = handle.along === "z" ? scale.z(x) - scale.z(held.x) : scale.height(y) - scale.height(held.y);
  return asValue(handle, held.handle.value + handle.rate * moved);
}

/** A number of a handle, kept where it makes sense and rounded as a hand can place it. */
export function asValue(handle: Handle, wanted: number): { value: number; words: Value } {
  if (handle.words === PLACE) return { value: wanted, words: inMillimetres(wanted) };
  const sized = handle.words !== "decentre" && handle.unit !== "angle";
  const sign = handle.value < 0 ? -1 : 1;
  let value = sized && sign * wanted < LEAST ? sign * LEAST : wanted;
  value = Number(value.toPrecision(4));
  if (!sized && Math.abs(value) < 1e-6) value = 0;
  const one = handle.unit === "angle" ? `${Number(((value * 180) / Math.PI).toPrecision(4))} deg` : inMillimetres(value);
  if (handle.pair === null || handle.other === null) return { value, words: one };
  const words: Value[] = [inMillimetres(handle.other), inMillimetres(handle.other)];
  words[handle.pair] = one;
  return { value, words };
}

export function inWords(handle: Handle): string {
  if (handle.unit === "slope") return `${handle.words} ±${plain(handle.value / 2, 3)}, ${plain((Math.atan(handle.value / 2) * 180) / Math.PI, 3)}°`;
  const value = handle.unit === "angle" ? `${Number(((handle.value * 180) / Math.PI).toPrecision(4))}°` : short(handle.value, 4);
  return `${handle.words} ${value}`;
}

/** The cone of the directions within a slope, from its handle to the part and to the other side. */
export function drawnCone(bench: Bench, handle: Handle, scale: Mapping) {
  if (handle.unit !== "slope") return nothing;
  const [z, middle] = [bench.placeOf(bench.selected), bench.partOf(bench.selected)!.decentre];
  const [x, y] = [scale.x(z + handle.z), scale.y(handle.height)];
  return svg`<path class="cone" d="M${x} ${y}L${scale.x(z)} ${scale.y(middle)}L${x} ${scale.y(2 * middle - handle.height)}"></path>`;
}

const SIGNS: { [words: string]: string } = { "focal length": "F", rotation: "↻" };

export function drawnHandle(handle: Handle, x: number, y: number, active: boolean) {
  const letter = SIGNS[handle.words];
  const shape = handle.words === "decentre"
    ? svg`<path d="M${x} ${y - RADIUS - 1}l${RADIUS + 1} ${RADIUS + 1}l${-RADIUS - 1} ${RADIUS + 1}l${-RADIUS - 1} ${-RADIUS - 1}z"></path>`
    : svg`<circle cx=${x} cy=${y} r=${letter ? RADIUS + 2 : RADIUS}></circle>`;
  const [above, left] = [y > 110, x > 200];
  return svg`${shape}${letter ? svg`<text class="sign" x=${x} y=${y + 3.5} text-anchor="middle">${letter}</text>` : ""}
    <text class="says ${active ? "active" : ""}" x=${x + (left ? -11 : 11)} y=${y + (above ? -9 : 17)} text-anchor=${left ? "end" : "start"}>${inWords(handle)}</text>`;
}

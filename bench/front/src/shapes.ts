/** Elements as they look from the side, in the drawing's pixels. */

import { svg, nothing } from "lit";

import type { SideElement, SideAperture, SideSensor } from "./protocol";

/** From metres to pixels. */
export interface Scale {
  x(z: number): number;
  y(height: number): number;
  top: number;
  bottom: number;
  /** Half the thickness of a lens, pixels: what is thin has none, and is drawn with a symbol. */
  thick: number;
}

export function drawn(element: SideElement, z: number, scale: Scale) {
  const x = scale.x(z);
  const opening = element.openings?.[0];
  const half = element.half ?? (element.beam ? 1.08 * element.beam : Infinity);
  const [bottom, top] = opening && element.length === 0 ? [opening[1], opening[2]] : [element.decentre - half, element.decentre + half];
  const low = Math.min(scale.y(bottom), scale.bottom);
  const high = Math.max(scale.y(top), scale.top);
  const bounded = element.half !== null;
  const shape = { lens, block, prism, glass, frosted, mask, sheet }[element.drawn] ?? sheet;
  return svg`
    ${shape(element, x, low, high, scale, bounded)}
    ${(element.openings ?? []).map((rim) => drawnRim(x + scale.x(rim[0]) - scale.x(element.z), rim, element, scale))}`;
}

function lens(element: SideElement, x: number, low: number, high: number, { thick }: Scale, bounded: boolean) {
  const [edge, middle] = element.converging === false ? [thick, 0.25 * thick] : [0.12 * thick, thick];
  // A quadratic curve passes half way between its ends and its control point.
  const control = 2 * middle - edge;
  const centre = (low + high) / 2;
  return svg`<path class="glass ${bounded ? "" : "open"}" d="M${x - edge} ${low} Q${x - control} ${centre} ${x - edge} ${high}
    H${x + edge} Q${x + control} ${centre} ${x + edge} ${low} Z"></path>`;
}

/** A wedge, thick on the side to which it deflects. */
function prism(element: SideElement, x: number, low: number, high: number, { thick }: Scale) {
  const towards = element.towards ?? 0;
  const tip = towards === 0 ? thick : 0.05 * thick;
  const [top, bottom] = towards >= 0 ? [thick, tip] : [tip, thick];
  return svg`<path class="glass open" d="M${x - top} ${high}H${x + top}L${x + bottom} ${low}H${x - bottom}Z"></path>`;
}

function block(element: SideElement, x: number, low: number, high: number, scale: Scale, bounded: boolean) {
  const end = Math.max(scale.x(element.z + element.length) - scale.x(element.z), scale.thick);
  return svg`<rect class="glass block ${bounded ? "" : "open"}" x=${x} y=${high} width=${end} height=${low - high}></rect>`;
}

/** Glass that is flat at the element's place; towards the scene it has the profile that bends rays as it does. */
function glass(element: SideElement, x: number, low: number, high: number, scale: Scale, bounded: boolean) {
  const inside = (element.profile ?? []).map(([height, depth]): [number, number] => [scale.y(height), depth]);
  const points = inside.map(([y, depth]) => `${(x - scale.thick * (0.4 + 1.1 * depth)).toFixed(2)} ${y.toFixed(2)}`);
  const first = inside[0]?.[0] ?? low;
  const last = inside[inside.length - 1]?.[0] ?? high;
  return svg`<path class="glass ${bounded ? "" : "open"}" d="M${x} ${first} L${points.join("L")} L${x} ${last} Z"></path>
    ${shades(element, x - 0.4 * scale.thick, x, scale, true)}`;
}

/** A sheet with a rough side towards the sensor; where it scatters more it is rougher. */
function frosted(element: SideElement, x: number, low: number, high: number, scale: Scale, bounded: boolean) {
  const wide = 0.5 * scale.thick;
  const strengths = (element.roughness ?? []).map(([height, strength]): [number, number] => [scale.y(height), strength]);
  const strengthAt = (y: number) =>
    strengths.reduce((best, each) => (Math.abs(each[0] - y) < Math.abs(best[0] - y) ? each : best), strengths[0] ?? [0, 1])[1];
  const teeth: string[] = [];
  let seed = 7;
  for (let y = high; y < low; y += 3) {
    seed = (seed * 16807) % 2147483647; // uneven as ground glass is, and the same in every drawing
    const out = scale.thick * (0.1 + 0.9 * strengthAt(y)) * (0.4 + (0.6 * seed) / 2147483647);
    teeth.push(`${x} ${y.toFixed(1)}L${(x + out).toFixed(2)} ${Math.min(y + 1.5, low).toFixed(1)}`);
  }
  return svg`<path class="frost ${bounded ? "" : "open"}" d="M${x - wide} ${high}L${teeth.join("L")}L${x} ${low}H${x - wide}Z"></path>
    ${shades(element, x - wide, x, scale, true)}`;
}

/** The pattern's middle line as a bar: dark where it is opaque, nothing where it is open. */
function mask(element: SideElement, x: number, low: number, high: number, scale: Scale, bounded: boolean) {
  const wide = Math.max(0.35 * scale.thick, 2);
  return svg`${shades(element, x - wide, x + wide, scale, false)}
    ${bounded ? svg`<rect class="outline" x=${x - wide} y=${high} width=${2 * wide} height=${Math.max(low - high, 0)}></rect>` : nothing}`;
}

function shades(element: SideElement, from: number, to: number, scale: Scale, over: boolean) {
  return (element.shades ?? []).map(([low, high, share]) => {
    const top = Math.max(scale.y(high), scale.top);
    const bottom = Math.min(scale.y(low), scale.bottom);
    if (bottom <= top || (over && share === 1)) return nothing;
    return svg`<rect class="dark" x=${from} y=${top} width=${to - from} height=${bottom - top} fill-opacity=${1 - share}></rect>`;
  });
}

function sheet(_: SideElement, x: number, low: number, high: number) {
  return svg`<path class="sheet" d="M${x} ${high}V${low}"></path>`;
}

/** The opaque surroundings of an opening: heavy at its edge, thin further out; of a block no further than its glass. */
function drawnRim(x: number, [, bottom, top]: [number, number, number], element: SideElement, scale: Scale) {
  const [low, high] = [Math.min(scale.y(bottom), scale.bottom), Math.max(scale.y(top), scale.top)];
  const heavy = 0.05 * (scale.bottom - scale.top);
  const reach = element.drawn === "block" && element.half !== null ? 1.08 * Math.max(element.half, element.beam ?? 0) : Infinity;
  const outmost = Math.max(scale.y(element.decentre + reach), scale.top);
  const lowest = Math.min(scale.y(element.decentre - reach), scale.bottom);
  return svg`
    <path class="rim heavy" d="M${x} ${high}V${Math.max(high - heavy, outmost)}M${x} ${low}V${Math.min(low + heavy, lowest)}"></path>
    <path class="rim" d="M${x} ${high}V${outmost}M${x} ${low}V${lowest}"></path>`;
}

/** Views side by side: a line with a tick between each two, if these are not too close. */
export function drawnAperture(aperture: SideAperture, x: number, scale: Scale) {
  const places = aperture.borders.map((border) => Math.min(Math.max(scale.y(border), scale.top), scale.bottom));
  const [low, high] = [Math.max(...places), Math.min(...places)];
  const ticked = low - high > 3 * places.length ? places : [low, high];
  return svg`<path class="borders" d="M${x} ${high}V${low}${ticked.map((y) => `M${x - 4} ${y}h8`).join("")}"></path>`;
}

export function drawnSensor(sensor: SideSensor, z: number, scale: Scale) {
  const x = scale.x(z);
  const high = Math.max(scale.y(sensor.decentre + sensor.half), scale.top);
  const low = Math.min(scale.y(sensor.decentre - sensor.half), scale.bottom);
  return svg`<rect class="sensor" x=${x} y=${high} width=${1.1 * scale.thick} height=${Math.max(low - high, 1)} rx="1"></rect>`;
}

/** Names above a drawing of the bench, and distances below it. */

import { svg, nothing } from "lit";

import type { Bench, Selected } from "./bench";
import { MARGIN } from "./frame";
import { short } from "./numbers";
import type { Scale } from "./shapes";

/** Parts that are closer than this, pixels, have one label. */
const TOGETHER = 5;
/** A label of several parts is cut if it is wider. */
const WIDEST = 190;
const LINES = 3;

const pencil = document.createElement("canvas").getContext("2d")!;

/** Of words in the drawing's type, pixels. */
function wide(words: string, bold = false): number {
  pencil.font = `${bold ? 600 : 400} 11.5px system-ui, -apple-system, "Segoe UI", Roboto, "Noto Sans", sans-serif`;
  return pencil.measureText(words).width;
}

interface Label {
  x: number;
  parts: { which: Selected; words: string; chosen: boolean }[];
  notes: number;
  noted: Selected;
}

/** One label for parts in one plane; names in lines where they would meet; what is selected says its place. */
export function drawnLabels(bench: Bench, parts: Selected[], scale: Scale, width: number, badge: (which: Selected, x: number, y: number, count: number) => unknown) {
  const labels: Label[] = [];
  const lengthOf = (which: Selected) => (typeof which === "number" ? (bench.side?.elements[which]?.length ?? 0) : 0);
  const placed = parts.map((which) => ({ which, x: scale.x(bench.placeOf(which) + lengthOf(which) / 2) })).sort((one, other) => one.x - other.x);
  for (const { which, x } of placed) {
    if (x < -40 || x > width + 40) continue;
    const chosen = bench.selected === which;
    const name = bench.partOf(which)?.label[0] ?? "";
    const part = { which, words: chosen ? `${name} · ${short(bench.placeOf(which), 6)}` : name, chosen };
    const notes = bench.notesOf(which).length;
    const last = labels.at(-1);
    if (last && x - last.x < TOGETHER) {
      last.parts.push(part);
      if (notes && !last.notes) last.noted = which;
      last.notes += notes;
    } else labels.push({ x, parts: [part], notes, noted: which });
  }
  const ends = Array.from({ length: LINES }, () => -Infinity);
  return labels.map(({ x: wanted, parts: all, notes, noted }) => {
    let words = all;
    const size = () => words.reduce((sum, each) => sum + wide(each.words, each.chosen), 0) + wide(" + ") * (words.length - 1);
    if (all.length > 1 && size() > WIDEST) {
      const first = all.find((each) => each.chosen) ?? all[0]!;
      words = [first, { which: first.which, words: `${all.length - 1} more`, chosen: false }];
    }
    const half = size() / 2 + 5;
    const spare = notes ? 14 : 0;
    const x = Math.min(Math.max(wanted, half), width - half - spare);
    let line = ends.findIndex((end) => end < x - half);
    if (line < 0) line = ends.indexOf(Math.min(...ends));
    ends[line] = x + half + spare;
    const y = MARGIN.top - 10 - 13 * line;
    const title = all.map((each) => each.words).join(", ");
    return svg`<g class="label" aria-hidden="true">
      <text x=${x} y=${y} text-anchor="middle">${words.map((each, number) => svg`${number ? " + " : ""}<tspan class=${each.chosen ? "chosen" : ""}>${each.words}</tspan>`)}${all.length > 1 ? svg`<title>${title}</title>` : nothing}</text>
      ${notes ? badge(noted, x + half + 4, y - 4, notes) : nothing}
    </g>`;
  });
}

/** From one part to the next, below. */
export function drawnDistances(places: number[], scale: Scale, height: number, scene: boolean) {
  const sorted = [...new Set(places)].sort((one, other) => one - other);
  const y = height - 24;
  const pieces = sorted.slice(1).map((z, number) => {
    const [from, to] = [scale.x(sorted[number]!), scale.x(z)];
    const words = short(z - sorted[number]!, 5);
    const width = wide(words) + 10;
    return svg`<path d="M${from} ${y}H${to}"></path>
      ${to - from > width + 4 ? svg`<rect x=${(from + to - width) / 2} y=${y - 7} width=${width} height="14"></rect>
      <text x=${(from + to) / 2} y=${y + 4} text-anchor="middle">${words}</text>` : nothing}`;
  });
  const ticks = sorted.map((z) => `M${scale.x(z)} ${y - 4}v8`).join("");
  return svg`<g class="distances" aria-hidden="true">${pieces}<path d=${ticks}></path>
    ${scene ? svg`<text class="scene" x="8" y=${y + 4}>← scene</text>` : nothing}</g>`;
}

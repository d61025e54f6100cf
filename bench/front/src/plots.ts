/** Curves over an axis, as small drawings: contrast over frequency, irradiance along a line. */

import { html, svg, nothing } from "lit";

import { plain } from "./numbers";

export interface Curve {
  points: [number, number][];
  /** A class of the style sheet. */
  name: string;
}

export interface Axes {
  width: number;
  height: number;
  /** From 0 to these. */
  most: [number, number];
  words: string;
  label: string;
  /** Where lines go across; None for those that are round. */
  levels?: number[];
}

export const MARGIN = { left: 40, right: 12, top: 12, bottom: 38 };

/** Some round numbers between two. */
export function ticks(least: number, greatest: number, atMost = 5): number[] {
  if (!(greatest > least)) return [least];
  const power = 10 ** Math.floor(Math.log10(greatest - least));
  const step = [0.1, 0.2, 0.5, 1, 2].map((each) => each * power).find((each) => (greatest - least) / each <= atMost)!;
  const first = Math.ceil(least / step - 1e-9);
  return Array.from({ length: Math.floor(greatest / step + 1e-9) - first + 1 }, (_, number) => (first + number) * step);
}

export function plotted(curves: Curve[], { width, height, most, words, label, levels }: Axes) {
  const x = (value: number) => MARGIN.left + (value / (most[0] || 1)) * (width - MARGIN.left - MARGIN.right);
  const y = (value: number) => height - MARGIN.bottom - (value / (most[1] || 1)) * (height - MARGIN.top - MARGIN.bottom);
  return html`<svg viewBox="0 0 ${width} ${height}" class="curves" role="img" aria-label=${label}>
    ${(levels ?? ticks(0, most[1], 4)).map((each) => svg`<path class="grid" d="M${MARGIN.left} ${y(each)}H${width - MARGIN.right}"></path>
      <text x=${MARGIN.left - 6} y=${y(each) + 4} text-anchor="end">${plain(each, 3)}</text>`)}
    ${ticks(0, most[0]).map((each) => svg`<text x=${x(each)} y=${height - MARGIN.bottom + 16} text-anchor="middle">${plain(each, 3)}</text>`)}
    ${words ? svg`<text x=${(MARGIN.left + width - MARGIN.right) / 2} y=${height - 5} text-anchor="middle">${words}</text>` : nothing}
    ${curves.map(({ points, name }) => svg`<path class=${name} d="M${points.map(([at, value]) => `${x(at).toFixed(1)} ${y(value).toFixed(1)}`).join("L")}"></path>`)}</svg>`;
}

/** What a host answers beside the picture, drawn: words, a point's picture, contrast by frequency, phase space. */

import { html, svg, css, nothing } from "lit";

import type { Answered } from "./bench";
import { plain, short } from "./numbers";
import { MARGIN, plotted, ticks } from "./plots";
import type { Plane } from "./protocol";

/** What can be asked, and how its tab is called. */
export const QUESTIONS: [string, string][] = [
  ["explain", "Explain"],
  ["phase space", "Phase space"],
  ["point spread", "Point spread"],
  ["mtf", "MTF"],
];
/** Of these, what is answered at planes of the axis, and what for a point at some distance. */
export const OF_PLANES = "phase space";
export const OF_A_POINT = ["point spread", "mtf"];

const WIDE = 460;
const HIGH = 230;
type Curve = [number, number][];

export function drawnAnswer({ message, pictures }: Answered) {
  switch (message.what) {
    case "explain":
      return html`<pre>${message.words}</pre>`;
    case "point spread":
      return html`<p>${message.words}.</p><img class="point" src=${pictures[0] ?? ""} alt="Picture of a point ${away(message.distance)}, ${message.shape[1]} by ${message.shape[0]} pixels">`;
    case "mtf":
      return drawnCurves(message.across, message.down, away(message.distance));
    case "phase space":
      if (message.frame) return drawnInFrame(message.planes[0]!, message.frame, pictures[0] ?? "");
      return html`<div class="planes">${message.planes.map((plane, number) => drawnPlane(plane, pictures[number] ?? ""))}</div>
        <p class="quiet">Each plane: places across it from left to right, slopes of the rays there upwards.</p>`;
    default:
      return nothing;
  }
}

function away(distance: number | null): string {
  return distance === null ? "infinitely far away" : `${short(distance, 3)} away`;
}

function drawnPlane(plane: Plane, picture: string) {
  const words = plane.title;
  return html`<figure><img src=${picture} alt="Phase space: ${words}"><figcaption>${words}<br>
    <span class="quiet">${plain(plane.place[0] * 1e3, 3)} to ${plain(plane.place[1] * 1e3, 3)} mm · slopes ${plain(plane.slope[0], 2)} to ${plain(plane.slope[1], 2)}</span></figcaption></figure>`;
}

/** One plane in the frame that holds all planes of the camera: moving it along the axis shears what is seen. */
function drawnInFrame(plane: Plane, frame: { place: [number, number]; slope: [number, number] }, picture: string) {
  const high = 1.2 * HIGH;
  const [left, right, top, bottom] = [MARGIN.left + 14, WIDE - MARGIN.right, MARGIN.top, high - MARGIN.bottom];
  const x = (place: number) => left + ((place - frame.place[0]) / (frame.place[1] - frame.place[0])) * (right - left);
  const y = (slope: number) => bottom - ((slope - frame.slope[0]) / (frame.slope[1] - frame.slope[0])) * (bottom - top);
  const scale = frame.place[1] - frame.place[0] < 1e-3 ? { of: 1e6, unit: "µm" } : { of: 1e3, unit: "mm" };
  return html`<figure><svg viewBox="0 0 ${WIDE} ${high}" class="curves" role="img" aria-label="Phase space ${plane.title}">
    <rect class="ground" x=${left} y=${top} width=${right - left} height=${bottom - top}></rect>
    <image href=${picture} preserveAspectRatio="none" x=${x(plane.place[0])} y=${y(plane.slope[1])}
      width=${x(plane.place[1]) - x(plane.place[0])} height=${y(plane.slope[0]) - y(plane.slope[1])}></image>
    ${ticks(frame.place[0] * scale.of, frame.place[1] * scale.of, 6).map((each) => svg`<path class="grid" d="M${x(each / scale.of)} ${bottom}v4"></path>
      <text x=${x(each / scale.of)} y=${bottom + 16} text-anchor="middle">${plain(each, 3)}</text>`)}
    ${ticks(...frame.slope, 6).map((each) => svg`<path class="grid" d="M${left} ${y(each)}h-4"></path>
      <text x=${left - 6} y=${y(each) + 4} text-anchor="end">${plain(each, 3)}</text>`)}
    <text x=${(left + right) / 2} y=${high - 5} text-anchor="middle">place across the plane, ${scale.unit}</text>
    <text transform="translate(11 ${(top + bottom) / 2}) rotate(-90)" text-anchor="middle">slope</text></svg>
    <figcaption>${plane.title}</figcaption></figure>`;
}

/** Contrast over frequency; both curves end where the longer one does. */
function drawnCurves(across: Curve, down: Curve, words: string) {
  const most = Math.max(across[across.length - 1]?.[0] ?? 1, down[down.length - 1]?.[0] ?? 1);
  if (!(most > 0)) return html`<p>All light of a point ${words} falls into one pixel: its contrast is that of the pixel itself.</p>`;
  const axes = { width: WIDE, height: HIGH, most: [most, 1] as [number, number], levels: [0, 0.25, 0.5, 0.75, 1] };
  return html`${plotted([{ points: across, name: "across" }, { points: down, name: "down" }], {
      ...axes, words: `cycles per millimetre on the sensor, of a point ${words}`, label: `Contrast over frequency of a point ${words}`,
    })}
    <p class="key"><i class="across"></i>across <i class="down"></i>down${same(across, down) ? html`<span class="quiet"> (the same)</span>` : nothing}</p>`;
}

function same(one: Curve, other: Curve): boolean {
  return one.length === other.length && one.every(([, contrast], number) => Math.abs(contrast - other[number]![1]) < 0.01);
}

export const answerStyles = css`
  .point { width: min(100%, 320px); image-rendering: pixelated; background: #000; }
  .planes { display: grid; grid-template-columns: repeat(auto-fill, minmax(170px, 1fr)); gap: 12px; margin-bottom: 10px; }
  .planes img { width: 100%; aspect-ratio: 4 / 3; object-fit: fill; background: #000; display: block; }
  figure { margin: 0; }
  figcaption { margin-top: 4px; font-size: 12px; line-height: 1.35; }
  .curves { width: 100%; max-width: 620px; display: block; }
  .curves .ground { fill: #000; }
  .curves text { font-size: 11px; fill: var(--quiet); }
  .curves path { fill: none; stroke-width: 1.8; }
  .curves path.grid { stroke: var(--line); stroke-width: 1; }
  .curves .across { stroke: var(--focused); }
  .curves .down { stroke: var(--near); stroke-dasharray: 5 3; }
  .curves .grey { stroke: var(--ink); }
  .curves .red { stroke: var(--red); } .curves .green { stroke: var(--green); } .curves .blue { stroke: var(--blue); }
  .key i { display: inline-block; width: 16px; height: 2px; vertical-align: 3px; margin-right: 5px; }
  .key i.across { background: var(--focused); }
  .key i.down { background: var(--near); margin-left: 14px; }
`;

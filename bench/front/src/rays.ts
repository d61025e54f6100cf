/** Fans of rays, and where they meet. */

import { html, svg, nothing } from "lit";

import type { Rays } from "./protocol";
import type { Scale } from "./shapes";

/** What a fan of rays is called where there is little room: "in focus: 1.3 m", "off the axis". */
function brief({ role, words }: Rays): string {
  return role === "off axis" ? "off the axis" : words.replace(/ away$/, "");
}

const named = ({ role }: Rays) => role.replace(" ", "-");

export function drawnRays(rays: Rays, scale: Scale) {
  const lines = new Map<number, string[]>();
  const ends: [number, number][] = [];
  const beyond: string[] = [];
  const last = Math.max(...rays.paths.map((path) => path.at(-1)?.[0] ?? -Infinity));
  const { meet } = rays;
  const piece = (fromZ: number, fromY: number, z: number, y: number) =>
    `M${scale.x(fromZ).toFixed(1)} ${scale.y(fromY).toFixed(1)}L${scale.x(z).toFixed(1)} ${scale.y(y).toFixed(1)}`;
  for (const path of rays.paths) {
    for (let at = 1; at < path.length; at++) {
      const [[fromZ, fromY], [z, y, share]] = [path[at - 1]!, path[at]!];
      const tone = Math.ceil(share * 5) / 5;
      if (!lines.has(tone)) lines.set(tone, []);
      lines.get(tone)!.push(piece(fromZ, fromY, z, y));
    }
    const [z, y] = path.at(-1) ?? [last, 0];
    if (z < last - 1e-9) ends.push([scale.x(z), scale.y(y)]);
    else if (meet && meet[0] > last) beyond.push(piece(z, y, ...meet));
  }
  return svg`<g class="ray ${named(rays)}">
    ${[...lines].map(([tone, pieces]) => svg`<path d=${pieces.join("")} stroke-opacity=${0.25 + 0.6 * tone}></path>`)}
    ${beyond.length ? svg`<path class="beyond" d=${beyond.join("")}></path>` : nothing}
    ${ends.map(([x, y]) => svg`<circle cx=${x} cy=${y} r="2"></circle>`)}
    ${meet ? svg`<circle class="meet" cx=${scale.x(meet[0])} cy=${scale.y(meet[1])} r="3"></circle>` : nothing}
  </g>`;
}

/** Names of the fans; in a narrow drawing those of the axis only. */
export function legend(rays: Rays[], all: boolean) {
  return html`<ul class="legend">
    ${[...rays].reverse().filter((each) => all || each.role !== "off axis").map((each) => html`<li><i class="ray ${named(each)}"></i>${brief(each)}</li>`)}
  </ul>`;
}

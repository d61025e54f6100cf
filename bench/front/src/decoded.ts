/** The views that are decoded of a camera's picture, and pictures refocused of them; the Python side is vcc.bench.decoded. */

import { html, css, nothing } from "lit";

import { Part, controls } from "./part";
import { short } from "./numbers";
import type { BenchDocument, DecodedAnswer } from "./protocol";

/** Steps of the slider, even in 1/distance, as blur is. */
const STEPS = 60;

/** Whether a camera has what folds views into a picture; if they can be told apart, the host says. */
export function foldsViews(document: BenchDocument | null): boolean {
  return (document?.camera.elements ?? []).some((each) => {
    const pattern = each["pattern"];
    const carrier = typeof pattern === "object" && pattern !== null && !Array.isArray(pattern) && pattern["name"] === "cosine_sum";
    return each["kind"] === "lens_array" || carrier;
  });
}

export class DecodedView extends Part {
  static override properties = { ...Part.properties, chosen: { state: true } };
  /** What the user has chosen, 1/metre; null for what the camera is focused on. */
  declare chosen: number | null;

  constructor() {
    super();
    this.chosen = null;
  }

  /** As a length in words; undefined for what the camera is focused on. */
  get distance(): string | undefined {
    return this.chosen === null ? undefined : this.chosen > 0 ? `${1 / this.chosen} m` : "inf m";
  }

  private choose(vergence: number | null): void {
    this.chosen = vergence;
    this.bench.question("refocused", this.distance ? { distance: this.distance } : {});
  }

  override render() {
    const { bench } = this;
    if (!bench.decoded) return html`<p class="quiet">Decoding …</p>`;
    const { message, pictures } = bench.decoded;
    if (message.why !== undefined) return html`<p>This camera cannot be decoded: ${message.why}.</p>`;
    const [shown, distance] = bench.refocused ? [bench.refocused.pictures[0], bench.refocused.message.distance] : [pictures[2], message.distance ?? null];
    const [rows, columns] = message.views ?? [0, 0];
    const [down, across] = message.shape ?? [0, 0];
    const sharp = away(distance);
    return html`
      <div class="figures">
        <figure><img src=${shown ?? ""} alt="Picture refocused on what is ${sharp}"><figcaption>${this.slider(message)}</figcaption></figure>
        <figure><img src=${pictures[0] ?? ""} alt="Sheet of all ${rows} by ${columns} views"><figcaption>${message.words}, as they stand in the lens</figcaption></figure>
        <figure><img src=${pictures[1] ?? ""} alt="The middle view"><figcaption>The middle view, ${across} pixels wide and ${down} high</figcaption></figure>
      </div>
      ${(message.remarks ?? []).map((words) => html`<p class="advice">${words}</p>`)}`;
  }

  private slider({ nearest = null, farthest = null, focus: own = null }: DecodedAnswer) {
    const [near, end, focus] = [nearest, farthest, own].map(vergence) as [number, number, number];
    const at = this.chosen ?? focus;
    const words = away(at > 0 ? 1 / at : null);
    const step = near === end ? 0 : (Math.min(Math.max((near - at) / (near - end), 0), 1)) * STEPS;
    return html`<span class="ends"><label for="refocus">Refocused: ${words}</label>
        ${this.chosen === null ? nothing : html`<button @click=${() => this.choose(null)}>as the camera is</button>`}</span>
      <input id="refocus" type="range" min="0" max=${STEPS} step="any" .value=${String(step)} aria-valuetext=${words} ?disabled=${near === end}
        @keydown=${(event: KeyboardEvent) => {
          const by = { ArrowRight: 1, ArrowUp: 1, ArrowLeft: -1, ArrowDown: -1, PageUp: 10, PageDown: -10, Home: -STEPS, End: STEPS }[event.key];
          if (!by) return;
          event.preventDefault();
          this.choose(near + ((end - near) * Math.min(Math.max(Math.round(step + by), 0), STEPS)) / STEPS);
        }}
        @input=${(event: Event) => this.choose(near + ((end - near) * Number((event.target as HTMLInputElement).value)) / STEPS)}>
      <span class="ends quiet"><span>nearest: ${far(nearest)}</span><span>farthest: ${far(farthest)}</span></span>`;
  }

  static override styles = [
    controls,
    css`
      :host { display: block; }
      .figures { display: grid; grid-template-columns: repeat(auto-fit, minmax(min(230px, 100%), 1fr)); gap: 14px; align-items: start; }
      figure { margin: 0; min-width: 0; }
      figure img { width: 100%; display: block; background: #000; }
      figcaption { margin-top: 5px; font-size: 12px; line-height: 1.35; }
      input { width: 100%; margin: 3px 0 0; accent-color: var(--accent); }
      .ends { display: flex; justify-content: space-between; gap: 6px; }
      figcaption button { flex: none; height: auto; padding: 0 2px; font-size: 12px; text-decoration: underline; text-underline-offset: 2px; }
      p { margin: 0 0 8px; }
      .advice { margin-top: 10px; padding: 7px 10px; border-radius: 6px; background: var(--warn-ground); }
    `,
  ];
}

function vergence(distance: number | null): number {
  return distance === null ? 0 : 1 / distance;
}

function far(distance: number | null): string {
  return distance === null ? "infinitely far" : short(distance, 3);
}

function away(distance: number | null): string {
  return distance === null ? far(null) : `at ${far(distance)}`;
}

/** Levels of the picture: its histogram, black and white, linear or sRGB, channels, photodiodes. */

import { html, svg, css, nothing } from "lit";

import { plain } from "./numbers";
import { Part, controls } from "./part";
import type { Histogram } from "./protocol";

const WIDE = 220;
const HIGH = 64;
const COLOURS = ["var(--red)", "var(--green)", "var(--blue)"];
/** A step of black or white by keys, as a share of white. */
const STEP = 0.02;

export class LevelsView extends Part {
  private dragged: "black" | "white" | null = null;
  /** The end of the histogram while a level is dragged: it changes with white. */
  private most = 0;

  private get white(): number {
    return this.bench.document?.exposure ?? this.bench.picture?.about.white ?? 1;
  }

  private get black(): number {
    return this.bench.look.black * this.white;
  }

  private put(which: "black" | "white", level: number, moving: boolean): void {
    const { bench, white, black } = this;
    if (which === "black") bench.show({ black: Math.min(Math.max(level / white, 0), 0.98) });
    else {
      const next = Math.max(level, black * 1.02, 1e-9);
      // Black keeps its irradiance.
      bench.set(["exposure"], next, moving);
      if (black > 0) bench.show({ black: Math.min(black / next, 0.98) });
    }
  }

  private down(event: PointerEvent, which: "black" | "white"): void {
    this.dragged = which;
    this.most = this.bench.picture?.about.histogram?.most ?? 1;
    (event.currentTarget as Element).setPointerCapture(event.pointerId);
    event.preventDefault();
  }

  private move(event: PointerEvent): void {
    if (this.dragged) this.put(this.dragged, this.levelAt(event), true);
  }

  private up(event: PointerEvent): void {
    if (!this.dragged) return;
    this.put(this.dragged, this.levelAt(event), false);
    this.dragged = null;
  }

  private levelAt(event: PointerEvent): number {
    const box = this.renderRoot.querySelector("svg")!.getBoundingClientRect();
    return Math.max(((event.clientX - box.left) / box.width) * this.most, 0);
  }

  private key(event: KeyboardEvent, which: "black" | "white"): void {
    const by = { ArrowRight: 1, ArrowUp: 1, ArrowLeft: -1, ArrowDown: -1 }[event.key];
    if (!by) return;
    event.preventDefault();
    event.stopPropagation();
    this.put(which, this[which] + by * STEP * this.white * (event.shiftKey ? 5 : 1), false);
  }

  override render() {
    const { bench } = this;
    const about = bench.picture?.about;
    if (!about) return nothing;
    const histogram = about.histogram;
    const channels = about.channels;
    const several = about.photodiodes[0] * about.photodiodes[1] > 1;
    return html`
      ${histogram ? this.drawHistogram(histogram) : html`<div class="none quiet">…</div>`}
      <p class="clipped">${histogram ? html`<span class=${histogram.above > 0.01 ? "warn" : ""}>${share(histogram.above)} above white</span>${bench.look.black > 0 ? html` · ${share(histogram.below)} at black or below` : nothing}` : nothing}</p>
      <div class="rows">
        <label>black <input type="text" inputmode="decimal" .value=${plain(this.black, 3)} @change=${(event: Event) => this.typed("black", event)}></label>
        <label>white <input type="text" inputmode="decimal" .value=${plain(this.white, 3)} @change=${(event: Event) => this.typed("white", event)}></label>
        <button @click=${() => { bench.show({ black: 0 }); bench.set(["exposure"], null); }}>Auto</button>
        <label class="check" title="Codes are proportional to irradiance; otherwise they are sRGB"><input type="checkbox" .checked=${bench.look.linear} @change=${(event: Event) => bench.show({ linear: (event.target as HTMLInputElement).checked })}>linear</label>
        ${channels > 1 ? html`<select aria-label="Channel" @change=${(event: Event) => { const value = (event.target as HTMLSelectElement).value; bench.show({ channel: value === "" ? null : Number(value) }); }}>
          <option value="" ?selected=${bench.look.channel === null}>all channels</option>
          ${Array.from({ length: channels }, (_, number) => html`<option value=${number} ?selected=${bench.look.channel === number}>${this.nameOf(number, channels)}</option>`)}</select>` : nothing}
        ${several ? html`<label class="check" title="The image of each photodiode in a pixel"><input type="checkbox" .checked=${bench.look.photodiodes === "apart"} @change=${(event: Event) => bench.show({ photodiodes: (event.target as HTMLInputElement).checked ? "apart" : "sum" })}>photodiodes side by side</label>` : nothing}
      </div>`;
  }

  private nameOf(number: number, channels: number): string {
    const band = this.bench.bands?.length === channels ? this.bench.bands[number] : undefined;
    if (band !== undefined) return `${plain(band * 1e9, 4)} nm`;
    return channels === 3 ? ["red", "green", "blue"][number]! : `channel ${number}`;
  }

  private typed(which: "black" | "white", event: Event): void {
    const box = event.target as HTMLInputElement;
    const level = Number(box.value.replace(",", "."));
    if (Number.isFinite(level) && level >= 0) this.put(which, level, false);
    else box.value = plain(this[which], 3);
  }

  private drawHistogram(histogram: Histogram) {
    const most = this.dragged ? this.most : histogram.most;
    const highest = Math.max(...histogram.counts.flatMap((counts) => counts.slice(1, -1)), 1);
    const x = (level: number) => Math.min((level / most) * WIDE, WIDE - 1);
    // Square roots: dark backgrounds do not hide the rest.
    const y = (count: number) => HIGH - Math.min(Math.sqrt(count / highest), 1) * (HIGH - 4);
    const curve = (counts: number[]) => {
      const step = (histogram.most / most) * (WIDE / counts.length);
      return `M0 ${HIGH}${counts.map((count, at) => `L${(at * step).toFixed(1)} ${y(count).toFixed(1)}H${((at + 1) * step).toFixed(1)}`).join("")}V${HIGH}Z`;
    };
    const grey = histogram.counts.length !== 3;
    return html`<svg viewBox="0 0 ${WIDE} ${HIGH + 8}" role="group" aria-label="Histogram of irradiance, 0 to ${plain(most, 3)}" @pointermove=${this.move} @pointerup=${this.up} @pointercancel=${this.up}>
      ${histogram.counts.map((counts, number) => svg`<path class="bars" style="fill:${grey ? "var(--quiet)" : COLOURS[number]}" d=${curve(counts)}></path>`)}
      ${(["black", "white"] as const).map((which) => svg`<g class="level ${which}" tabindex="0" role="slider" aria-label=${which} aria-valuenow=${this[which]} aria-valuetext=${plain(this[which], 3)}
        @pointerdown=${(event: PointerEvent) => this.down(event, which)} @keydown=${(event: KeyboardEvent) => this.key(event, which)}>
        <rect x=${x(this[which]) - 7} y="0" width="14" height=${HIGH + 8} fill="transparent"></rect>
        <path d="M${x(this[which])} 0V${HIGH}"></path><path class="foot" d="M${x(this[which])} ${HIGH}l5 7h-10z"></path></g>`)}
    </svg>`;
  }

  static override styles = [
    controls,
    css`
      :host { display: block; width: 240px; padding: 8px 10px; }
      svg { width: 100%; display: block; touch-action: none; }
      .none { height: 64px; }
      .bars { mix-blend-mode: normal; fill-opacity: 0.45; }
      .level { cursor: ew-resize; outline: none; }
      .level path { stroke: var(--ink); stroke-width: 1; fill: none; }
      .level.black .foot { fill: #000; stroke: var(--ink); } .level.white .foot { fill: #fff; stroke: var(--ink); }
      .level:focus-visible path { stroke: var(--accent); stroke-width: 2; }
      .clipped { margin: 2px 0 4px; font-size: 11.5px; color: var(--quiet); min-height: 16px; }
      .warn { color: var(--warn-ink); }
      .rows { display: flex; flex-wrap: wrap; align-items: center; gap: 4px 8px; font-size: 12px; }
      .rows label { display: inline-flex; align-items: center; gap: 5px; }
      .rows input[type="text"] { width: 62px; height: 24px; padding: 0 5px; }
      .rows button, .rows select { height: 24px; border-color: var(--line); font-size: 12px; }
    `,
  ];
}

function share(value: number): string {
  return value === 0 ? "nothing" : `${plain(100 * value, 2)} %`;
}

/** The bench from the side: the axis, its elements and the sensor, rays, distances; all of it can be moved along the axis. */

import { html, svg, css, nothing } from "lit";

import type { Selected } from "./bench";
import { axisStep, inMillimetres, short } from "./numbers";
import { Part, controls } from "./part";
import type { Rays, Side, Snap } from "./protocol";
import { drawn, drawnAperture, drawnSensor, type Scale } from "./shapes";

const MARGIN = { left: 14, right: 30, top: 46, bottom: 40 };
/** Within so many pixels of a place that is sharp, what is dragged is pulled to it, and within so many the place is shown. */
const PULL = 7;
const NEAR = 60;
const REACH = 18;
/** A longer drawing than needed is kept up to this ratio, so that it does not jump with every small move. */
const LOOSE = 1.35;
/** Behind the sensor, as a share of the drawing: there is room to drag it to. */
const ROOM = 0.06;
/** In a wider drawing all rays are named, in a narrower one those of the axis. */
const ALL_RAYS = 500;
const KEY_PAUSE = 500;

interface Drag {
  which: Selected;
  /** Pointer's place minus the part's when it began, pixels. */
  grip: number;
  from: number;
  z: number;
  /** Places to which it is pulled, as they were when it began. */
  snaps: Snap[];
  snap: Snap | null;
  moved: boolean;
}

interface Frame {
  start: number;
  end: number;
  half: number;
}

const pencil = document.createElement("canvas").getContext("2d")!;

/** Of words in the drawing's type, pixels. */
function wide(words: string, bold = false): number {
  pencil.font = `${bold ? 600 : 400} 11.5px system-ui, -apple-system, "Segoe UI", Roboto, "Noto Sans", sans-serif`;
  return pencil.measureText(words).width;
}

/** What a fan of rays is called where there is little room: "in focus: 1.3 m", "off the axis". */
function brief({ colour, words }: Rays): string {
  return colour === "off axis" ? "off the axis" : words.replace(/ away$/, "");
}

export class SideView extends Part {
  static override properties = { ...Part.properties, width: { state: true }, height: { state: true }, drag: { state: true }, hover: { state: true } };
  declare width: number;
  declare height: number;
  declare drag: Drag | null;
  declare hover: Selected | null;
  private frame: Frame | null = null;
  private keyTimer = 0;
  private readonly watch = new ResizeObserver(([entry]) => {
    this.width = Math.round(entry!.contentRect.width);
    this.height = Math.round(entry!.contentRect.height);
  });

  constructor() {
    super();
    this.width = this.height = 0;
    this.drag = this.hover = null;
  }

  override connectedCallback(): void {
    super.connectedCallback();
    this.watch.observe(this);
  }

  override disconnectedCallback(): void {
    super.disconnectedCallback();
    this.watch.disconnect();
  }

  // --- where things are ---

  private placeOf(which: Selected): number {
    if (this.drag?.which === which) return this.drag.z;
    return this.bench.partOf(which)?.z ?? 0;
  }

  private parts(): (number | "sensor")[] {
    const all: (number | "sensor")[] = this.bench.side?.elements.map((_, number) => number) ?? [];
    return [...all, "sensor"];
  }

  private lengthOf(which: Selected): number {
    return typeof which === "number" ? (this.bench.side?.elements[which]?.length ?? 0) : 0;
  }

  /** What is drawn, metres. It stays while something is dragged, and grows or shrinks only where it must. */
  private framed(side: Side): Frame {
    const wanted = { start: side.from, end: side.to + ROOM * (side.to - side.from), half: side.half };
    const old = this.frame;
    if (old && this.drag) return old;
    if (
      old && wanted.start >= old.start && wanted.end <= old.end && wanted.half <= old.half &&
      (wanted.end - wanted.start) * LOOSE > old.end - old.start && wanted.half * LOOSE > old.half
    )
      return old;
    this.frame = wanted;
    return wanted;
  }

  private scale(side: Side): Scale & { z(x: number): number } {
    const { start, end, half } = this.framed(side);
    const across = (this.width - MARGIN.left - MARGIN.right) / (end - start);
    const middle = (MARGIN.top + this.height - MARGIN.bottom) / 2;
    const up = (this.height - MARGIN.top - MARGIN.bottom) / 2 / half;
    return {
      x: (z) => MARGIN.left + (z - start) * across,
      z: (x) => start + (x - MARGIN.left) / across,
      y: (height) => middle - height * up,
      top: MARGIN.top,
      bottom: this.height - MARGIN.bottom,
      thick: Math.min(Math.max(0.016 * (end - start) * across, 4), 11),
    };
  }

  // --- moving things ---

  private nearest(event: PointerEvent): { which: Selected; x: number } | null {
    const side = this.bench.side;
    if (!side) return null;
    const scale = this.scale(side);
    const box = this.getBoundingClientRect();
    const x = event.clientX - box.left;
    // The light field's aperture often stands where a lens does: it is taken by its handle below.
    const below = event.clientY - box.top > scale.bottom - 4;
    if (below && side.aperture && Math.abs(scale.x(this.placeOf("light field")) - x) < REACH) return { which: "light field", x };
    let found: Selected | null = null;
    let least = event.pointerType === "mouse" ? REACH : 1.6 * REACH;
    for (const which of this.parts()) {
      const from = scale.x(this.placeOf(which));
      const to = scale.x(this.placeOf(which) + this.lengthOf(which));
      const away = x < from ? from - x : x > to ? x - to : 0;
      // Of two in one place, the one that is selected.
      if (away < least || (away === least && which === this.bench.selected)) [found, least] = [which, away];
    }
    return found === null ? null : { which: found, x };
  }

  private down(event: PointerEvent): void {
    const found = this.nearest(event);
    if (!found || event.button !== 0) return;
    this.bench.select(found.which);
    const z = this.placeOf(found.which);
    this.drag = { which: found.which, grip: found.x - this.scale(this.bench.side!).x(z), from: z, z, snaps: this.snapsOf(found.which), snap: null, moved: false };
    (event.currentTarget as Element).setPointerCapture(event.pointerId);
    this.renderRoot.querySelector<SVGElement>(`[data-part="${found.which}"]`)?.focus({ preventScroll: true, focusVisible: false } as FocusOptions);
    event.preventDefault();
  }

  private move(event: PointerEvent): void {
    if (!this.drag) {
      this.hover = this.nearest(event)?.which ?? null;
      return;
    }
    const scale = this.scale(this.bench.side!);
    const step = axisStep(this.frame!.end - this.frame!.start) / 10;
    const x = event.clientX - this.getBoundingClientRect().left - this.drag.grip;
    let z = Math.round(scale.z(x) / step) * step;
    const snap = event.altKey ? null : this.snapNear(this.drag.snaps, x, scale);
    if (snap && Math.abs(scale.x(snap.z) - x) < PULL) z = snap.z;
    if (z === this.drag.z && this.drag.moved) return;
    if (!this.drag.moved && Math.abs(scale.x(z) - scale.x(this.drag.from)) < 2) return;
    this.drag = { ...this.drag, z, snap, moved: true };
    this.bench.set([...this.bench.whereOf(this.drag.which), "z"], inMillimetres(z), true);
  }

  private up(): void {
    const drag = this.drag;
    if (!drag) return;
    if (drag.moved) this.bench.set([...this.bench.whereOf(drag.which), "z"], inMillimetres(drag.z));
    // The part stays where the hand left it until the host has said so, too.
    const there = () => Math.abs((this.bench.partOf(drag.which)?.z ?? NaN) - drag.z) < 1e-9;
    const settled = () => {
      this.bench.removeEventListener("change", heard);
      if (this.drag === drag) this.drag = null;
    };
    const heard = () => void (there() && settled());
    this.bench.addEventListener("change", heard);
    if (!drag.moved || there()) settled();
    else window.setTimeout(settled, 400);
  }

  private snapsOf(which: Selected): Snap[] {
    if (which === "sensor") return this.bench.side?.snaps ?? [];
    return (which === "light field" ? this.bench.side?.aperture?.snaps : this.bench.side?.elements[which]?.snaps) ?? [];
  }

  private snapNear(snaps: Snap[], x: number, scale: Scale): Snap | null {
    let found: Snap | null = null;
    for (const each of snaps)
      if (Math.abs(scale.x(each.z) - x) < NEAR && (!found || Math.abs(scale.x(each.z) - x) < Math.abs(scale.x(found.z) - x))) found = each;
    return found;
  }

  private key(event: KeyboardEvent, which: Selected): void {
    const by = { ArrowRight: 1, ArrowUp: 1, ArrowLeft: -1, ArrowDown: -1 }[event.key];
    if (by && !event.ctrlKey && !event.metaKey) {
      event.preventDefault();
      const step = axisStep(this.frame!.end - this.frame!.start) * (event.shiftKey ? 10 : event.altKey ? 0.1 : 1);
      const z = (this.drag?.which === which ? this.drag.z : this.placeOf(which)) + by * step;
      const from = this.drag?.from ?? this.placeOf(which);
      this.drag = { which, grip: 0, from, z: Math.round(z / (step / 10)) * (step / 10), snaps: [], snap: null, moved: true };
      this.bench.set([...this.bench.whereOf(which), "z"], inMillimetres(this.drag.z), true);
      window.clearTimeout(this.keyTimer);
      this.keyTimer = window.setTimeout(() => this.keysDone(), KEY_PAUSE);
    } else if (event.key === "Enter") {
      this.dispatchEvent(new CustomEvent("type-place", { bubbles: true, composed: true }));
      event.preventDefault();
    } else if ((event.key === "Delete" || event.key === "Backspace") && typeof which === "number") {
      this.bench.act({ do: "remove", element: which });
      event.preventDefault();
    } else if (event.key === "Escape" && this.drag) {
      const { from } = this.drag;
      this.drag = { ...this.drag, z: from };
      this.keysDone();
    }
  }

  /** Keys that follow one another are one movement; it ends when none came for a while, or the part is left. */
  private keysDone(): void {
    window.clearTimeout(this.keyTimer);
    if (this.drag) this.up();
  }

  // --- drawing ---

  override render() {
    const side = this.bench.side;
    if (!side || !this.width || !this.height) return nothing;
    const scale = this.scale(side);
    const cursor = this.drag || this.hover !== null ? "grab" : "";
    return html`
      <svg width=${this.width} height=${this.height} class=${cursor} role="group" aria-label="The camera from the side"
        @pointerdown=${this.down} @pointermove=${this.move} @pointerup=${this.up} @pointercancel=${this.up}
        @pointerleave=${() => (this.hover = null)}>
        <path class="axis" d="M0 ${scale.y(0)}H${this.width}"></path>
        ${this.drawAperture(side, scale)}
        ${this.parts().map((which) => this.drawBack(which, scale))}
        ${this.parts().map((which) => this.drawPart(which, side, scale))}
        <g class="rays">${side.rays.map((each) => this.drawRays(each, scale))}</g>
        ${this.drawSnap(scale)}
        ${this.drawLabels(side, scale)}
        ${this.drawDistances(side, scale)}
      </svg>
      <ul class="legend">
        ${side.rays.filter((each) => this.width > ALL_RAYS || each.colour !== "off axis").map((each) => html`<li><i class="ray ${each.colour.replace(" ", "-")}"></i>${brief(each)}</li>`)}
      </ul>`;
  }

  private drawRays(rays: Rays, scale: Scale) {
    const lines = new Map<number, string[]>();
    const ends: [number, number][] = [];
    const last = Math.max(...rays.paths.map((path) => path[path.length - 1]?.[0] ?? -Infinity));
    for (const path of rays.paths) {
      for (let at = 1; at < path.length; at++) {
        const [[fromZ, fromY], [z, y, share]] = [path[at - 1]!, path[at]!];
        const tone = Math.ceil(share * 5) / 5;
        if (!lines.has(tone)) lines.set(tone, []);
        lines.get(tone)!.push(`M${scale.x(fromZ).toFixed(1)} ${scale.y(fromY).toFixed(1)}L${scale.x(z).toFixed(1)} ${scale.y(y).toFixed(1)}`);
      }
      const [z, y] = path[path.length - 1] ?? [last, 0];
      if (z < last - 1e-9) ends.push([scale.x(z), scale.y(y)]);
    }
    return svg`<g class="ray ${rays.colour.replace(" ", "-")}">
      ${[...lines].map(([tone, pieces]) => svg`<path d=${pieces.join("")} stroke-opacity=${0.25 + 0.6 * tone}></path>`)}
      ${ends.map(([x, y]) => svg`<circle cx=${x} cy=${y} r="2"></circle>`)}
    </g>`;
  }

  private drawSnap(scale: Scale) {
    const snap = this.drag?.snap;
    if (!snap) return nothing;
    const held = this.drag!.z === snap.z;
    const x = scale.x(snap.z);
    const left = x > this.width - 110;
    return svg`<g class="snap ${held ? "held" : ""}">
      <path d="M${x} ${scale.top - 6}V${scale.bottom + 4}"></path>
      <text x=${x + (left ? -16 : 16)} y=${scale.bottom - 6} text-anchor=${left ? "end" : "start"}>${snap.words}</text>
    </g>`;
  }

  /** The strip of the drawing by which a part is taken. */
  private strip(which: Selected, scale: Scale) {
    const z = this.placeOf(which);
    const length = which === "sensor" ? 1.1 * scale.thick : scale.x(z + this.lengthOf(which)) - scale.x(z);
    const spare = length > 0 ? 6 : 9;
    return { x: scale.x(z) - spare, y: scale.top - 4, width: length + 2 * spare, height: scale.bottom - scale.top + 8 };
  }

  /** What is selected or pointed at stands out, behind all parts: several may stand in one plane. */
  private drawBack(which: Selected, scale: Scale) {
    const state = this.bench.selected === which ? "selected" : this.hover === which ? "hover" : "";
    if (!state) return nothing;
    const { x, y, width, height } = this.strip(which, scale);
    return svg`<rect class="back ${state}" x=${x} y=${y} width=${width} height=${height} rx="5"></rect>`;
  }

  private drawPart(which: number | "sensor", side: Side, scale: Scale) {
    const z = this.placeOf(which);
    const { x, y, width, height } = this.strip(which, scale);
    return this.slider(which, svg`<rect class="strip" x=${x} y=${y} width=${width} height=${height} rx="5"></rect>
      ${which === "sensor" ? drawnSensor(side.sensor, z, scale) : drawn({ ...side.elements[which]!, z }, z, scale)}`);
  }

  /** Where the views of the light field stand, and a handle by which they are moved. */
  private drawAperture(side: Side, scale: Scale) {
    if (!side.aperture) return nothing;
    const z = this.placeOf("light field");
    if (z < this.frame!.start || z > this.frame!.end) return nothing;
    const x = scale.x(z);
    const state = this.bench.selected === "light field" ? "selected" : this.hover === "light field" ? "hover" : "";
    return this.slider("light field", svg`<g class="aperture ${state}">${drawnAperture(side.aperture, x, scale)}
      <path class="handle" d="M${x} ${scale.bottom + 1}l6 9h-12z"></path>
      <rect class="strip" x=${x - 9} y=${scale.bottom - 2} width="18" height="14" rx="4"></rect></g>`);
  }

  /** What can be moved along the axis by keys. */
  private slider(which: Selected, inside: unknown) {
    const z = this.placeOf(which);
    const reach = (this.frame!.end - this.frame!.start) * 1e3;
    return svg`<g class="part" data-part=${which} tabindex="0" role="slider"
        aria-label="${this.bench.partOf(which)!.label.join(", ")}: place on the axis" aria-orientation="horizontal"
        aria-valuemin=${(this.frame!.start * 1e3).toFixed(1)} aria-valuemax=${(this.frame!.start * 1e3 + 2 * reach).toFixed(1)}
        aria-valuenow=${(z * 1e3).toFixed(3)} aria-valuetext=${short(z, 6)}
        @keydown=${(event: KeyboardEvent) => this.key(event, which)}
        @focus=${() => this.bench.select(which)} @blur=${() => this.keysDone()}>${inside}</g>`;
  }

  /** Names above, in two lines where they would meet; what is selected says its place. */
  private drawLabels(side: Side, scale: Scale) {
    const named: Selected[] = this.bench.selected === "light field" && side.aperture ? ["light field", ...this.parts()] : this.parts();
    const labels = named
      .map((which) => {
        const part = this.bench.partOf(which)!;
        const length = this.lengthOf(which);
        const z = this.placeOf(which);
        const chosen = this.bench.selected === which;
        const name = part.label[0] ?? "";
        const words = chosen ? `${name} · ${short(z, 6)}` : name;
        return { which, x: scale.x(z + length / 2), words, chosen, notes: this.bench.notesOf(which).length };
      })
      .sort((one, other) => one.x - other.x);
    const ends = [-Infinity, -Infinity, -Infinity];
    return labels.map((label) => {
      const half = wide(label.words, label.chosen) / 2 + 5;
      const x = Math.min(Math.max(label.x, half), this.width - half - (label.notes ? 14 : 0));
      let line = ends.findIndex((end) => end < x - half);
      if (line < 0) line = ends.indexOf(Math.min(...ends));
      ends[line] = x + half + (label.notes ? 14 : 0);
      const y = MARGIN.top - 11 - 13 * line;
      return svg`<g class="label ${label.chosen ? "chosen" : ""}" aria-hidden="true">
        <text x=${x} y=${y} text-anchor="middle">${label.words}</text>
        ${label.notes ? this.drawBadge(label.which, x + half + 4, y - 4, label.notes) : nothing}
      </g>`;
    });
  }

  private drawBadge(which: Selected, x: number, y: number, count: number) {
    const words = this.bench.notesOf(which).map((note) => note.words).join("\n");
    return svg`<g class="badge" @pointerdown=${(event: Event) => {
        event.stopPropagation();
        this.bench.select(which);
        this.dispatchEvent(new CustomEvent("show-notes", { bubbles: true, composed: true }));
      }}>
      <circle cx=${x} cy=${y} r="6.5"></circle>
      <text x=${x} y=${y + 3.4} text-anchor="middle">${count > 1 ? count : "!"}</text><title>${words}</title></g>`;
  }

  /** From one part to the next, below. */
  private drawDistances(side: Side, scale: Scale) {
    const places = [...new Set(this.parts().map((which) => this.placeOf(which)))].sort((one, other) => one - other);
    const y = this.height - 24;
    const pieces = places.slice(1).map((z, number) => {
      const [from, to] = [scale.x(places[number]!), scale.x(z)];
      const words = short(z - places[number]!, 5);
      const width = wide(words) + 10;
      return svg`<path d="M${from} ${y}H${to}"></path>
        ${to - from > width + 4 ? svg`<rect x=${(from + to - width) / 2} y=${y - 7} width=${width} height="14"></rect>
        <text x=${(from + to) / 2} y=${y + 4} text-anchor="middle">${words}</text>` : nothing}`;
    });
    const ticks = places.map((z) => `M${scale.x(z)} ${y - 4}v8`).join("");
    const scene = side.from < 0 && places.length ? svg`<text class="scene" x="8" y=${y + 4}>← scene</text>` : nothing;
    return svg`<g class="distances" aria-hidden="true">${pieces}<path d=${ticks}></path>${scene}</g>`;
  }

  static override styles = [
    controls,
    css`
      :host { display: block; position: relative; overflow: hidden; min-height: 150px; }
      svg { position: absolute; inset: 0; touch-action: pan-y; user-select: none; }
      svg.grab { cursor: ew-resize; }
      text { font-size: 11.5px; fill: var(--quiet); }
      .axis { stroke: var(--edge); stroke-width: 1; stroke-dasharray: 10 3 2 3; fill: none; }
      .rays { pointer-events: none; }
      g.ray path { fill: none; stroke-width: 1.15; stroke-linecap: round; }
      g.ray.focused path { stroke: var(--focused); } g.ray.focused circle { fill: var(--focused); }
      g.ray.near path { stroke: var(--near); } g.ray.near circle { fill: var(--near); }
      g.ray.far path { stroke: var(--far); } g.ray.far circle { fill: var(--far); }
      g.ray.off-axis path { stroke: var(--aside); } g.ray.off-axis circle { fill: var(--aside); }
      .part { outline: none; }
      .back.hover { fill: var(--hover); }
      .back.selected { fill: var(--chosen); }
      .strip { fill: transparent; }
      .part:focus-visible .strip { stroke: var(--accent); stroke-width: 2; }
      .glass { fill: var(--glass); stroke: var(--glass-edge); stroke-width: 1.2; fill-opacity: 0.85; }
      .glass.block { fill-opacity: 0.5; }
      .glass.open { stroke-dasharray: 4 3; }
      .frost { fill: var(--frost); stroke: var(--frost-edge); stroke-width: 0.8; }
      .frost.open { stroke-dasharray: 4 3; }
      .dark { fill: var(--ink); }
      .outline { fill: none; stroke: var(--ink); stroke-width: 0.8; }
      .sheet { stroke: var(--glass-edge); stroke-width: 2; fill: none; }
      .rim { stroke: var(--ink); stroke-width: 1; stroke-opacity: 0.5; fill: none; }
      .rim.heavy { stroke-width: 3; stroke-opacity: 1; }
      .sensor { fill: var(--quiet); stroke: var(--ink); stroke-width: 0.8; }
      .aperture .borders { stroke: var(--edge); stroke-width: 1.2; fill: none; }
      .aperture .handle { fill: var(--edge); }
      .aperture.hover .borders { stroke: var(--ink); } .aperture.hover .handle { fill: var(--ink); }
      .aperture.selected .borders { stroke: var(--accent); } .aperture.selected .handle { fill: var(--accent); }
      .label.chosen text { fill: var(--accent); font-weight: 600; }
      .badge { cursor: pointer; }
      .badge circle { fill: var(--warn); }
      .badge text { fill: var(--on-warn); font-size: 10px; font-weight: 700; }
      .snap path { stroke: var(--focused); stroke-width: 1; stroke-dasharray: 2 4; stroke-opacity: 0.6; }
      .snap text { fill: var(--focused); fill-opacity: 0.75; }
      .snap.held path { stroke-dasharray: none; stroke-width: 1.5; stroke-opacity: 1; }
      .snap.held text { fill-opacity: 1; font-weight: 600; }
      .distances path { stroke: var(--edge); fill: none; }
      .distances rect { fill: var(--ground); }
      .legend { position: absolute; left: 10px; right: 10px; bottom: 0; margin: 0; padding: 0; list-style: none; display: flex; justify-content: center; gap: 0 16px; white-space: nowrap; font-size: 11.5px; line-height: 16px; color: var(--quiet); pointer-events: none; }
      .legend i { display: inline-block; width: 14px; height: 2px; margin-right: 6px; vertical-align: 3px; border-radius: 1px; }
      i.focused { background: var(--focused); } i.near { background: var(--near); } i.far { background: var(--far); } i.off-axis { background: var(--aside); }
    `,
  ];
}

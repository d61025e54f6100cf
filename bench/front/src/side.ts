/** The bench from the side: its parts are moved, changed by handles, and looked at closely. */

import { html, svg, css, nothing } from "lit";

import type { Selected } from "./bench";
import { Frame, MARGIN, type Mapping } from "./frame";
import { asValue, drawnCone, drawnHandle, handlesOf, inWords, isPlace, placeHandle, placeOf, valueAt, type Held } from "./handles";
import { drawnDistances, drawnLabels } from "./labels";
import { axisStep, short } from "./numbers";
import { Part, controls } from "./part";
import type { Handle, Side, Snap, Table, Value } from "./protocol";
import { drawnRays, legend } from "./rays";
import { drawn, drawnAperture, drawnSensor, type Scale } from "./shapes";
import { sign } from "./signs";

/** Within so many pixels of a place that is sharp, what is dragged is pulled to it, and within so many the place is shown. */
const PULL = 7;
const NEAR = 60;
const REACH = 18;
const HANDLE = 10;
const WHEEL = 0.0022;
/** In a wider drawing all rays are named, in a narrower one those of the axis. */
const ALL_RAYS = 500;
const KEY_PAUSE = 500;
/** A part that is dragged so close to the border of the drawing, pixels, takes the border with it. */
const EDGE = 8;
/** Of the magnifier, pixels; what is closer than this to the sensor or to where rays meet is shown in it. */
const LENS = { width: 156, height: 88 };
const CLOSE = 26;
/** In a narrower drawing it would cover the rays. */
const NARROW = 460;

export class SideView extends Part {
  static override properties = { ...Part.properties, width: { state: true }, height: { state: true }, held: { state: true }, hover: { state: true }, magnifies: { state: true } };
  declare width: number;
  declare height: number;
  declare held: Held | null;
  declare hover: Selected | null;
  declare magnifies: boolean;
  private readonly frame = new Frame();
  private readonly pointers = new Map<number, { x: number; y: number }>();
  private panning = false;
  private keyTimer = 0;
  private readonly watch = new ResizeObserver(([entry]) => {
    this.width = Math.round(entry!.contentRect.width);
    this.height = Math.round(entry!.contentRect.height);
  });

  constructor() {
    super();
    this.width = this.height = 0;
    this.held = this.hover = null;
    this.magnifies = true;
  }

  override connectedCallback(): void {
    super.connectedCallback();
    this.watch.observe(this);
    // Lit's listeners are passive in some browsers; two fingers zoom the drawing and not the page.
    this.addEventListener("wheel", this.wheel, { passive: false });
    this.addEventListener("touchstart", this.twoFingers, { passive: false });
  }

  override disconnectedCallback(): void {
    super.disconnectedCallback();
    this.watch.disconnect();
    this.removeEventListener("wheel", this.wheel);
    this.removeEventListener("touchstart", this.twoFingers);
  }

  protected override watched() {
    const { side, document, open, selected, notes } = this.bench;
    return [side, document, open, selected, notes];
  }

  private parts(): (number | "sensor")[] {
    const all: (number | "sensor")[] = this.bench.side?.elements.map((_, number) => number) ?? [];
    return [...all, "sensor"];
  }

  private lengthOf(which: Selected): number {
    return typeof which === "number" ? (this.bench.side?.elements[which]?.length ?? 0) : 0;
  }

  private mapping(): Mapping {
    this.frame.follow(this.bench.side!, this.held !== null);
    return this.frame.mapping(this.width, this.height);
  }

  // --- zoom and pan ---

  private readonly wheel = (event: WheelEvent) => {
    if (!this.bench.side) return;
    event.preventDefault();
    const { x, y } = this.pointOf(event);
    this.zoom(Math.exp(-event.deltaY * WHEEL * (event.deltaMode === 1 ? 20 : 1)), x, y);
  };

  private readonly twoFingers = (event: TouchEvent) => {
    if (event.touches.length > 1) event.preventDefault();
  };

  private zoom(factor: number, x?: number, y?: number): void {
    this.mapping();
    this.frame.zoomTo(this.frame.zoom * factor, this.width, this.height, x, y);
    this.requestUpdate();
  }

  private fit(): void {
    this.zoom(0);
  }

  // --- pointers ---

  private pointOf(event: MouseEvent): { x: number; y: number } {
    const box = this.getBoundingClientRect();
    return { x: event.clientX - box.left, y: event.clientY - box.top };
  }

  /** All parts at a place, the nearest first. */
  private partsAt(event: PointerEvent, { x, y }: { x: number; y: number }): Selected[] {
    const side = this.bench.side;
    if (!side) return [];
    const scale = this.mapping();
    // The light field's aperture often stands where a lens does: it is taken by its handle below.
    const below = y > scale.bottom - 4;
    if (below && side.aperture && Math.abs(scale.x(this.bench.placeOf("light field")) - x) < REACH) return ["light field"];
    const least = event.pointerType === "mouse" ? REACH : 1.6 * REACH;
    return this.parts()
      .map((which) => {
        const from = scale.x(this.bench.placeOf(which));
        const to = scale.x(this.bench.placeOf(which) + this.lengthOf(which));
        return { which, away: x < from ? from - x : x > to ? x - to : 0 };
      })
      .filter(({ away }) => away < least)
      .sort((one, other) => one.away - other.away || Number(other.which === this.bench.selected) - Number(one.which === this.bench.selected))
      .map(({ which }) => which);
  }

  private handleAt(event: PointerEvent, { x, y }: { x: number; y: number }): Handle | null {
    const scale = this.mapping();
    let [found, least]: [Handle | null, number] = [null, event.pointerType === "mouse" ? HANDLE : 2 * HANDLE];
    for (const handle of handlesOf(this.bench)) {
      const place = placeOf(this.bench, handle, scale);
      const away = Math.hypot(place.x - x, place.y - y);
      if (away < least) [found, least] = [handle, away];
    }
    return found;
  }

  private down(event: PointerEvent): void {
    if (event.button !== 0 || !this.bench.side) return;
    const point = this.pointOf(event);
    this.pointers.set(event.pointerId, point);
    (event.currentTarget as Element).setPointerCapture(event.pointerId);
    if (this.pointers.size > 1) {
      this.up();
      return;
    }
    const handle = this.handleAt(event, point);
    const which = handle ? this.bench.selected : this.partsAt(event, point)[0];
    if (which === undefined) {
      this.panning = true;
      return;
    }
    this.again = !handle && this.bench.selected === which;
    this.held = this.hold(which, handle, point);
    this.bench.select(which);
    const taken = handle ? `[data-handle="${handle.words}"]` : `[data-part="${which}"]`;
    this.renderRoot.querySelector<SVGElement>(taken)?.focus({ preventScroll: true, focusVisible: false } as FocusOptions);
    event.preventDefault();
  }
  /** Whether what is pressed on was selected before: a click then selects the next part in the same place. */
  private again = false;

  private move(event: PointerEvent): void {
    const point = this.pointOf(event);
    const before = this.pointers.get(event.pointerId);
    if (!before) {
      this.hover = this.partsAt(event, point)[0] ?? null;
      this.classList.toggle("over-handle", this.bench.side !== null && this.handleAt(event, point) !== null);
      return;
    }
    if (this.pointers.size === 2) {
      const other = [...this.pointers].find(([id]) => id !== event.pointerId)![1];
      const apart = (one: { x: number; y: number }) => Math.max(Math.hypot(one.x - other.x, one.y - other.y), 1);
      this.frame.pan((point.x - before.x) / 2, (point.y - before.y) / 2, this.width, this.height);
      this.zoom(apart(point) / apart(before), (point.x + other.x) / 2, (point.y + other.y) / 2);
    } else if (this.held) this.drag(this.held, point, event.altKey);
    else if (this.panning && this.frame.zoom > 1) {
      this.frame.pan(point.x - before.x, point.y - before.y, this.width, this.height);
      this.requestUpdate();
    }
    this.pointers.set(event.pointerId, point);
  }

  /** Places of the hand that come before the browser's next frame, where it tells them: an image is asked for at once. */
  private moveRaw(event: PointerEvent): void {
    if (this.held && this.pointers.size === 1) this.move(event);
  }

  /** Take hold of a handle, or of a part. */
  private hold(which: Selected, handle: Handle | null, point = { x: 0, y: 0 }): Held {
    const place = this.bench.placeOf(which);
    const taken = handle ?? placeHandle(place);
    const table = this.bench.tableOf(which) ?? null;
    const from = taken.where.reduce<Value>((at, step) => (at as Table | null)?.[step] ?? null, table) ?? (handle ? null : "0 mm");
    return {
      which, handle: taken, where: [...this.bench.whereOf(which), ...taken.where], value: taken.value, from, ...point,
      grip: point.x - this.mapping().x(place), moved: false, snaps: handle ? [] : this.snapsOf(which), snap: null,
    };
  }

  private drag(held: Held, point: { x: number; y: number }, free: boolean): void {
    const scale = this.mapping();
    const part = isPlace(held);
    const next = part ? this.pulled(held, point.x - held.grip, free, scale) : { value: valueAt(held, point.x, point.y, scale).value, snap: null };
    const away = part ? scale.x(next.value) - scale.x(held.handle.value) : Math.hypot(point.x - held.x, point.y - held.y);
    if (held.moved ? next.value === held.value : Math.abs(away) < 2) return;
    this.put({ ...held, ...next });
    // Only at the very border: a drawing whose scale changed under the hand would run away.
    if (part && (point.x < EDGE || point.x > this.width - EDGE)) this.frame.reach(next.value, this.width, this.height);
  }

  /** Where a part comes to stand: at a round place, or where something is sharp near that. */
  private pulled(held: Held, x: number, free: boolean, scale: Mapping): { value: number; snap: Snap | null } {
    const step = axisStep(this.frame.length / this.frame.zoom) / 10;
    const snap = free ? null : this.snapNear(held.snaps, x, scale);
    return { value: snap && Math.abs(scale.x(snap.z) - x) < PULL ? snap.z : Math.round(scale.z(x) / step) * step, snap };
  }

  private put(held: Held): void {
    this.held = { ...held, moved: true };
    this.bench.set(held.where, asValue(held.handle, held.value).words, true);
  }

  private lift(event: PointerEvent): void {
    const { held, again } = this;
    const point = this.pointOf(event);
    this.pointers.delete(event.pointerId);
    if (held && !held.moved && again) {
      const here = this.partsAt(event, point);
      const scale = this.mapping();
      const same = here.filter((which) => Math.abs(scale.x(this.bench.placeOf(which)) - scale.x(held.value)) < 2);
      if (same.length > 1) this.bench.select(same[(same.indexOf(held.which) + 1) % same.length]!);
    }
    this.up();
  }

  private up(): void {
    const { held } = this;
    this.panning = false;
    this.held = null;
    if (held?.moved) this.bench.set(held.where, asValue(held.handle, held.value).words);
  }

  /** End a movement, by the pointer or by keys, as if it had not begun. */
  private takeBack(): void {
    const { held } = this;
    window.clearTimeout(this.keyTimer);
    this.panning = false;
    this.held = null;
    if (held?.moved) this.bench.set(held.where, held.from);
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

  // --- keys ---

  private keyOfPart(event: KeyboardEvent, which: Selected): void {
    const by = { ArrowRight: 1, ArrowUp: 1, ArrowLeft: -1, ArrowDown: -1 }[event.key];
    if (by && !event.ctrlKey && !event.metaKey) {
      event.preventDefault();
      const step = axisStep(this.frame.length / this.frame.zoom) * (event.shiftKey ? 10 : event.altKey ? 0.1 : 1);
      const value = Math.round((this.bench.placeOf(which) + by * step) / (step / 10)) * (step / 10);
      this.put({ ...(this.held ?? this.hold(which, null)), value, snap: null });
      this.frame.reach(value, this.width, this.height);
      this.waitForKeys();
    } else if (event.key === "Enter") {
      this.dispatchEvent(new CustomEvent("type-place", { bubbles: true, composed: true }));
      event.preventDefault();
    } else if ((event.key === "Delete" || event.key === "Backspace") && typeof which === "number") {
      this.bench.act({ do: "remove", element: which });
      event.preventDefault();
    }
  }

  private keyOfHandle(event: KeyboardEvent, handle: Handle): void {
    const by = { ArrowRight: 1, ArrowUp: 1, ArrowLeft: -1, ArrowDown: -1 }[event.key];
    if (!by || event.ctrlKey || event.metaKey) return;
    event.preventDefault();
    event.stopPropagation();
    const size = handle.words === "decentre" ? axisStep(this.frame.length) : handle.unit === "angle" ? Math.PI / 180 : 0.02 * Math.abs(handle.value);
    const held = this.held?.handle.words === handle.words ? this.held : this.hold(this.bench.selected, handle);
    const { value } = asValue(handle, held.value + by * size * (event.shiftKey ? 5 : event.altKey ? 0.2 : 1));
    this.put({ ...held, value });
    this.waitForKeys();
  }

  private waitForKeys(): void {
    window.clearTimeout(this.keyTimer);
    this.keyTimer = window.setTimeout(() => this.keysDone(), KEY_PAUSE);
  }

  /** Keys that follow one another are one movement; it ends when none came for a while, or the part is left. */
  private keysDone(): void {
    window.clearTimeout(this.keyTimer);
    if (this.pointers.size === 0) this.up();
  }

  private keyOfDrawing(event: KeyboardEvent): void {
    if (event.key === "Escape" && this.held) {
      event.preventDefault();
      this.takeBack();
    }
    if (event.ctrlKey || event.metaKey || event.altKey) return;
    const x = this.mapping().x(this.bench.placeOf(this.bench.selected));
    const y = (MARGIN.top + this.height - MARGIN.bottom) / 2;
    if (event.key === "+" || event.key === "=") this.zoom(1.5, x, y);
    else if (event.key === "-") this.zoom(1 / 1.5, x, y);
    else if (event.key === "0") this.fit();
    else return;
    event.preventDefault();
  }

  // --- drawing ---

  override render() {
    const side = this.bench.side;
    if (!side || !this.width || !this.height) return nothing;
    const scale = this.mapping();
    const cursor = this.held || this.hover !== null ? "grab" : this.frame.zoom > 1 ? "pan" : "";
    return html`
      <svg width=${this.width} height=${this.height} class="${cursor} ${this.bench.open ? "" : "stale"}" role="group" aria-label="The camera from the side"
        style="touch-action:${this.width > ALL_RAYS || this.frame.zoom > 1 ? "none" : "pan-y"}"
        @pointerdown=${this.down} @pointermove=${this.move} @pointerrawupdate=${this.moveRaw} @pointerup=${this.lift} @pointercancel=${this.lift}
        @pointerleave=${() => (this.hover = null)} @keydown=${this.keyOfDrawing}
        @dblclick=${(event: MouseEvent) => this.hover === null && (this.frame.zoom > 1 ? this.fit() : this.zoom(6, ...this.at(event)))}>
        <clipPath id="stage"><rect x="0" y=${scale.top - 8} width=${this.width} height=${scale.bottom - scale.top + 24}></rect></clipPath>
        <g clip-path="url(#stage)">${this.drawParts(side, scale)}
          ${this.drawSnap(scale)}
          ${handlesOf(this.bench).map((handle) => this.drawHandle(handle, scale))}</g>
        ${drawnLabels(this.bench, this.bench.selected === "light field" && side.aperture ? ["light field", ...this.parts()] : this.parts(), scale, this.width, (...given) => this.drawBadge(...given))}
        ${drawnDistances(this.parts().map((which) => this.bench.placeOf(which)), scale, this.height, side.start < 0)}
        ${this.magnifies ? this.drawMagnifier(side, scale) : nothing}
      </svg>
      ${legend(side.rays, this.width > ALL_RAYS)}
      <div class="tools" role="toolbar" aria-label="Drawing">
        <button class="icon" title="Zoom out (−)" aria-label="Zoom the drawing out" ?disabled=${this.frame.zoom <= 1} @click=${() => this.zoom(1 / 1.5)}>${sign("minus")}</button>
        <button class="icon" title="Zoom in (+, wheel, pinch)" aria-label="Zoom the drawing in" @click=${() => this.zoom(1.5, scale.x(this.bench.placeOf(this.bench.selected)), scale.y(0))}>${sign("plus")}</button>
        <button class="icon" title="All of it (0)" aria-label="The whole drawing" ?disabled=${this.frame.zoom <= 1} @click=${() => this.fit()}>${sign("whole")}</button>
        <button class="icon" title="Magnifier near the sensor" aria-label="Magnifier" aria-pressed=${this.magnifies} @click=${() => (this.magnifies = !this.magnifies)}>${sign("lens")}</button>
        <button class="axis" title="Which direction points upwards: x, to the right in the scene, or y" aria-label="Upwards: ${side.axis}" @click=${() => this.bench.show({ axis: side.axis === "x" ? "y" : "x" })}>${side.axis}<span aria-hidden="true">↑</span></button>
      </div>`;
  }

  private at(event: MouseEvent): [number, number] {
    const { x, y } = this.pointOf(event);
    return [x, y];
  }

  private drawParts(side: Side, scale: Scale) {
    return svg`<path class="axis" d="M0 ${scale.y(0)}H${this.width}"></path>
      ${this.drawAperture(side, scale)}
      ${this.parts().map((which) => this.drawBack(which, scale))}
      ${this.parts().map((which) => this.drawPart(which, side, scale))}
      <g class="rays">${side.rays.map((each) => drawnRays(each, scale))}</g>`;
  }

  /** What stands close to the sensor, and where rays meet, enlarged; nothing where the drawing shows it already. */
  private drawMagnifier(side: Side, scale: Mapping) {
    if (this.frame.zoom > 1 || this.width < NARROW || this.held?.which === "light field") return nothing;
    const sensor = this.bench.placeOf("sensor");
    const near = this.parts().map((which) => this.bench.placeOf(which) + this.lengthOf(which));
    const every = [...near, ...side.rays.flatMap((each) => (each.meet ? [each.meet[0]] : []))].filter((z) => Math.abs(scale.x(z) - scale.x(sensor)) < CLOSE);
    const [low, high] = [Math.min(sensor, ...every), Math.max(sensor, ...every)];
    const shown = Math.max(high - low, 1e-6);
    if (scale.x(high) - scale.x(low) < 1) return nothing;
    const times = Math.min((LENS.width - 60) / (scale.x(low + shown) - scale.x(low)), 60);
    if (times < 2) return nothing;
    const [x0, y0] = [Math.max(scale.x(sensor) - LENS.width - 22, 30), scale.top - 4];
    const middle = (low + high) / 2;
    const inside: Scale = {
      x: (z) => x0 + LENS.width / 2 + (scale.x(z) - scale.x(middle)) * times,
      y: (height) => y0 + LENS.height / 2 + (scale.y(height) - scale.y(0)) * times,
      top: y0, bottom: y0 + LENS.height, thick: 9,
    };
    const [left, right] = [scale.x(middle) - LENS.width / 2 / times, scale.x(middle) + LENS.width / 2 / times];
    return svg`<g class="magnifier" aria-hidden="true">
      <clipPath id="lens"><rect x=${x0} y=${y0} width=${LENS.width} height=${LENS.height} rx="8"></rect></clipPath>
      <path class="leads" d="M${left} ${scale.y(0)}L${x0 + LENS.width - 12} ${y0 + LENS.height}M${right} ${scale.y(0)}L${x0 + LENS.width} ${y0 + LENS.height - 8}"></path>
      <rect class="ground" x=${x0} y=${y0} width=${LENS.width} height=${LENS.height} rx="8"></rect>
      <g clip-path="url(#lens)"><path class="axis" d="M${x0} ${inside.y(0)}h${LENS.width}"></path>
        ${this.parts().map((which) => (which === "sensor" ? drawnSensor(side.sensor, sensor, inside) : drawn(side.elements[which]!, this.bench.placeOf(which), inside)))}
        <g class="rays">${side.rays.map((each) => drawnRays(each, inside))}</g></g>
      <rect class="edge" x=${x0} y=${y0} width=${LENS.width} height=${LENS.height} rx="8"></rect>
      <text x=${x0 + 6} y=${y0 + LENS.height - 6}>${times < 10 ? times.toFixed(1) : Math.round(times)}×</text></g>`;
  }

  private drawHandle(handle: Handle, scale: Mapping) {
    const { x, y } = placeOf(this.bench, handle, scale);
    const active = this.held?.handle.words === handle.words;
    const label = this.bench.partOf(this.bench.selected)?.label[0] ?? "";
    const now = this.held && active ? { ...handle, value: this.held.value } : handle;
    return svg`<g class="knob ${active ? "active" : ""}" data-handle=${handle.words} tabindex="0" role="slider" aria-label="${handle.words} of ${label}"
        aria-valuenow=${now.value} aria-valuetext=${inWords(now)} @keydown=${(event: KeyboardEvent) => this.keyOfHandle(event, handle)} @blur=${() => this.keysDone()}>
      ${drawnCone(this.bench, handle, scale)}${drawnHandle(now, x, y, active)}</g>`;
  }

  private drawSnap(scale: Scale) {
    const snap = this.held?.snap;
    if (!snap) return nothing;
    const held = this.held!.value === snap.z;
    const x = scale.x(snap.z);
    const left = x > this.width - 110;
    return svg`<g class="snap ${held ? "held" : ""}">
      <path d="M${x} ${scale.top - 6}V${scale.bottom + 4}"></path>
      <text x=${x + (left ? -16 : 16)} y=${scale.top + 12} text-anchor=${left ? "end" : "start"}>${snap.words}</text>
    </g>`;
  }

  /** The strip of the drawing by which a part is taken. */
  private strip(which: Selected, scale: Scale) {
    const z = this.bench.placeOf(which);
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
    const z = this.bench.placeOf(which);
    const { x, y, width, height } = this.strip(which, scale);
    return this.slider(which, svg`<rect class="strip" x=${x} y=${y} width=${width} height=${height} rx="5"></rect>
      ${which === "sensor" ? drawnSensor(side.sensor, z, scale) : drawn(side.elements[which]!, z, scale)}`);
  }

  /** Where the views of the light field stand, and a handle by which they are moved. */
  private drawAperture(side: Side, scale: Scale) {
    if (!side.aperture) return nothing;
    const z = this.bench.placeOf("light field");
    const x = scale.x(z);
    if (x < 0 || x > this.width) return nothing;
    const state = this.bench.selected === "light field" ? "selected" : this.hover === "light field" ? "hover" : "";
    return this.slider("light field", svg`<g class="aperture ${state}">${drawnAperture(side.aperture, x, scale)}
      <path class="handle" d="M${x} ${scale.bottom + 1}l6 9h-12z"></path>
      <rect class="strip" x=${x - 9} y=${scale.bottom - 2} width="18" height="14" rx="4"></rect></g>`);
  }

  /** What can be moved along the axis by keys. */
  private slider(which: Selected, inside: unknown) {
    const z = this.bench.placeOf(which);
    const { start } = this.frame.range!;
    return svg`<g class="part" data-part=${which} tabindex="0" role="slider"
        aria-label="${this.bench.partOf(which)!.label.join(", ")}: place on the axis" aria-orientation="horizontal"
        aria-valuemin=${(start * 1e3).toFixed(1)} aria-valuemax=${((start + 2 * this.frame.length) * 1e3).toFixed(1)}
        aria-valuenow=${(z * 1e3).toFixed(3)} aria-valuetext=${short(z, 6)}
        @keydown=${(event: KeyboardEvent) => this.keyOfPart(event, which)}
        @focus=${() => this.bench.select(which)} @blur=${() => this.keysDone()}>${inside}</g>`;
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

  static override styles = [
    controls,
    css`
      :host { display: block; position: relative; overflow: hidden; min-height: 150px; }
      svg { user-select: none; }
      :host > svg, svg[role="group"] { position: absolute; inset: 0; }
      svg.grab { cursor: ew-resize; } svg.pan { cursor: grab; }
      :host(.over-handle) svg { cursor: move; }
      svg.stale .rays { opacity: 0.25; }
      text { font-size: 11.5px; fill: var(--quiet); }
      .axis { stroke: var(--edge); stroke-width: 1; stroke-dasharray: 10 3 2 3; fill: none; }
      .rays { pointer-events: none; }
      g.ray path { fill: none; stroke-width: 1.15; stroke-linecap: round; }
      g.ray path.beyond { stroke-dasharray: 2 3; stroke-opacity: 0.7; }
      g.ray circle.meet { stroke: var(--ground); stroke-width: 1; }
      g.ray.focused path { stroke: var(--focused); stroke-width: 1.5; } g.ray.focused circle { fill: var(--focused); }
      g.ray.near path { stroke: var(--near); } g.ray.near circle { fill: var(--near); }
      g.ray.far path { stroke: var(--far); } g.ray.far circle { fill: var(--far); }
      g.ray.off-axis path { stroke: var(--aside); } g.ray.off-axis circle { fill: var(--aside); }
      .part, .knob { outline: none; }
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
      .knob circle, .knob path { fill: var(--well); stroke: var(--accent); stroke-width: 1.8; cursor: move; }
      .knob.active circle, .knob.active path, .knob:focus-visible circle, .knob:focus-visible path { fill: var(--accent); }
      .knob path.cone { fill: none; stroke-width: 1; stroke-dasharray: 4 3; pointer-events: none; }
      .knob .sign { font-size: 9.5px; font-weight: 700; fill: var(--accent); pointer-events: none; }
      .knob.active .sign, .knob:focus-visible .sign { fill: var(--well); }
      .knob .says { fill: var(--accent); font-weight: 600; opacity: 0; pointer-events: none; paint-order: stroke; stroke: var(--ground); stroke-width: 4px; }
      .knob:hover .says, .knob:focus-visible .says, .knob .says.active { opacity: 1; }
      .chosen { fill: var(--accent); font-weight: 600; }
      .badge { cursor: pointer; }
      .badge circle { fill: var(--warn); }
      .badge text { fill: var(--on-warn); font-size: 10px; font-weight: 700; }
      .snap path { stroke: var(--focused); stroke-width: 1; stroke-dasharray: 2 4; stroke-opacity: 0.6; }
      .snap text { fill: var(--focused); fill-opacity: 0.75; paint-order: stroke; stroke: var(--ground); stroke-width: 4px; }
      .snap.held path { stroke-dasharray: none; stroke-width: 1.5; stroke-opacity: 1; }
      .snap.held text { fill-opacity: 1; font-weight: 600; }
      .distances path { stroke: var(--edge); fill: none; }
      .distances rect { fill: var(--ground); }
      .magnifier { pointer-events: none; }
      .magnifier .ground { fill: var(--ground); }
      .magnifier .edge { fill: none; stroke: var(--edge); }
      .magnifier .leads { stroke: var(--edge); stroke-dasharray: 2 2; fill: none; }
      .magnifier text { font-size: 10.5px; paint-order: stroke; stroke: var(--ground); stroke-width: 3px; }
      .legend { position: absolute; left: 10px; right: 10px; bottom: 0; margin: 0; padding: 0; list-style: none; display: flex; justify-content: center; gap: 0 16px; white-space: nowrap; font-size: 11.5px; line-height: 16px; color: var(--quiet); pointer-events: none; }
      .legend i { display: inline-block; width: 14px; height: 2px; margin-right: 6px; vertical-align: 3px; border-radius: 1px; }
      i.focused { background: var(--focused); } i.near { background: var(--near); } i.far { background: var(--far); } i.off-axis { background: var(--aside); }
      .tools { position: absolute; right: 6px; top: 4px; display: flex; gap: 1px; }
      .tools .icon, .tools .axis { width: 25px; height: 23px; padding: 0; gap: 1px; color: var(--quiet); stroke: none; }
      .tools button:disabled { color: var(--faint); }
    `,
  ];
}

/** The picture on a canvas: zoomed and moved down to single pixels, compared with a pinned one, clicked to focus. */

import { html, css, nothing } from "lit";

import { answerStyles } from "./answers";
import { saved } from "./bench";
import { drawPictures, type Compare } from "./canvas";
import { plain, short } from "./numbers";
import { Part, controls } from "./part";
import { plotted } from "./plots";
import type { PictureMessage } from "./protocol";
import { sign } from "./signs";

const MODES: [Compare, string][] = [["alone", "Picture"], ["beside", "Side by side"], ["wipe", "Wipe"], ["difference", "Difference ×4"]];
const MOST_ZOOM = 64;
const WHEEL = 0.0016;
/** Share of the rays from which on it is said that they are missing. */
const MISSING = 0.005;
/** From so many pixels of the screen on, a pixel of the picture has an outline when it is pointed at. */
const OUTLINED = 6;

interface Place {
  x: number;
  y: number;
}

export class PictureView extends Part {
  static override properties = {
    ...Part.properties, zoom: { state: true }, compare: { state: true }, wipe: { state: true }, aiming: { state: true }, at: { state: true },
    width: { state: true }, height: { state: true }, levels: { state: true }, measures: { state: true }, line: { state: true }, frame: { state: true },
  };
  /** Times what fits. */
  declare zoom: number;
  declare compare: Compare;
  declare wipe: number;
  declare aiming: boolean;
  /** The pixel that is pointed at. */
  declare at: Place | null;
  declare width: number;
  declare height: number;
  /** Whether the levels are shown, and whether a line is drawn to read a profile along. */
  declare levels: boolean;
  declare measures: boolean;
  /** The ends of that line, pixels of the picture. */
  declare line: [Place, Place] | null;
  /** Of a sweep's frames, the one that is shown. */
  declare frame: number;
  /** What stands in the middle, as a share of the picture. */
  private middle: Place = { x: 0.5, y: 0.5 };
  private readonly pointers = new Map<number, Place>();
  private gesture: "pan" | "wipe" | "line" | null = null;
  private travelled = 0;
  private asked: PictureMessage | null = null;
  /** What the canvas shows: what looks the same is not drawn again, while other things move. */
  private drawn: unknown[] = [];
  private readonly watch = new ResizeObserver(([entry]) => {
    this.width = entry!.contentRect.width;
    this.height = entry!.contentRect.height;
  });

  constructor() {
    super();
    this.zoom = 1;
    this.compare = "alone";
    this.wipe = 0.5;
    this.aiming = this.levels = this.measures = false;
    this.at = this.line = null;
    this.frame = 0;
    this.width = this.height = 0;
  }

  override connectedCallback(): void {
    super.connectedCallback();
    void this.updateComplete.then(() => {
      if (this.isConnected) this.watch.observe(this.renderRoot.querySelector(".stage")!);
    });
  }

  override firstUpdated(): void {
    // Lit's listeners of wheels are passive in some browsers.
    this.canvas.addEventListener("wheel", (event) => this.wheel(event), { passive: false });
  }

  override disconnectedCallback(): void {
    super.disconnectedCallback();
    this.watch.disconnect();
  }

  protected override watched() {
    const { picture, pins, pinned, value, without, look, frames, document, answers, waiting } = this.bench;
    return [picture, picture?.about, pins, pinned, value, without, look, frames, document?.exposure, document?.noise, document?.camera.sensor["shape"], answers.get("profile"), waiting];
  }

  private get canvas(): HTMLCanvasElement {
    return this.renderRoot.querySelector("canvas")!;
  }

  /** Rows and columns of the full picture, the sensor's pixels. */
  private get shape(): [number, number] {
    const about = this.bench.picture?.about;
    const shape = this.bench.document?.camera.sensor["shape"];
    const [down, across] = about?.look.photodiodes === "apart" ? about.photodiodes : [1, 1];
    return Array.isArray(shape) ? [Number(shape[0]) * down, Number(shape[1]) * across] : (about?.shape ?? [1, 1]);
  }

  private get mode(): Compare {
    return this.bench.pinned && !this.bench.frames ? this.compare : "alone";
  }

  /** Width of one of the pictures shown, and where each begins. */
  private get paneWidth(): number {
    return this.mode === "beside" ? this.width / 2 : this.width;
  }

  /** Pixels of the screen for one of the picture. */
  private get unit(): number {
    const [rows, columns] = this.shape;
    return this.zoom * Math.min((this.paneWidth - 2) / columns, (this.height - 2) / rows);
  }

  private corner(): Place {
    const [rows, columns] = this.shape;
    return { x: this.paneWidth / 2 - this.middle.x * columns * this.unit, y: this.height / 2 - this.middle.y * rows * this.unit };
  }

  private pixelAt(place: Place): Place | null {
    const [rows, columns] = this.shape;
    const corner = this.corner();
    const x = Math.floor(((this.mode === "beside" ? place.x % this.paneWidth : place.x) - corner.x) / this.unit);
    const y = Math.floor((place.y - corner.y) / this.unit);
    return x >= 0 && y >= 0 && x < columns && y < rows ? { x, y } : null;
  }

  // --- zoom and pan ---

  private zoomTo(zoom: number, around: Place = { x: this.paneWidth / 2, y: this.height / 2 }): void {
    const [rows, columns] = this.shape;
    const fits = this.unit / this.zoom;
    const next = Math.min(Math.max(zoom, 1), Math.max(MOST_ZOOM / fits, 1));
    const before = this.unit;
    this.zoom = next;
    const after = this.unit;
    const away = { x: around.x - this.paneWidth / 2, y: around.y - this.height / 2 };
    this.middle = {
      x: this.middle.x + (away.x / before - away.x / after) / columns,
      y: this.middle.y + (away.y / before - away.y / after) / rows,
    };
    this.keepWithin();
  }

  private pan(dx: number, dy: number): void {
    const [rows, columns] = this.shape;
    this.middle = { x: this.middle.x - dx / this.unit / columns, y: this.middle.y - dy / this.unit / rows };
    this.keepWithin();
  }

  private keepWithin(): void {
    const [rows, columns] = this.shape;
    const clamp = (value: number, room: number, size: number) =>
      size <= room ? 0.5 : Math.min(Math.max(value, room / 2 / size), 1 - room / 2 / size);
    this.middle = {
      x: clamp(this.middle.x, this.paneWidth, columns * this.unit),
      y: clamp(this.middle.y, this.height, rows * this.unit),
    };
    this.requestUpdate();
  }

  private wheel(event: WheelEvent): void {
    event.preventDefault();
    const place = this.placeOf(event);
    this.zoomTo(this.zoom * Math.exp(-event.deltaY * WHEEL * (event.deltaMode === 1 ? 20 : 1)), { x: place.x % this.paneWidth, y: place.y });
  }

  private placeOf(event: MouseEvent): Place {
    const box = this.canvas.getBoundingClientRect();
    return { x: event.clientX - box.left, y: event.clientY - box.top };
  }

  // --- pointers and keys ---

  private down(event: PointerEvent): void {
    if (event.button !== 0) return;
    const place = this.placeOf(event);
    this.canvas.setPointerCapture(event.pointerId);
    this.pointers.set(event.pointerId, place);
    this.travelled = 0;
    const pixel = this.pixelAt(place);
    this.gesture = this.onWipe(place) ? "wipe" : this.measures && pixel && this.pointers.size === 1 ? "line" : "pan";
    if (this.gesture === "line") this.line = [pixel!, pixel!];
  }

  private onWipe(place: Place): boolean {
    return this.mode === "wipe" && Math.abs(place.x - this.wipe * this.width) < 14;
  }

  private move(event: PointerEvent): void {
    const place = this.placeOf(event);
    const before = this.pointers.get(event.pointerId);
    if (!before) {
      this.point(this.pixelAt(place));
      this.canvas.classList.toggle("wiping", this.onWipe(place));
      return;
    }
    this.travelled += Math.hypot(place.x - before.x, place.y - before.y);
    if (this.gesture === "wipe") this.wipe = Math.min(Math.max(place.x / this.width, 0), 1);
    else if (this.gesture === "line" && this.line) this.line = [this.line[0], this.pixelAt(place) ?? this.line[1]];
    else if (this.pointers.size === 2) {
      const other = [...this.pointers].find(([id]) => id !== event.pointerId)![1];
      const apart = (one: Place) => Math.max(Math.hypot(one.x - other.x, one.y - other.y), 1);
      this.zoomTo((this.zoom * apart(place)) / apart(before), { x: ((place.x + other.x) / 2) % this.paneWidth, y: (place.y + other.y) / 2 });
    } else this.pan(place.x - before.x, place.y - before.y);
    this.pointers.set(event.pointerId, place);
  }

  private up(event: PointerEvent): void {
    const began = this.pointers.delete(event.pointerId);
    if (began && this.gesture === "line") {
      this.gesture = null;
      if (this.travelled <= 4) this.line = null;
      this.askProfile();
      return;
    }
    if (!began || this.travelled > 4 || this.gesture === "wipe") return;
    const pixel = this.pixelAt(this.placeOf(event));
    this.point(pixel);
    if (pixel && this.aiming) this.focusOn(pixel);
  }

  /** Pixels of the picture that the host has, which may be a coarse one. */
  private inPicture({ x, y }: Place): Place {
    const [rows, columns] = this.shape;
    const [there, across] = this.bench.picture?.about.shape ?? [rows, columns];
    return { x: Math.floor(((x + 0.5) * across) / columns), y: Math.floor(((y + 0.5) * there) / rows) };
  }

  private focusOn(pixel: Place): void {
    this.bench.act({ do: "focus", ...this.inPicture(pixel) });
  }

  private point(pixel: Place | null): void {
    if (pixel?.x === this.at?.x && pixel?.y === this.at?.y) return;
    this.at = pixel;
    if (pixel && this.bench.picture && !this.bench.picture.about.coarse) this.bench.question("value", pixel);
  }

  private key(event: KeyboardEvent): void {
    const [rows, columns] = this.shape;
    const arrow = { ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, -1], ArrowDown: [0, 1] }[event.key];
    if (arrow && !event.ctrlKey && !event.metaKey) {
      const by = event.shiftKey ? 10 : 1;
      const from = this.at ?? { x: Math.floor(columns / 2), y: Math.floor(rows / 2) };
      const x = Math.min(Math.max(from.x + arrow[0]! * by, 0), columns - 1);
      const y = Math.min(Math.max(from.y + arrow[1]! * by, 0), rows - 1);
      this.point({ x, y });
      if (this.zoom > 1) {
        this.middle = { x: (x + 0.5) / columns, y: (y + 0.5) / rows };
        this.keepWithin();
      }
      if (this.line && this.measures && this.gesture === null) {
        this.line = [this.line[0], { x, y }];
        this.askProfile();
      }
    } else if (event.key === "p") this.measure(this.at);
    else if (event.key === "+" || event.key === "=") this.zoomTo(this.zoom * 1.5);
    else if (event.key === "-") this.zoomTo(this.zoom / 1.5);
    else if (event.key === "0") this.zoomTo(1);
    else if (event.key === "Enter" && this.at) this.focusOn(this.at);
    else return;
    event.preventDefault();
  }

  /** Begin or end reading along lines; by keys a line begins at the pixel that is pointed at, and follows it. */
  private measure(from: Place | null = null): void {
    this.measures = !this.measures;
    this.line = this.measures && from ? [from, from] : null;
    this.aiming = false;
  }

  private askProfile(): void {
    const about = this.bench.picture?.about;
    if (!this.line || !about || about.coarse || this.bench.look.photodiodes === "apart") return;
    const [one, other] = this.line;
    if (one.x !== other.x || one.y !== other.y) this.bench.question("profile", { ends: [one.x, one.y, other.x, other.y] });
  }

  private saveAsShown(): void {
    this.canvas.toBlob((blob) => {
      if (blob) saved("as-shown.png", blob);
    });
  }

  // --- drawing ---

  /** What the pixel that is pointed at holds in a new picture. */
  private askAgain(): void {
    const about = this.bench.picture?.about;
    if (about === this.asked || !about || about.coarse) return;
    this.asked = about;
    if (this.at) this.bench.question("value", this.at);
    this.askProfile();
  }

  protected override updated(): void {
    this.askAgain();
    const { canvas } = this;
    const sharp = window.devicePixelRatio || 1;
    const { bench } = this;
    const now = bench.frames?.bitmaps[Math.min(this.frame, bench.frames.bitmaps.length - 1)] ?? bench.picture?.bitmap;
    const pinned = bench.pinned;
    const shows = [
      now, pinned, this.mode, this.wipe, this.width, this.height, sharp, ...this.shape, this.unit, this.middle.x, this.middle.y,
      this.at?.x, this.at?.y, this.matchesFocus(), this.line?.[0].x, this.line?.[0].y, this.line?.[1].x, this.line?.[1].y,
    ];
    if (shows.every((each, number) => each === this.drawn[number])) return;
    this.drawn = shows;
    const [wide, high] = [Math.round(this.width * sharp), Math.round(this.height * sharp)];
    if (canvas.width !== wide || canvas.height !== high) [canvas.width, canvas.height] = [wide, high];
    const context = canvas.getContext("2d")!;
    context.setTransform(1, 0, 0, 1, 0, 0);
    context.clearRect(0, 0, wide, high);
    context.setTransform(sharp, 0, 0, sharp, 0, 0);
    if (!now || !this.width) return;
    const { width, height, shape, unit, paneWidth, wipe } = this;
    drawPictures(context, this.mode, now, pinned, { width, height, shape, unit, paneWidth, wipe, corner: this.corner(), moving: bench.picture?.about.moving ?? false });
    if (this.line) this.drawLine(context, this.line);
    if (this.at && (this.unit >= OUTLINED || this.matchesFocus())) this.outline(context, this.at);
  }

  private drawLine(context: CanvasRenderingContext2D, ends: [Place, Place]): void {
    const corner = this.corner();
    const [from, to] = ends.map(({ x, y }) => [corner.x + (x + 0.5) * this.unit, corner.y + (y + 0.5) * this.unit] as const) as [readonly [number, number], readonly [number, number]];
    for (const [width, style] of [[3, "rgb(0 0 0 / 60%)"], [1.5, "#fff"]] as const) {
      context.lineWidth = width;
      context.strokeStyle = style;
      context.beginPath();
      context.moveTo(...from);
      context.lineTo(...to);
      context.stroke();
    }
  }

  private matchesFocus(): boolean {
    return this.canvas.matches(":focus-visible");
  }

  private outline(context: CanvasRenderingContext2D, { x, y }: Place): void {
    const corner = this.corner();
    const size = Math.max(this.unit, 5);
    const spare = (size - this.unit) / 2;
    for (const left of this.mode === "beside" ? [0, this.paneWidth] : [0]) {
      const at: [number, number] = [left + corner.x + x * this.unit - spare, corner.y + y * this.unit - spare];
      context.lineWidth = 3;
      context.strokeStyle = "rgb(0 0 0 / 60%)";
      context.strokeRect(...at, size, size);
      context.lineWidth = 1.5;
      context.strokeStyle = "#fff";
      context.strokeRect(...at, size, size);
    }
  }

  override render() {
    const { bench } = this;
    const about = bench.picture?.about;
    return html`
      <div class="bar" role="toolbar" aria-label="Picture">
        <div class="group">
          <button class="icon" title="Smaller (−)" aria-label="Zoom out" ?disabled=${this.zoom <= 1} @click=${() => this.zoomTo(this.zoom / 1.5)}>${sign("minus")}</button>
          <button class="icon" title="Larger (+)" aria-label="Zoom in" @click=${() => this.zoomTo(this.zoom * 1.5)}>${sign("plus")}</button>
          <button class="icon" title="All of it (0)" aria-label="The whole picture" @click=${() => this.zoomTo(1)}>${sign("whole")}</button>
        </div>
        <button aria-pressed=${this.aiming} aria-label="Click to focus" title="Click into the picture to focus there: the sensor moves" @click=${() => (this.aiming = !this.aiming)}>${sign("aim")}<span class="short">Focus</span><span class="long">Click to focus</span></button>
        ${this.exposure()}
        <label class="check" title="Noise of the sensor's electronics"><input type="checkbox" .checked=${bench.document?.noise ?? false}
          @change=${(event: Event) => bench.set(["noise"], (event.target as HTMLInputElement).checked)}>Noise</label>
        <span class="spring"></span>
        <div class="group">
          <button class="icon" aria-pressed=${this.levels} title="Histogram, black and white, channels" aria-label="Levels" @click=${() => (this.levels = !this.levels)}>${sign("bars")}</button>
          <button class="icon" aria-pressed=${this.measures} title="Draw a line to read the image along it (p)" aria-label="Profile along a line" @click=${() => this.measure()}>${sign("line")}</button>
          <button class="icon" title="Download as shown (PNG)" aria-label="Download as shown" ?disabled=${!about} @click=${() => this.saveAsShown()}>${sign("save")}</button>
        </div>
        <button ?disabled=${!about} title="Keep this state to compare others with" @click=${() => this.pin()}>${sign("pin")}Pin</button>
        ${bench.pinned ? html`<select aria-label="Compare with the pinned picture" .value=${this.compare}
          @change=${(event: Event) => (this.compare = (event.target as HTMLSelectElement).value as Compare)}>
          ${MODES.map(([mode, words]) => html`<option value=${mode} ?selected=${mode === this.compare}>${words}</option>`)}</select>` : nothing}
      </div>
      <div class="stage">
        <canvas ?data-aiming=${this.aiming} tabindex="0" role="application"
          aria-label="The picture. Arrow keys move over its pixels, Enter focuses on one, p begins a profile, plus, minus and 0 zoom."
          @pointerdown=${this.down} @pointermove=${this.move} @pointerup=${this.up} @pointercancel=${this.up}
          @pointerleave=${() => this.point(null)} @dblclick=${() => this.zoomTo(this.zoom > 1 ? 1 : 8)}
          @focus=${() => this.requestUpdate()} @blur=${() => this.requestUpdate()} @keydown=${this.key}></canvas>
        ${this.bench.without ? html`<p class="without">${this.bench.without}</p>` : this.captions()}
        ${this.levels ? html`<vcc-bench-levels class="panel" .bench=${bench}></vcc-bench-levels>` : nothing}
        ${this.profile()}
        ${bench.frames ? this.scrubbing() : nothing}
        ${this.mode === "wipe" ? html`<input type="range" class="wipe" min="0" max="1" step="0.01" aria-label="Place of the wipe" .value=${String(this.wipe)}
          @input=${(event: Event) => (this.wipe = Number((event.target as HTMLInputElement).value))}>` : nothing}
      </div>
      ${bench.pins.length ? html`<vcc-bench-pins .bench=${bench}></vcc-bench-pins>` : nothing}
      <div class="line ${bench.document?.noise ? "two" : ""}">${this.reading()}<span class="spring"></span>${this.state()}</div>`;
  }

  private pin(): void {
    this.bench.pin();
    if (this.compare === "alone") this.compare = "wipe";
  }

  /** Irradiance along the line, once it is known. */
  private profile() {
    const answer = this.bench.answers.get("profile")?.message;
    if (!this.measures) return nothing;
    if (!this.line || answer?.what !== "profile") return html`<p class="panel right quiet">Draw a line over the picture.</p>`;
    const names = answer.values.length === 3 ? ["red", "green", "blue"] : answer.values.map(() => "grey");
    const most = Math.max(...answer.values.flat(), 1e-12);
    const length = answer.places.at(-1) ?? 1;
    const curves = answer.values.map((values, channel) => ({ name: names[channel]!, points: values.map((value, at): [number, number] => [answer.places[at]! * 1e3, value]) }));
    return html`<div class="panel right plot">${plotted(curves, {
      width: 300, height: 150, most: [length * 1e3, most], words: "mm along the line on the sensor", label: `Irradiance along a line of ${short(length, 4)}`,
    })}</div>`;
  }

  /** A sweep, gone through by hand. */
  private scrubbing() {
    const { values, label } = this.bench.frames!;
    const at = Math.min(this.frame, values.length - 1);
    return html`<div class="scrub panel"><label>${label} ${values[at]}
      <input type="range" min="0" max=${values.length - 1} .value=${String(at)} aria-label="Frame of the sweep" aria-valuetext="${label} ${values[at]}"
        @input=${(event: Event) => (this.frame = Number((event.target as HTMLInputElement).value))}></label>
      <button @click=${() => { this.frame = 0; this.bench.endScrub(); }}>Close</button></div>`;
  }

  private exposure() {
    const { bench } = this;
    const fixed = bench.document?.exposure ?? null;
    const white = bench.picture?.about.white ?? 0;
    return html`<div class="group">
      <label class="check" title="Brightness is kept as it is now, so that it does not jump"><input type="checkbox" aria-label="Fix exposure" .checked=${fixed !== null}
        @change=${(event: Event) => bench.set(["exposure"], (event.target as HTMLInputElement).checked ? white : null)}><span class="long">Fix exposure</span><span class="short">Exposure</span></label>
      ${fixed === null ? nothing : html`
        <button class="icon" aria-label="Darker" title="Darker" @click=${() => bench.set(["exposure"], fixed * Math.SQRT2)}>${sign("minus")}</button>
        <button class="icon" aria-label="Brighter" title="Brighter" @click=${() => bench.set(["exposure"], fixed / Math.SQRT2)}>${sign("plus")}</button>`}
    </div>`;
  }

  private captions() {
    const psnr = this.bench.picture?.about.psnr;
    const words = this.bench.picture?.about.same ? "the same" : psnr === null || psnr === undefined ? "" : `PSNR ${plain(psnr, 3)} dB`;
    const about = this.bench.picture?.about;
    if (this.mode === "alone" && about?.look.photodiodes === "apart" && about.photodiodes[0] * about.photodiodes[1] > 1)
      return html`<span class="caption left">${about.photodiodes[0]} × ${about.photodiodes[1]} photodiodes, in their order as seen from behind the sensor</span>`;
    if (this.mode === "alone") return nothing;
    if (this.mode === "difference") return html`<span class="caption left">difference ×4${words ? ` · ${words}` : ""}</span>`;
    return html`<span class="caption left">pinned</span><span class="caption right">now${words ? ` · ${words}` : ""}</span>`;
  }

  private reading() {
    const { value } = this.bench;
    if (!this.at) return html`<span>${this.zoom > 1 ? `${plain(this.unit, 3)} : 1` : "Point at the picture to read a pixel."}</span>`;
    const same = value && value.x === this.at.x && value.y === this.at.y;
    const numbers = same ? value.irradiance.map((each) => plain(each, 4)).join("  ") : "…";
    const recorded = same && value.recorded ? ` · DN ${value.recorded.map((each) => plain(each, 6)).join("  ")}` : "";
    const place = same ? ` · x ${short(value.place[0], 4)}, y ${short(value.place[1], 4)}` : "";
    return html`<span role="status">column ${this.at.x}, row ${this.at.y}${place} · ${numbers}${recorded}</span>`;
  }

  private state() {
    const about = this.bench.picture?.about;
    if (!about) return nothing;
    return html`
      ${about.missing > MISSING ? html`<span class="missing" title="Rays that the light field does not hold: pixels are darker there than they would be">${plain(100 * about.missing, 2)} % of the rays missing</span>` : nothing}
      <span>${this.shape[1]} × ${this.shape[0]}${about.coarse ? ", coarse" : ""} · ${plain(about.took, 3)} ms</span>`;
  }

  static override styles = [
    controls,
    answerStyles,
    css`
      :host { display: flex; flex-direction: column; min-height: 0; min-width: 0; container-type: inline-size; }
      .short { display: none; }
      .bar { display: flex; flex-wrap: wrap; align-items: center; gap: 2px 8px; padding: 6px 8px; }
      .group { display: flex; align-items: center; gap: 2px; }
      .group + label.check { margin-left: 6px; }
      .spring { flex: 1; }
      .bar select { flex: none; width: auto; }
      .stage { position: relative; flex: 1; min-height: 0; background: var(--stage); overflow: hidden; }
      canvas { position: absolute; inset: 0; width: 100%; height: 100%; touch-action: none; cursor: crosshair; }
      canvas[data-aiming] { cursor: cell; }
      canvas:focus-visible { outline-offset: -2px; }
      .without { position: absolute; left: 10%; right: 10%; top: 40%; margin: 0; padding: 12px 16px; border-radius: 8px; background: var(--error-ground); white-space: pre-line; overflow-wrap: anywhere; }
      .panel { position: absolute; left: 8px; bottom: 8px; margin: 0; border-radius: 8px; border: 1px solid var(--line); background: color-mix(in srgb, var(--ground) 92%, transparent); box-shadow: 0 4px 16px rgb(0 0 0 / 18%); z-index: 1; }
      .panel.right { left: auto; right: 8px; }
      p.panel { padding: 6px 10px; }
      .plot { width: min(316px, 80%); padding: 4px 8px; }
      .scrub { left: 8px; right: 8px; display: flex; align-items: center; gap: 8px; padding: 6px 10px; }
      .scrub label { flex: 1; display: flex; align-items: center; gap: 10px; white-space: nowrap; }
      .scrub input { flex: 1; accent-color: var(--accent); min-width: 60px; }
      .caption { position: absolute; top: 8px; padding: 2px 8px; border-radius: 4px; background: rgb(0 0 0 / 62%); color: #fff; font-size: 12px; pointer-events: none; }
      .caption.left { left: 8px; } .caption.right { right: 8px; }
      /* The line itself is dragged; the slider is there for keys, and seen when they are on it. */
      .wipe { position: absolute; left: 0; right: 0; bottom: 6px; width: 100%; margin: 0; accent-color: var(--accent); pointer-events: none; opacity: 0; }
      .wipe:focus-visible { opacity: 1; }
      canvas.wiping { cursor: ew-resize; }
      .line { display: flex; gap: 14px; height: 26px; align-items: center; padding: 0 10px; font-size: 12px; line-height: 1.3; color: var(--quiet); }
      .line > span { white-space: nowrap; }
      .line > [role="status"] { white-space: pre-wrap; }
      .line.two { height: 40px; }
      .line > .missing { color: var(--warn-ink); }
      @container (max-width: 640px) { .line { height: 40px; } .line.two { height: 56px; } }
      @container (max-width: 740px) { .short { display: inline; } .long { display: none; } }
      @container (max-width: 540px) { .bar { gap: 2px; padding: 6px 4px; } button { padding: 0 6px; } label.check { gap: 5px; } .icon { width: 26px; padding: 0; } }
    `,
  ];
}

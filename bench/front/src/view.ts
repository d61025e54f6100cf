/** The whole bench: what is opened and kept above, the side and its parts, the picture. */

import { html, css, nothing } from "lit";

import { Part, controls, named } from "./part";
import { APERTURE, EditorView } from "./editor";
import { PictureView } from "./picture";
import { SideView } from "./side";
import { DecodedView, foldsViews } from "./decoded";
import { OF_A_POINT, OF_PLANES, QUESTIONS, answerStyles, drawnAnswer } from "./answers";
import { sign } from "./signs";
import { inMillimetres, metres, plain, split, withUnit } from "./numbers";
import type { Answer } from "./bench";
import type { Table, Where } from "./protocol";

type Beside = "parts" | "notes" | string;

/** What can be taken away, and how the menu calls it. */
const EXPORTS: [string, string][] = [
  ["toml", "Camera file (TOML)"],
  ["python", "Python program of this picture"],
  ["png", "Picture (PNG)"],
  ["exr", "Picture (OpenEXR, linear)"],
];

export class BenchView extends Part {
  static override properties = { ...Part.properties, beside: { state: true }, film: { state: true } };
  declare beside: Beside;
  /** Which number is to be swept in a film, while that is asked for. */
  declare film: string | null;
  /** Of the point whose picture is asked for; empty for the one in focus. */
  private distance = "";
  /** Of phase space; empty for each plane of the camera. */
  private plane = "";
  /** While an answer is under way nothing else is asked; the newest question is asked when it has come. */
  private underway: { what: string; before: Answer | undefined } | null = null;
  private askNext = false;
  private askedFor = "";
  private askTimer = 0;

  constructor() {
    super();
    this.beside = "parts";
    this.film = null;
  }

  override connectedCallback(): void {
    super.connectedCallback();
    this.bench.addEventListener("change", this.keepAnswer);
    this.addEventListener("keydown", this.key);
    // On a page of its own the bench undoes wherever the focus is.
    if (this.bench.options.address) window.addEventListener("keydown", this.keyOutside);
    this.addEventListener("type-place", this.typePlace);
    this.addEventListener("show-notes", this.showNotes);
  }

  override disconnectedCallback(): void {
    super.disconnectedCallback();
    this.bench.removeEventListener("change", this.keepAnswer);
    window.removeEventListener("keydown", this.keyOutside);
    window.clearTimeout(this.askTimer);
  }

  private readonly keyOutside = (event: KeyboardEvent) => {
    if (event.target === document.body) this.key(event);
  };

  private readonly typePlace = () => {
    this.beside = "parts";
    void this.updateComplete.then(() => this.renderRoot.querySelector<EditorView>("vcc-bench-editor")?.typePlace());
  };

  private readonly showNotes = () => {
    this.beside = "parts";
  };

  private readonly key = (event: KeyboardEvent) => {
    if (!(event.ctrlKey || event.metaKey) || event.altKey) return;
    const letter = event.key.toLowerCase();
    // In a field in which one is typing the browser's own undo is meant.
    const typing = event.composedPath().some((each) => each instanceof HTMLElement && each.matches("[data-edited]"));
    if (typing || (letter !== "z" && letter !== "y")) return;
    event.preventDefault();
    event.stopPropagation();
    this.bench.act({ do: letter === "y" || event.shiftKey ? "redo" : "undo" });
  };

  // --- what is answered beside the parts ---

  private show(beside: Beside): void {
    this.beside = beside;
    this.askedFor = "";
    this.keepAnswer();
  }

  /** An answer that is open follows the camera, when it rests. */
  private readonly keepAnswer = () => {
    const { underway } = this;
    if (underway && (this.bench.answers.get(underway.what) !== underway.before || this.bench.refused || !this.bench.open)) {
      this.underway = null;
      if (this.askNext) this.askAgain();
    }
    if (this.beside === "parts" || this.beside === "notes" || !this.bench.document) return;
    const about = `${this.beside} ${this.bench.turn} ${JSON.stringify(this.bench.document)}`;
    if (about === this.askedFor) return;
    const first = this.askedFor === "";
    const end = metres(this.bench.document.camera.sensor["z"]);
    // A sensor that comes nearer takes the plane with it.
    if (!first && metres(withUnit(this.plane, null, "mm")) > end) this.plane = inMillimetres(end);
    this.askedFor = about;
    window.clearTimeout(this.askTimer);
    this.askTimer = window.setTimeout(() => this.askAgain(), first ? 0 : 300);
  };

  private askAgain(): void {
    if (this.beside === "parts" || this.beside === "notes") return;
    if (this.beside === "decoded") {
      const distance = this.renderRoot.querySelector<DecodedView>("vcc-bench-decoded")?.distance;
      this.bench.question("decoded", distance ? { distance } : {});
      return;
    }
    this.askNext = this.underway !== null;
    if (this.askNext) return;
    this.underway = { what: this.beside, before: this.bench.answers.get(this.beside) };
    const distance = this.distance.trim();
    const plane = this.plane.trim();
    if (OF_A_POINT.includes(this.beside) && distance) this.bench.question(this.beside, { distance: withUnit(distance, null, "m") });
    else if (this.beside === OF_PLANES && plane) this.bench.question(this.beside, { z: withUnit(plane, null, "mm") });
    else this.bench.question(this.beside);
  }

  private showPlane(words: string): void {
    this.plane = words.trim() && withUnit(words, this.plane, "mm");
    this.bench.forgive();
    this.askAgain();
  }

  /** Which plane of phase space is shown: typed, or taken along the axis. */
  private planeField() {
    const sensor = this.bench.side?.sensor.z ?? 0;
    const typed = metres(withUnit(this.plane.trim(), null, "mm"));
    return html`<div class="distance"><label>plane at <input type="text" placeholder="each plane" .value=${this.plane}
        @change=${(event: Event) => this.showPlane((event.target as HTMLInputElement).value)}></label>
      <input type="range" aria-label="Plane along the axis" min="0" max="1000" step="1" .value=${String(Number.isFinite(typed) && sensor > 0 ? (typed / sensor) * 1000 : 0)}
        aria-valuetext=${this.plane.trim() || "each plane"}
        @input=${(event: Event) => this.showPlane(inMillimetres(Number(((Number((event.target as HTMLInputElement).value) / 1000) * sensor).toPrecision(4))))}>
      <button ?disabled=${!this.plane.trim()} @click=${() => this.showPlane("")}>Each plane</button></div>`;
  }

  // --- drawing ---

  override render() {
    const { bench } = this;
    return html`
      <header>
        <h1>vcc bench</h1>
        <div class="group">
          <button class="icon" title="Undo (Ctrl+Z)" aria-label="Undo" ?disabled=${!bench.canUndo} @click=${() => bench.act({ do: "undo" })}>${sign("undo")}</button>
          <button class="icon" title="Redo (Ctrl+Shift+Z)" aria-label="Redo" ?disabled=${!bench.canRedo} @click=${() => bench.act({ do: "redo" })}>${sign("redo")}</button>
        </div>
        ${bench.side && !bench.canUndo && !bench.canRedo ? html`<span class="quiet hint">Drag the sensor, or what stands before it.</span>` : nothing}
        <span class="spring"></span>
        ${bench.parts ? [this.opening(), this.keeping()] : nothing}
      </header>
      ${this.banner()}
      <section class="bench" aria-label="Optical bench">
        <vcc-bench-side .bench=${bench}></vcc-bench-side>
      </section>
      <section class="picture" aria-label="Picture" aria-busy=${bench.waiting || !bench.picture}><vcc-bench-picture .bench=${bench}></vcc-bench-picture></section>
      <section class="beside" aria-label="Parts and answers">
        ${this.tabs()}
        ${this.pane()}
      </section>
      <div class="toasts" role="status" aria-live="polite">${this.toasts()}</div>`;
  }

  private banner() {
    const { bench } = this;
    if (bench.open) return nothing;
    return html`<div class="banner" role="alert">${bench.absent}</div>`;
  }

  private tabs() {
    const { bench } = this;
    const tabs: [Beside, string][] = [
      ["parts", "Parts"],
      ["notes", bench.notes.length ? `Notes ${bench.notes.length}` : "Notes"],
      ...QUESTIONS,
    ];
    if (foldsViews(bench.document) || this.beside === "decoded") tabs.push(["decoded", "Decoded"]);
    return html`<div class="tabs" role="tablist" aria-label="Beside the picture" @keydown=${(event: KeyboardEvent) => {
        const by = { ArrowRight: 1, ArrowLeft: -1 }[event.key];
        if (!by) return;
        const at = tabs.findIndex(([name]) => name === this.beside);
        this.show(tabs[(at + by + tabs.length) % tabs.length]![0]);
        void this.updateComplete.then(() => this.renderRoot.querySelector<HTMLElement>('.tabs [aria-selected="true"]')?.focus());
      }}>
      ${tabs.map(([name, words]) => html`<button role="tab" id="beside-${name.replaceAll(" ", "-")}" aria-selected=${this.beside === name} aria-controls="pane"
        tabindex=${this.beside === name ? 0 : -1} @click=${() => this.show(name)}>${words}</button>`)}
    </div>`;
  }

  private pane() {
    const { bench } = this;
    const label = `beside-${this.beside.replaceAll(" ", "-")}`;
    if (this.beside === "parts")
      return html`<div id="pane" class="pane" role="tabpanel" aria-labelledby=${label}><vcc-bench-editor .bench=${bench}></vcc-bench-editor></div>`;
    if (this.beside === "notes")
      return html`<div id="pane" class="pane text" role="tabpanel" aria-labelledby=${label} tabindex="0">
        ${bench.side?.words.map((words) => html`<p>${words}</p>`)}
        ${bench.notes.length ? nothing : html`<p class="quiet">Nothing to note: no ray misses, and nothing is too fine for the light field or the sensor.</p>`}
        ${bench.notes.map((note) => html`<p class="advice">${note.element === null ? nothing : html`<button class="link" @click=${() => bench.select(note.element!)}>${bench.partOf(note.element)?.label[0] ?? ""}</button>`}${note.words}</p>`)}</div>`;
    if (this.beside === "decoded")
      return html`<div id="pane" class="pane text" role="tabpanel" aria-labelledby=${label} tabindex="0" aria-busy=${bench.decoding || !bench.decoded}>
        <vcc-bench-decoded .bench=${bench}></vcc-bench-decoded></div>`;
    const answer = bench.answers.get(this.beside);
    return html`<div id="pane" class="pane text answer" role="tabpanel" aria-labelledby=${label} tabindex="0" aria-busy=${!answer}>
      ${OF_A_POINT.includes(this.beside) ? html`<label class="distance">point at <input type="text" placeholder="in focus" .value=${this.distance}
        @change=${(event: Event) => {
          this.distance = (event.target as HTMLInputElement).value;
          this.askAgain();
        }}></label>` : nothing}
      ${this.beside === OF_PLANES ? this.planeField() : nothing}
      ${answer ? drawnAnswer(answer) : html`<p class="quiet">…</p>`}</div>`;
  }

  private toasts() {
    const { bench } = this;
    const { progress, refused } = bench;
    return html`
      ${refused && !this.saidAtField(refused.where) ? html`<div class="toast error"><span>${refused.words}</span><button @click=${() => bench.forgive()}>Close</button></div>` : nothing}
      ${progress ? html`<div class="toast"><span>${progress.words}</span><progress aria-label=${progress.words} max=${progress.total} value=${progress.done}></progress></div>` : nothing}`;
  }

  /** Whether the field that was refused is shown, and says so itself. */
  private saidAtField(where: Where | null): boolean {
    const { selected } = this.bench;
    if (!where || this.beside !== "parts") return false;
    const whole = this.bench.whereOf(selected);
    return whole.every((step, at) => where[at] === step) && where.length > whole.length;
  }

  // --- menus ---

  private opening() {
    const { bench } = this;
    return this.menu("Open", html`
      <button data-item @click=${(event: Event) => ((event.currentTarget as Element).nextElementSibling as HTMLInputElement).click()}>Camera file …</button>
      <input type="file" hidden accept=".toml" aria-label="Camera file" @change=${(event: Event) => void this.load(event.target as HTMLInputElement)}>
      ${bench.parts!.gallery.length ? html`<hr>` : nothing}
      ${bench.parts!.gallery.map((each) => html`<button data-item @click=${() => bench.act({ do: "load", gallery: each })}>${each}</button>`)}`);
  }

  private async load(input: HTMLInputElement): Promise<void> {
    const file = input.files?.[0];
    if (file) this.bench.act({ do: "load", toml: await file.text() });
    input.value = "";
  }

  private keeping() {
    return this.menu("Export", html`
      ${EXPORTS.map(([what, words]) => html`<button data-item @click=${() => this.bench.export(what)}>${words}</button>`)}
      <hr><button data-item data-stays aria-expanded=${this.film !== null} @click=${() => (this.film = this.film === null ? "z" : null)}>Film of a sweep …</button>
      ${this.film === null ? nothing : this.filming(this.film)}`);
  }

  /** A sweep of a number of what is selected, between two values about the present one. */
  private filming(name: string) {
    const { bench } = this;
    const { selected } = bench;
    const table: Table = selected === "light field" ? bench.document!.aperture : selected === "sensor" ? bench.document!.camera.sensor : (bench.elements[selected] ?? {});
    const kind = bench.parts!.kinds.find((each) => each.kind === table["kind"]);
    const all = (selected === "light field" ? APERTURE : selected === "sensor" ? bench.parts!.sensor : (kind?.parameters ?? [])).filter(
      (each) => each.takes.includes("number") && split(String(table[each.name] ?? "")) !== null,
    );
    const chosen = all.find((each) => each.name === name) ?? all[0];
    const label = bench.partOf(selected)?.label[0] ?? "";
    if (!chosen) return html`<p class="quiet">${label} has no number to be swept.</p>`;
    const value = split(String(table[chosen.name]))!;
    const around = chosen.name === "z" ? 1e-3 / metres(`1 ${value.unit}`) : 0.2 * Math.abs(value.number);
    const end = (side: number) => `${plain(value.number + side * around, 5)} ${value.unit}`.trim();
    const typed = (given: FormData, field: string) => {
      const words = withUnit(String(given.get(field)), table[chosen.name], "");
      return chosen.unit ? words : Number(words);
    };
    return html`<form @submit=${(event: SubmitEvent) => {
        event.preventDefault();
        const form = event.target as HTMLFormElement;
        const given = new FormData(form);
        bench.export("film", {
          where: [...bench.whereOf(selected), chosen.name], from: typed(given, "from"), to: typed(given, "to"),
          frames: Number(given.get("frames")), format: given.get("format"),
        });
        form.closest("details")!.open = false;
        this.film = null;
      }}>
      <label>${label} <select name="parameter" @change=${(event: Event) => (this.film = (event.target as HTMLSelectElement).value)}>
        ${all.map((each) => html`<option value=${each.name} ?selected=${each === chosen}>${each.name.replaceAll("_", " ")}</option>`)}</select></label>
      <label>from <input type="text" name="from" .value=${end(-1)}></label>
      <label>to <input type="text" name="to" .value=${end(1)}></label>
      <label>frames <input type="number" name="frames" min="2" max="200" value="30"></label>
      <label>as <select name="format"><option value="gif">GIF</option><option value="mp4">MP4</option></select></label>
      <button class="main">Make the film</button></form>`;
  }

  private menu(words: string, items: unknown) {
    return html`<details class="menu" @keydown=${(event: KeyboardEvent) => {
        const details = event.currentTarget as HTMLDetailsElement;
        if (event.key === "Escape") {
          details.open = false;
          details.querySelector("summary")!.focus();
          event.stopPropagation();
        }
        const by = { ArrowDown: 1, ArrowUp: -1 }[event.key];
        if (!by || (event.target as Element).matches("input, select")) return;
        event.preventDefault();
        details.open = true;
        const all = [...details.querySelectorAll<HTMLElement>('[data-item]')];
        const at = all.indexOf(event.target as HTMLElement);
        all[(at + by + all.length) % all.length]?.focus();
      }}
      @focusout=${(event: FocusEvent) => {
        const details = event.currentTarget as HTMLDetailsElement;
        if (event.relatedTarget && !details.contains(event.relatedTarget as Node)) details.open = false;
      }}
      @click=${(event: Event) => {
        const details = event.currentTarget as HTMLDetailsElement;
        const item = (event.target as Element).closest('[data-item]');
        if (item && !item.matches("[data-stays]") && !item.nextElementSibling?.matches("input")) details.open = false;
      }}>
      <summary>${words}${sign("down")}</summary><div class="items">${items}</div></details>`;
  }

  static override styles = [
    controls,
    answerStyles,
    css`
      :host {
        color-scheme: var(--bench-scheme, light dark);
        --ground: light-dark(#fbfbf9, #17191b);
        --well: light-dark(#ffffff, #101213);
        --stage: light-dark(#ecece8, #0d0e0f);
        --line: light-dark(#e2e2dd, #2c3034);
        --edge: light-dark(#b5b5ae, #555b61);
        --ink: light-dark(#1c1e20, #e9e8e4);
        --quiet: light-dark(#5f6469, #a0a6ab);
        --faint: light-dark(#a9abad, #5e6469);
        --accent: light-dark(#005f99, #6cc0f5);
        --hover: light-dark(rgb(0 0 0 / 5%), rgb(255 255 255 / 7%));
        --chosen: light-dark(#e1eef7, #17354a);
        --warn: light-dark(#e0a100, #e6b422);
        --on-warn: #1c1e20;
        --warn-ink: light-dark(#7a5600, #e6b422);
        --warn-ground: light-dark(#fdf3d8, #36301c);
        --error: light-dark(#b3261e, #ff9d94);
        --error-ground: light-dark(#fdeceb, #3d1f1d);
        --glass: light-dark(#cfe6f5, #29475b);
        --glass-edge: light-dark(#4a7a9c, #7fb2d3);
        --frost: light-dark(#e4e4dd, #4b4d4b);
        --frost-edge: light-dark(#8a8a80, #a9a99c);
        --focused: light-dark(#0072b2, #56b4e9);
        --near: light-dark(#d55e00, #f0883e);
        --far: light-dark(#a5457f, #d98bb9);
        --aside: light-dark(#00805c, #2fc394);
        --arrow: url("data:image/svg+xml,%3Csvg xmlns='http://www.w3.org/2000/svg' width='8' height='6' fill='none' stroke='%23808588' stroke-width='1.5'%3E%3Cpath d='m1 1 3 3 3-3'/%3E%3C/svg%3E");
        display: grid;
        position: relative;
        width: 100%;
        height: 100%;
        min-height: 0;
        background: var(--ground);
        text-align: start;
      }
      header { grid-area: header; display: flex; align-items: center; gap: 10px; padding: 0 8px 0 14px; height: 44px; border-bottom: 1px solid var(--line); position: relative; z-index: 3; }
      h1 { margin: 0; font-size: 13px; font-weight: 600; letter-spacing: -0.01em; }
      .group { display: flex; }
      .spring { flex: 1; }
      @container (max-width: 639px) { .hint { display: none; } }
      .bench { grid-area: bench; min-height: 0; min-width: 0; display: grid; border-bottom: 1px solid var(--line); }
      .picture { grid-area: picture; min-height: 0; min-width: 0; display: grid; border-left: var(--aside-border, 1px) solid var(--line); }
      .beside { grid-area: beside; min-height: 0; min-width: 0; display: flex; flex-direction: column; }
      .tabs { display: flex; gap: 2px; padding: 6px 8px 0; overflow-x: auto; scrollbar-width: none; flex: none; border-bottom: 1px solid var(--line); }
      .tabs button { border-radius: 6px 6px 0 0; height: 30px; color: var(--quiet); }
      .tabs button[aria-selected="true"] { background: none; color: var(--ink); font-weight: 600; box-shadow: inset 0 -2px var(--accent); }
      .pane { flex: 1; min-height: 0; display: grid; }
      .pane.text { display: block; overflow: auto; padding: 10px 14px; }
      .pane p { margin: 0 0 8px; }
      .pane pre { margin: 0; font: 11.5px/1.5 ui-monospace, "SF Mono", "DejaVu Sans Mono", monospace; white-space: pre-wrap; }
      .distance { display: flex; align-items: center; gap: 8px; margin-bottom: 10px; }
      .distance label { display: flex; align-items: center; gap: 8px; white-space: nowrap; }
      .distance input[type="text"] { width: 110px; }
      .distance input[type="range"] { flex: 1 1 60px; min-width: 60px; max-width: 260px; accent-color: var(--accent); }
      .advice { padding: 7px 10px; border-radius: 6px; background: var(--warn-ground); white-space: pre-line; }
      .link { height: auto; padding: 0 6px 0 0; font-weight: 600; text-decoration: underline; text-underline-offset: 2px; }
      .banner { grid-area: banner; padding: 7px 14px; background: var(--warn-ground); border-bottom: 1px solid var(--line); }
      .menu { position: relative; }
      .items { position: absolute; right: 0; top: 32px; min-width: 210px; max-height: min(560px, 80cqh); overflow-y: auto; padding: 5px; background: var(--well); border: 1px solid var(--line); border-radius: 8px; box-shadow: 0 6px 24px rgb(0 0 0 / 14%); display: grid; }
      .items button { justify-content: start; }
      @container (max-width: 699px) {
        .menu { position: static; }
        .items { top: 40px; right: 8px; max-width: calc(100cqw - 16px); }
        .items button { height: auto; min-height: 28px; padding-block: 4px; white-space: normal; text-align: start; }
      }
      .items hr { width: 100%; border: 0; border-top: 1px solid var(--line); margin: 4px 0; }
      .items form { display: grid; gap: 6px; padding: 6px 9px; }
      .items form label { display: grid; grid-template-columns: 84px 1fr; align-items: center; overflow-wrap: anywhere; line-height: 1.2; }
      .items form select { border: 1px solid var(--line); background-color: var(--well); }
      .items .main { background: var(--accent); color: var(--ground); justify-content: center; }
      .toasts { position: absolute; left: 50%; bottom: 36px; translate: -50%; display: grid; gap: 8px; width: min(560px, 92%); pointer-events: none; z-index: 4; }
      .toast { display: flex; align-items: center; justify-content: space-between; gap: 12px; padding: 8px 8px 8px 14px; border-radius: 8px; border: 1px solid var(--line); background: var(--well); box-shadow: 0 6px 24px rgb(0 0 0 / 14%); pointer-events: auto; overflow-wrap: anywhere; }
      .toast.error { background: var(--error-ground); }
    `,
  ];
}

/** The frame in which a bench stands; its grid follows the width that it has, in a page or a cell. */
export class BenchFrame extends Part {
  override render() {
    return html`<vcc-bench-view .bench=${this.bench}></vcc-bench-view>`;
  }

  static override styles = css`
    /* Nothing of the page's type is inherited: a notebook's cell may have any. */
    :host { all: initial; display: block; width: 100%; height: 100%; container-type: size; overflow: auto; }
    vcc-bench-view { grid-template: "header header" auto "banner banner" auto "bench picture" minmax(180px, 44fr) "beside picture" 56fr / minmax(0, 46fr) minmax(0, 54fr); }
    @container (max-width: 639px) {
      vcc-bench-view { --aside-border: 0px; height: auto; min-height: 100%; grid-template: "header" auto "banner" auto "picture" min(112cqw, 480px) "bench" 230px "beside" minmax(320px, 1fr) / minmax(0, 1fr); }
    }
  `;
}

export function register(): void {
  named("vcc-bench-side", SideView);
  named("vcc-bench-picture", PictureView);
  named("vcc-bench-editor", EditorView);
  named("vcc-bench-decoded", DecodedView);
  named("vcc-bench-view", BenchView);
  named("vcc-bench", BenchFrame);
}

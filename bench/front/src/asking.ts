/** What is asked about the camera beside its parts: notes, explanations, phase space, images of points, decoded views. */

import { html, css, nothing } from "lit";

import { OF_A_POINT, OF_PLANES, QUESTIONS, answerStyles, drawnAnswer } from "./answers";
import { DecodedView, foldsViews } from "./decoded";
import { EditorView } from "./editor";
import { inMillimetres, metres, withUnit } from "./numbers";
import { Part, controls } from "./part";

type Beside = "parts" | "notes" | string;

export class AskingView extends Part {
  static override properties = { ...Part.properties, beside: { state: true } };
  declare beside: Beside;
  /** Of the point whose picture is asked for; empty for the one in focus. */
  private distance = "";
  /** Of phase space; empty for each plane of the camera. */
  private plane = "";
  private askedFor = "";
  private askTimer = 0;

  constructor() {
    super();
    this.beside = "parts";
  }

  override connectedCallback(): void {
    super.connectedCallback();
    this.bench.addEventListener("change", this.keepAnswer);
  }

  override disconnectedCallback(): void {
    super.disconnectedCallback();
    this.bench.removeEventListener("change", this.keepAnswer);
    window.clearTimeout(this.askTimer);
  }

  protected override watched() {
    return this.beside === "parts" ? [this.bench.notes, foldsViews(this.bench.document), this.bench.document !== null] : null;
  }

  showParts(): void {
    this.beside = "parts";
  }

  typePlace(): void {
    this.showParts();
    void this.updateComplete.then(() => this.renderRoot.querySelector<EditorView>("vcc-bench-editor")?.typePlace());
  }

  private show(beside: Beside): void {
    this.beside = beside;
    this.askedFor = "";
    this.keepAnswer();
  }

  /** An answer that is open follows the camera, when it rests. */
  private readonly keepAnswer = () => {
    if (this.beside === "parts" || this.beside === "notes" || !this.bench.document) return;
    const about = `${this.beside} ${this.bench.turn} ${JSON.stringify(this.bench.document)}`;
    if (about === this.askedFor) return;
    const first = this.askedFor === "";
    const end = this.bench.placeOf("sensor");
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
    const sensor = this.bench.placeOf("sensor");
    const typed = metres(withUnit(this.plane.trim(), null, "mm"));
    return html`<div class="distance"><label>plane at <input type="text" placeholder="each plane" .value=${this.plane}
        @change=${(event: Event) => this.showPlane((event.target as HTMLInputElement).value)}></label>
      <input type="range" aria-label="Plane along the axis" min="0" max="1000" step="1" .value=${String(Number.isFinite(typed) && sensor > 0 ? (typed / sensor) * 1000 : 0)}
        aria-valuetext=${this.plane.trim() || "each plane"}
        @input=${(event: Event) => this.showPlane(inMillimetres(Number(((Number((event.target as HTMLInputElement).value) / 1000) * sensor).toPrecision(4))))}>
      <button ?disabled=${!this.plane.trim()} @click=${() => this.showPlane("")}>Each plane</button></div>`;
  }

  override render() {
    return [this.tabs(), this.pane()];
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
      ${answer && "remark" in answer.message && answer.message.remark ? html`<p class="advice">${answer.message.remark}</p>` : nothing}
      ${answer ? drawnAnswer(answer) : html`<p class="quiet">…</p>`}</div>`;
  }

  static override styles = [
    controls,
    answerStyles,
    css`
      :host { min-height: 0; min-width: 0; display: flex; flex-direction: column; flex: 1; }
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
    `,
  ];
}

/** What stands on the bench, by name, and every parameter of what is selected. */

import { html, css, nothing } from "lit";

import type { Selected } from "./bench";
import { fields } from "./fields";
import { plain, withUnit } from "./numbers";
import { Part, controls } from "./part";
import type { Kind, Parameter, Table } from "./protocol";
import { sign } from "./signs";

/** Of the light field's aperture, as elements have them. */
export const APERTURE: Parameter[] = [
  { name: "z", words: "place of the views' plane on the axis; below 0 before the entrance plane", unit: "length", needed: false, default: "0 mm", takes: ["number"], choices: [] },
  { name: "decentre", words: "of the views: right, down", unit: "length", needed: false, default: ["0 mm", "0 mm"], takes: ["list"], choices: [] },
];

export class EditorView extends Part {
  /** Put the caret into the field of the place on the axis. */
  typePlace(): void {
    const field = this.renderRoot.querySelector<HTMLInputElement>('input[id$="-z"]');
    field?.focus();
    field?.select();
  }

  protected override watched() {
    const { document, side, notes, refused, selected, parts, views, bands } = this.bench;
    return [document, side, notes, refused, selected, parts, views, bands];
  }

  /** The name of what is selected is in sight, however many there are. */
  protected override updated(): void {
    const chips = this.renderRoot.querySelector<HTMLElement>(".chips");
    const chosen = chips?.querySelector<HTMLElement>('[aria-selected="true"]');
    if (!chips || !chosen) return;
    const from = chosen.offsetLeft - chips.offsetLeft;
    if (from < chips.scrollLeft) chips.scrollLeft = from - 8;
    else if (from + chosen.offsetWidth > chips.scrollLeft + chips.clientWidth) chips.scrollLeft = from + chosen.offsetWidth - chips.clientWidth;
  }

  private get order(): number[] {
    const side = this.bench.side;
    return this.bench.elements.map((_, number) => number).sort((one, other) => (side?.elements[one]?.z ?? 0) - (side?.elements[other]?.z ?? 0) || one - other);
  }

  private labelOf(selected: Selected): string {
    if (selected === "light field") return "light field";
    const part = this.bench.partOf(selected);
    if (part) return part.label[0] ?? "";
    return selected === "sensor" ? "sensor" : String(this.bench.elements[selected]?.["kind"] ?? "");
  }

  override render() {
    const { bench } = this;
    if (!bench.document || !bench.parts) return nothing;
    const all: Selected[] = ["light field", ...this.order, "sensor"];
    return html`
      <div class="chips" role="tablist" aria-label="What stands on the bench" @keydown=${this.key}>
        ${all.map((each) => html`<button role="tab" id="tab-${each}" aria-selected=${bench.selected === each} aria-controls="form"
          tabindex=${bench.selected === each ? 0 : -1} @click=${() => bench.select(each)}>${this.labelOf(each)}${
            bench.notesOf(each).length ? html`<i class="note" title="has a note"></i>` : nothing}</button>`)}
      </div>
      <div class="adds"><select aria-label="Add an element" @change=${this.add}>
        <option value="" selected>+ Add …</option>
        ${bench.parts.kinds.filter((kind) => kind.addable !== false).map((kind) => html`<option value=${kind.kind} title=${kind.words}>${kind.kind.replaceAll("_", " ")}</option>`)}</select></div>
      <div id="form" class="form" role="tabpanel" aria-labelledby="tab-${bench.selected}">${this.form()}</div>`;
  }

  private form() {
    const { selected } = this.bench;
    if (selected === "light field") return this.lightField();
    const table = selected === "sensor" ? this.bench.document!.camera.sensor : this.bench.elements[selected];
    const kind = selected === "sensor" ? null : this.kindOf(selected);
    const parameters = selected === "sensor" ? this.bench.parts!.sensor : kind?.parameters;
    if (!table || !parameters) return nothing;
    return html`
      <div class="head"><span class="quiet" title=${kind?.words ?? ""}>${[String(table["kind"] ?? "").replaceAll("_", " "), ...(this.bench.partOf(selected)?.label.slice(1) ?? [])].filter(Boolean).join(", ")}</span>${selected === "sensor" ? nothing : this.verbs(selected)}</div>
      ${this.bench.notesOf(selected).map((note) => html`<p class="advice">${note.words}</p>`)}
      ${fields(this.bench, parameters, table, this.bench.whereOf(selected))}`;
  }

  private kindOf(number: number): Kind | undefined {
    return this.bench.parts!.kinds.find((each) => each.kind === this.bench.elements[number]?.["kind"]);
  }

  private verbs(element: number) {
    const place = this.order.indexOf(element);
    const { bench } = this;
    return html`<span class="verbs">
      <button class="icon" title="One place towards the scene" aria-label="Move before the one before it" ?disabled=${place === 0} @click=${() => bench.act({ do: "reorder", element, by: -1 })}>${sign("earlier")}</button>
      <button class="icon" title="One place towards the sensor" aria-label="Move behind the one behind it" ?disabled=${place === this.order.length - 1} @click=${() => bench.act({ do: "reorder", element, by: 1 })}>${sign("later")}</button>
      <button class="icon" title="Duplicate" aria-label="Duplicate" @click=${() => bench.duplicate(element)}>${sign("twice")}</button>
      <button class="icon" title="Remove" aria-label="Remove" @click=${() => bench.act({ do: "remove", element })}>${sign("away")}</button>
    </span>`;
  }

  private lightField() {
    const { bench } = this;
    const document = bench.document!;
    return html`
      <div class="field"><label for="light-field">light field</label>
        <select id="light-field" @change=${(event: Event) => bench.set(["light_field"], (event.target as HTMLSelectElement).value)}>
          ${bench.parts!.light_fields.map((name) => html`<option value=${name} ?selected=${name === document.light_field}>${name}</option>`)}</select></div>
      ${bench.views ? [0, 1].map((axis) => this.viewRange(axis as 0 | 1, bench.views!)) : nothing}
      ${document.views ? html`<div class="field"><span></span><button @click=${() => bench.set(["views"], null)}>All views</button></div>` : nothing}
      <p class="quiet">Where the views stand: before the entrance plane, z = 0, or behind it, right and down of the axis.</p>
      ${fields(bench, APERTURE, document.aperture as unknown as Table, ["aperture"])}
      ${this.wavelengths()}`;
  }

  /** Of the channels: the light field's own, or others. Elements of glass need them. */
  private wavelengths() {
    const { bench } = this;
    const own = bench.bands?.map((each) => `${plain(each * 1e9, 5)} nm`).join(", ") ?? "";
    const given = bench.document!.wavelengths;
    return html`<div class="field"><label for="wavelengths" title="Of the channels; elements of glass and diffractive ones depend on them">wavelengths</label>
      <input id="wavelengths" type="text" .value=${given ? given.join(", ") : ""} placeholder=${own || "none"} @change=${(event: Event) => {
        const words = (event.target as HTMLInputElement).value.trim();
        bench.set(["wavelengths"], words ? words.split(",").map((each) => withUnit(each, null, "nm")) : null);
      }}></div>`;
  }

  /** From which to which row or column of views. */
  private viewRange(axis: 0 | 1, views: [number, number]) {
    const whole = { rows: [0, views[0] - 1] as [number, number], columns: [0, views[1] - 1] as [number, number] };
    const ranges = this.bench.document!.views ?? whole;
    const name = axis === 0 ? "rows" : "columns";
    const change = (end: 0 | 1, typed: string) => {
      const range: [number, number] = [...ranges[name]];
      range[end] = Math.min(Math.max(Math.round(Number(typed) || 0), 0), views[axis] - 1);
      if (range[0] > range[1]) range[1 - end] = range[end]!;
      this.bench.set(["views"], { ...ranges, [name]: range });
    };
    const box = (end: 0 | 1) => html`<input type="number" min="0" max=${views[axis] - 1} aria-label="${end ? "last" : "first"} of the ${name} of views"
      .value=${String(ranges[name][end])} @change=${(event: Event) => change(end, (event.target as HTMLInputElement).value)}>`;
    return html`<div class="field"><span>${name} of views</span><span class="range">${box(0)}<span class="quiet">to</span>${box(1)}<span class="quiet">of ${views[axis]}</span></span></div>`;
  }

  private add(event: Event): void {
    const select = event.target as HTMLSelectElement;
    const kind = select.value;
    select.value = "";
    if (kind) this.bench.add(kind); // the host finds a place that suits it
  }

  private key(event: KeyboardEvent): void {
    const by = { ArrowRight: 1, ArrowLeft: -1 }[event.key];
    if (!by) return;
    const all: Selected[] = ["light field", ...this.order, "sensor"];
    const next = all[(all.indexOf(this.bench.selected) + by + all.length) % all.length]!;
    this.bench.select(next);
    void this.updateComplete.then(() => this.renderRoot.querySelector<HTMLElement>(`[id="tab-${next}"]`)?.focus());
    event.preventDefault();
  }

  static override styles = [
    controls,
    css`
      :host { display: grid; grid-template-columns: 1fr auto; grid-template-rows: auto 1fr; min-height: 0; }
      .chips { display: flex; gap: 2px; overflow-x: auto; padding: 6px 0 6px 8px; scrollbar-width: none; }
      .chips button { height: 26px; position: relative; }
      .note { width: 7px; height: 7px; border-radius: 50%; background: var(--warn); }
      .adds { padding: 6px 8px 6px 4px; }
      .adds select { height: 26px; width: 92px; }
      .form { grid-column: 1 / -1; overflow-y: auto; padding: 0 12px 12px; min-height: 0; }
      .head { display: flex; align-items: center; justify-content: space-between; gap: 8px; min-height: 30px; margin-bottom: 4px; }
      .form > p.quiet { margin: 8px 0 4px; }
      .verbs { display: flex; }
      .field { display: grid; grid-template-columns: minmax(86px, 132px) minmax(0, 1fr); align-items: center; gap: 4px 10px; min-height: 34px; }
      .field > label, .field > span:first-child { color: var(--quiet); overflow-wrap: anywhere; line-height: 1.2; }
      .field > input[type="text"], .field > select, .field > .quantity { width: 100%; max-width: 260px; }
      .quantity { display: flex; align-items: center; position: relative; }
      .quantity input { flex: 1; padding-right: 42px; }
      .quantity .unit { position: absolute; right: 9px; color: var(--quiet); pointer-events: none; }
      .field > button { justify-self: start; border-color: var(--line); }
      .field output { overflow-wrap: anywhere; }
      .field:has(.cells) { align-items: start; }
      .field:has(.cells) > label { padding-top: 6px; }
      .range { display: flex; align-items: center; gap: 6px; }
      .range input { width: 56px; }
      .inner { margin-left: 6px; padding-left: 10px; border-left: 2px solid var(--line); }
      .wrong { grid-column: 2; margin: 0 0 4px; color: var(--error); font-size: 12px; }
      .advice { margin: 0 0 8px; padding: 7px 10px; border-radius: 6px; background: var(--warn-ground); font-size: 12.5px; white-space: pre-line; }
      .cells { display: grid; gap: 6px; max-width: 260px; padding: 4px 0; }
      .grid { display: grid; gap: 1px; justify-content: start; border: 1px solid var(--line); background: var(--line); width: max-content; }
      .grid i { cursor: pointer; }
      .field:has(.list) { grid-template-columns: 1fr; }
      .list { overflow-x: auto; }
      table { border-collapse: collapse; font-size: 12px; }
      th { font-weight: 400; color: var(--quiet); }
      th, td { padding: 2px 10px 2px 0; text-align: start; white-space: nowrap; }
    `,
  ];
}

/** The menus above: cameras to open, what can be exported, films of sweeps. */

import { html, css, nothing, type TemplateResult } from "lit";

import { APERTURE } from "./editor";
import { metres, plain, shortened, split, withUnit } from "./numbers";
import { Part, controls } from "./part";
import type { Table } from "./protocol";
import { sign } from "./signs";

/** What can be taken away, and how the menu calls it. */
const EXPORTS: [string, string][] = [
  ["toml", "Camera file (TOML)"],
  ["python", "Python program of this picture"],
  ["png", "Picture (PNG)"],
  ["exr", "Picture (OpenEXR, linear)"],
];

export class MenusView extends Part {
  static override properties = { ...Part.properties, film: { state: true } };
  /** Which number is to be swept in a film, while that is asked for. */
  declare film: string | null;

  constructor() {
    super();
    this.film = null;
  }

  protected override watched() {
    return this.film === null ? [this.bench.parts] : null;
  }

  override render() {
    return this.bench.parts ? [this.opening(), this.keeping()] : nothing;
  }

  private opening() {
    const { bench } = this;
    const { presets, gallery } = bench.parts!;
    return this.menu("Open", html`
      ${presets.length ? html`<div class="presets">${presets.map(({ title, label, words }, number) => html`<button data-item class="preset" @click=${() => bench.act({ do: "load", gallery: title })}>
        <img src=${bench.thumbnails[number] ?? ""} alt=""><span>${label}</span><span class="quiet">${words}</span></button>`)}</div><hr>` : nothing}
      <button data-item @click=${(event: Event) => ((event.currentTarget as Element).nextElementSibling as HTMLInputElement).click()}>Camera file …</button>
      <input type="file" hidden accept=".toml" aria-label="Camera file" @change=${(event: Event) => void this.load(event.target as HTMLInputElement)}>
      ${gallery.length ? html`<hr>` : nothing}
      ${gallery.map((each) => html`<button data-item @click=${() => bench.act({ do: "load", gallery: each })}>${each}</button>`)}`);
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
    const table: Table = bench.tableOf(selected) ?? {};
    const kind = bench.parts!.kinds.find((each) => each.kind === table["kind"]);
    const all = (selected === "light field" ? APERTURE : selected === "sensor" ? bench.parts!.sensor : (kind?.parameters ?? [])).filter(
      (each) => each.takes.includes("number") && split(String(table[each.name] ?? "")) !== null,
    );
    const chosen = all.find((each) => each.name === name) ?? all[0];
    const label = bench.partOf(selected)?.label[0] ?? "";
    if (!chosen) return html`<p class="quiet">${label} has no number to be swept.</p>`;
    const value = split(String(table[chosen.name]))!;
    const around = chosen.name === "z" ? 1e-3 / metres(`1 ${value.unit}`) : 0.2 * Math.abs(value.number);
    const end = (side: number) => shortened(`${plain(value.number + side * around, 5)} ${value.unit}`.trim());
    const typed = (given: FormData, field: string) => {
      const words = withUnit(String(given.get(field)), table[chosen.name], "");
      return chosen.unit ? words : Number(words);
    };
    return html`<form @submit=${(event: SubmitEvent) => {
        event.preventDefault();
        const form = event.target as HTMLFormElement;
        const given = new FormData(form);
        const sweep = { where: [...bench.whereOf(selected), chosen.name], from: typed(given, "from"), to: typed(given, "to"), frames: Number(given.get("frames")) };
        if ((event.submitter as HTMLButtonElement | null)?.value === "scrub") bench.scrub(sweep);
        else bench.export("film", { ...sweep, format: given.get("format") });
        form.closest("details")!.open = false;
        this.film = null;
      }}>
      <label>${label} <select name="parameter" @change=${(event: Event) => (this.film = (event.target as HTMLSelectElement).value)}>
        ${all.map((each) => html`<option value=${each.name} ?selected=${each === chosen}>${each.name.replaceAll("_", " ")}</option>`)}</select></label>
      <label>from <input type="text" name="from" .value=${end(-1)}></label>
      <label>to <input type="text" name="to" .value=${end(1)}></label>
      <label>frames <input type="number" name="frames" min="2" max="200" value="30"></label>
      <label>as <select name="format"><option value="gif">GIF</option><option value="mp4">MP4</option></select></label>
      <button class="main" value="film">Make the film</button>
      <button class="other" value="scrub" title="Make its images and go through them with a slider">Scrub by hand</button></form>`;
  }

  private menu(words: string, items: TemplateResult) {
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
        const all = [...details.querySelectorAll<HTMLElement>("[data-item]")];
        const at = all.indexOf(event.target as HTMLElement);
        all[(at + by + all.length) % all.length]?.focus();
      }}
      @focusout=${(event: FocusEvent) => {
        const details = event.currentTarget as HTMLDetailsElement;
        if (event.relatedTarget && !details.contains(event.relatedTarget as Node)) details.open = false;
      }}
      @click=${(event: Event) => {
        const details = event.currentTarget as HTMLDetailsElement;
        const item = (event.target as Element).closest("[data-item]");
        if (item && !item.matches("[data-stays]") && !item.nextElementSibling?.matches("input")) details.open = false;
      }}>
      <summary>${words}${sign("down")}</summary><div class="items">${items}</div></details>`;
  }

  static override styles = [
    controls,
    css`
      :host { display: flex; gap: 10px; }
      .menu { position: relative; }
      .items { position: absolute; right: 0; top: 32px; min-width: 210px; max-height: min(620px, 84cqh); overflow-y: auto; padding: 5px; background: var(--well); border: 1px solid var(--line); border-radius: 8px; box-shadow: 0 6px 24px rgb(0 0 0 / 14%); display: grid; }
      .items button { justify-content: start; }
      .presets { display: grid; grid-template-columns: repeat(3, minmax(140px, 1fr)); gap: 4px; }
      .preset { display: grid; justify-items: start; align-content: start; height: auto; padding: 6px; gap: 3px; white-space: normal; text-align: start; line-height: 1.25; font-size: 12px; }
      .preset img { width: 100%; aspect-ratio: 1; object-fit: cover; border-radius: 5px; background: var(--stage); }
      .preset span:first-of-type { font-weight: 600; }
      .preset .quiet { font-size: 11.5px; }
      @container (max-width: 699px) {
        .menu { position: static; }
        .items { top: 40px; right: 8px; max-width: calc(100cqw - 16px); }
        .items button { height: auto; min-height: 28px; padding-block: 4px; white-space: normal; text-align: start; }
        .presets { grid-template-columns: repeat(2, minmax(0, 1fr)); }
      }
      .items hr { width: 100%; border: 0; border-top: 1px solid var(--line); margin: 4px 0; }
      .items form { display: grid; gap: 6px; padding: 6px 9px; }
      .items form label { display: grid; grid-template-columns: 84px 1fr; align-items: center; overflow-wrap: anywhere; line-height: 1.2; }
      .items form select { border: 1px solid var(--line); background-color: var(--well); }
      .items .main { background: var(--accent); color: var(--ground); justify-content: center; }
      .items .other { border-color: var(--line); justify-content: center; }
    `,
  ];
}

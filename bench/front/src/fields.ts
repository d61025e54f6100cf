/** One field for each kind of parameter. */

import { html, nothing, type TemplateResult } from "lit";

import type { Bench } from "./bench";
import { shortened, split, stepped, withUnit } from "./numbers";
import type { Kind, Parameter, Table, Value, Where } from "./protocol";

const UNITS = { length: "mm", angle: "deg", time: "ms" };
const DRAWN = "drawn cells";
const FROM_FILE = "picture file …";
const CHECKERED = [[1, 0, 1, 0, 1], [0, 1, 0, 1, 0], [1, 0, 1, 0, 1], [0, 1, 0, 1, 0], [1, 0, 1, 0, 1]];
/** Of cells with more rows or columns than this only their number is shown. */
const MOST_DRAWN = 33;
const PAUSE = 500;
/** Fields that arrow keys change: when that ends, and the value of before. A field outlives the functions of one rendering. */
const moved = new WeakMap<HTMLInputElement, { timer: number; from: Value }>();
/** What a part is, before how it is called and where off the axis it stands. */
const FIRST = ["z"];
const LAST = ["name", "decentre"];

/** The fields of a table: where it stands, what it is, how it is called. */
export function fields(bench: Bench, parameters: Parameter[], table: Table, where: Where): TemplateResult[] {
  const rank = ({ name }: Parameter) => (FIRST.includes(name) ? -1 : LAST.indexOf(name) + 1);
  return [...parameters].sort((one, other) => rank(one) - rank(other)).map((each) => field(bench, each, table[each.name] ?? null, [...where, each.name]));
}

function field(bench: Bench, parameter: Parameter, value: Value, where: Where): TemplateResult {
  const family = parameter.family ? bench.parts?.families[parameter.family] : undefined;
  if (family) return familyField(bench, parameter, family, value, where);
  if (parameter.parameters) return tableField(bench, parameter, parameter.parameters, value, where);
  return row(bench, parameter, where, input(bench, parameter, value, where));
}

/** A label, what it is of, and what the host said of it when it was refused. */
function row(bench: Bench, parameter: Parameter, where: Where, inside: TemplateResult): TemplateResult {
  const id = where.join("-");
  const wrong = bench.refused.find((each) => each.where?.join("-") === id)?.words;
  return html`<div class="field">
    <label for=${id} title=${parameter.words}>${parameter.name.replaceAll("_", " ")}</label>
    ${inside}
    ${wrong ? html`<p class="wrong" role="alert">${wrong}</p>` : nothing}
  </div>`;
}

function input(bench: Bench, parameter: Parameter, value: Value, where: Where): TemplateResult {
  const id = where.join("-");
  const { takes, choices } = parameter;
  if (takes.includes("truth"))
    return html`<input id=${id} type="checkbox" .checked=${(value ?? parameter.default) === true}
      @change=${(event: Event) => bench.set(where, (event.target as HTMLInputElement).checked)}>`;
  if (choices.length) {
    const chosen = value ?? parameter.default;
    return html`<select id=${id} @change=${(event: Event) => bench.set(where, (event.target as HTMLSelectElement).value)}>
      ${choices.map((each) => html`<option value=${each} ?selected=${each === chosen}>${each}</option>`)}</select>`;
  }
  if (takes.includes("array")) return cells(bench, value, where, id);
  if (isTable(value) || (Array.isArray(value) && value.some((each) => typeof each === "object")))
    return listed(value, id, parameter.name);
  return words(bench, parameter, value, where);
}

/** What has no fields: the surfaces of a lens as a table, numbers in several dimensions by their count. */
function listed(value: Value, id: string, name: string): TemplateResult {
  const rows = Array.isArray(value) ? value.filter(isTable) : [];
  if (!rows.length || rows.length < (value as Value[]).length) {
    const counts: number[] = [];
    for (let at: Value | undefined = value; Array.isArray(at); at = at[0]) counts.push(at.length);
    return html`<output id=${id} class="quiet">${counts.length > 1 ? `${counts.join(" × ")} numbers` : inWords(value)}</output>`;
  }
  const names = [...new Set(rows.flatMap((row) => Object.keys(row).filter((name) => !isTable(row[name]!))))];
  return html`<div id=${id} class="list" role="region" tabindex="0" aria-label=${name}><table><tr>${names.map((name) => html`<th>${name.replaceAll("_", " ")}</th>`)}</tr>
    ${rows.map((row) => html`<tr>${names.map((name) => html`<td>${short(row[name] ?? null)}</td>`)}</tr>`)}</table></div>`;
}

/** A value in a table that is read, not typed. */
function short(value: Value): string {
  if (value === true) return "yes";
  if (value === false) return "no";
  return Array.isArray(value) ? value.map((each) => (typeof each === "number" ? String(Number(each.toPrecision(4))) : inWords(each))).join(", ") : shortened(inWords(value));
}

/** Numbers, with their units, and words. */
function words(bench: Bench, parameter: Parameter, value: Value, where: Where): TemplateResult {
  const before = value ?? parameter.default;
  const hint = parameter.needed ? "" : parameter.default === null || parameter.default === "" ? "none" : inWords(parameter.default);
  const scalar = parameter.unit !== null && !Array.isArray(before) && !parameter.takes.includes("list");
  const moves = parameter.takes.some((each) => each === "number" || each === "whole number");
  const changed = (event: Event) => {
    const box = event.target as HTMLInputElement;
    delete box.dataset["edited"];
    stop(box);
    const next = box.value.trim() === "" ? null : asValue(parameter, box.value, before);
    // What is shown is shortened: as long as nothing else was typed the value stays as exact as it is.
    if (box.value !== shownIn(value, scalar) && inWords(next) !== inWords(value)) bench.set(where, next);
    else box.value = shownIn(value, scalar);
  };
  const key = (event: KeyboardEvent) => {
    const box = event.target as HTMLInputElement;
    if (event.key === "Escape") {
      const moving = stop(box);
      if (moving) bench.set(where, moving.from);
      box.value = shownIn(moving ? moving.from : value, scalar);
      delete box.dataset["edited"];
      bench.forgive();
    }
    const by = { ArrowUp: 1, ArrowDown: -1 }[event.key];
    if (!by || !moves) return;
    const from = box.value ? inWords(asValue(parameter, box.value, before)) : inWords(parameter.default);
    const whole = parameter.takes.includes("whole number") && !parameter.takes.includes("number");
    const typed = whole ? String(Number(from) + by) : stepped(from, by * (event.shiftKey ? 10 : event.altKey ? 0.1 : 1));
    if (typed === null) return;
    event.preventDefault();
    const next = asValue(parameter, typed, before);
    box.value = shownIn(next, scalar);
    bench.set(where, next, true);
    const began = stop(box);
    const timer = window.setTimeout(() => {
      moved.delete(box);
      bench.set(where, next);
    }, PAUSE);
    moved.set(box, { timer, from: began ? began.from : value });
  };
  const box = html`<input id=${where.join("-")} type="text" inputmode=${parameter.takes.includes("text") ? "text" : "decimal"} autocomplete="off" spellcheck="false"
    .value=${shownIn(value, scalar)} title=${inWords(value)} placeholder=${scalar ? shownIn(parameter.default, true) || hint : hint} @input=${(event: Event) => ((event.target as HTMLInputElement).dataset["edited"] = "")}
    @change=${changed} @keydown=${key}>`;
  return scalar ? html`<span class="quantity">${box}<span class="unit">${unitOf(before) || usualUnit(parameter)}</span></span>` : box;
}

/** End what arrow keys change in a field, without a word to the host. */
function stop(box: HTMLInputElement): { from: Value } | undefined {
  const began = moved.get(box);
  window.clearTimeout(began?.timer);
  moved.delete(box);
  return began;
}

/** The unit of a bare number in a field that has none yet. */
function usualUnit({ name, unit }: Parameter): string {
  return name.includes("wavelength") ? "nm" : (UNITS[unit as keyof typeof UNITS] ?? "");
}

/** The unit that a bare number gets, as it is shown behind the field. */
function unitOf(value: Value): string {
  return shortened(inWords(value)).replace(/^[^a-zA-Zµ°]*/, "");
}

/** What a field shows: of a quantity the number, since its unit stands behind it. */
function shownIn(value: Value, scalar: boolean): string {
  if (Array.isArray(value)) return value.map((each) => shownIn(each, false)).join(", ");
  const words = shortened(inWords(value));
  const parts = scalar ? split(words) : null;
  return parts && Number.isFinite(parts.number) ? words.slice(0, words.length - parts.unit.length).trim() : words;
}

/** A table that may be there or not: a sensor's electronics. */
function tableField(bench: Bench, parameter: Parameter, inside: Parameter[], value: Value, where: Where): TemplateResult {
  const id = where.join("-");
  return html`${row(bench, parameter, where, html`<input id=${id} type="checkbox" .checked=${isTable(value)} ?disabled=${parameter.needed && isTable(value)}
      @change=${(event: Event) => bench.set(where, (event.target as HTMLInputElement).checked ? {} : null)}>`)}
    ${isTable(value) ? html`<div class="inner">${fields(bench, inside, value, where)}</div>` : nothing}`;
}

/** A pattern, kernel or surface: its name, and the fields of what has that name. */
function familyField(bench: Bench, parameter: Parameter, family: Kind[], value: Value, where: Where): TemplateResult {
  const id = where.join("-");
  const table = isTable(value) ? value : null;
  const rows = isRows(value);
  const drawable = parameter.family === "pattern" && parameter.takes.includes("array");
  const chosen = table ? String(table["name"] ?? "") : rows ? DRAWN : typeof value === "string" ? value : Array.isArray(value) ? `${value.length} together` : "";
  const kind = family.find((each) => each.kind === chosen);
  const known = [...family.filter((each) => drawable || !each.cells).map((each) => each.kind), ...(drawable ? [DRAWN, FROM_FILE] : [])];
  const choose = (event: Event) => {
    const select = event.target as HTMLSelectElement;
    const name = select.value;
    if (name === FROM_FILE) {
      (select.nextElementSibling as HTMLInputElement).click();
      select.value = chosen;
    } else if (name === DRAWN) bench.set(where, CHECKERED);
    else bench.set(where, name === "" ? null : { name });
  };
  return html`${row(bench, parameter, where, html`
      <select id=${id} @change=${choose}>
        ${parameter.needed ? nothing : html`<option value="" ?selected=${chosen === ""}>none</option>`}
        ${chosen && !known.includes(chosen) ? html`<option value=${chosen} selected>${chosen}</option>` : nothing}
        ${known.map((each) => html`<option value=${each} ?selected=${each === chosen}>${each.replaceAll("_", " ")}</option>`)}
      </select>
      ${drawable ? html`<input type="file" hidden accept="image/*,.npy,.csv,.tif,.exr" aria-label="Picture for the pattern" @change=${(event: Event) => void upload(bench, where, event.target as HTMLInputElement)}>` : nothing}`)}
    ${rows ? html`<div class="field"><label for="${id}-cells">cells</label>${cells(bench, value, where, `${id}-cells`)}</div>` : nothing}
    ${kind && table ? html`<div class="inner">${fields(bench, kind.parameters, table, where)}</div>` : nothing}`;
}

async function upload(bench: Bench, where: Where, input: HTMLInputElement): Promise<void> {
  const file = input.files?.[0];
  if (file) bench.act({ do: "upload", where, name: file.name }, [await file.arrayBuffer()]);
  input.value = "";
}

/** Rows of numbers as text, and as cells to be clicked on and off. */
function cells(bench: Bench, value: Value, where: Where, id: string): TemplateResult {
  if (Array.isArray(value) && !isRows(value)) return listed(value, id, String(where.at(-1)));
  const grid = isRows(value) ? value : null;
  const columns = grid?.[0]?.length ?? 0;
  if (!grid || grid.length > MOST_DRAWN || columns > MOST_DRAWN)
    return html`<output id=${id} class="quiet">${grid ? `${grid.length} × ${columns} numbers` : "none"}</output>`;
  const flip = (row: number, column: number) =>
    bench.set(where, grid.map((each, at) => (at === row ? each.map((cell, place) => (place === column ? (cell > 0.5 ? 0 : 1) : cell)) : each)));
  const side = Math.max(5, Math.min(18, Math.floor(180 / columns)));
  const typed = (event: Event) => {
    const lines = (event.target as HTMLTextAreaElement).value.trim().split("\n");
    bench.set(where, lines.map((line) => line.trim().split(/[\s,]+/).map((each) => (Number.isFinite(Number(each)) ? Number(each) : each))));
  };
  // The text below says the same to keys and readers of screens.
  return html`<div class="cells">
    ${where.includes("pattern") ? html`<div class="grid" aria-hidden="true" style="grid-template-columns: repeat(${columns}, ${side}px)">
      ${grid.map((row, r) => row.map((cell, c) => html`<i style="height:${side}px;background:color-mix(in srgb, #fff ${100 * Math.min(Math.max(cell, 0), 1)}%, #000)" @click=${() => flip(r, c)}></i>`))}
    </div>` : nothing}
    <textarea id=${id} rows=${Math.min(grid.length, 6)} spellcheck="false" .value=${grid.map((row) => row.join(" ")).join("\n")} @change=${typed}></textarea>
  </div>`;
}

function isTable(value: Value): value is Table {
  return typeof value === "object" && value !== null && !Array.isArray(value);
}

function isRows(value: Value): value is number[][] {
  return Array.isArray(value) && value.length > 0 && value.every((row) => Array.isArray(row) && row.every((each) => typeof each === "number"));
}

/** As it is typed and shown: lists by commas. */
function inWords(value: Value): string {
  if (value === null || value === undefined) return "";
  if (Array.isArray(value)) return value.map(inWords).join(", ");
  return isTable(value) ? JSON.stringify(value) : String(value);
}

/** What was typed, as a document holds it; what makes no sense goes as words, and the host says what is wrong. */
function asValue(parameter: Parameter, typed: string, before: Value): Value {
  const { takes, unit } = parameter;
  if (takes.includes("list") && typed.includes(","))
    return typed.split(",").map((each, at) => asValue({ ...parameter, takes: ["number"] }, each, Array.isArray(before) ? (before[at] ?? null) : before));
  const text = typed.trim();
  if (unit) return withUnit(text, Array.isArray(before) ? (before[0] ?? null) : before, usualUnit(parameter));
  const number = Number(text.replace("−", "-"));
  const numeric = takes.some((each) => each !== "text" && each !== "name");
  return numeric && text !== "" && Number.isFinite(number) ? number : text;
}

/** Lengths and numbers, as words and back. */

const METRES: { [unit: string]: number } = { nm: 1e-9, um: 1e-6, "µm": 1e-6, "μm": 1e-6, mm: 1e-3, cm: 1e-2, m: 1 };
const NUMBER = /^\s*([-+−]?(?:\d+(?:[.,]\d*)?|[.,]\d+)(?:[eE][-+]?\d+)?)\s*([^\d\s].*?)?\s*$/;

/** A number and the unit behind it ("" where there is none); null where it is neither. */
export function split(words: string): { number: number; unit: string } | null {
  const found = NUMBER.exec(words);
  if (!found) return null;
  return { number: Number(found[1]!.replace("−", "-").replace(",", ".")), unit: found[2] ?? "" };
}

/** Metres of "41.5 mm"; NaN where the words are no length. */
export function metres(words: unknown): number {
  if (typeof words === "number") return words;
  const parts = split(String(words));
  const unit = parts && METRES[parts.unit];
  return parts && unit && Number.isFinite(parts.number) ? parts.number * unit : NaN;
}

/** At most so many digits, no trailing zeros, no exponent for what people write without. */
export function plain(value: number, digits = 6): string {
  if (!Number.isFinite(value)) return value > 0 ? "∞" : value < 0 ? "−∞" : "–";
  const rounded = Number(value.toPrecision(digits));
  return Math.abs(rounded) >= 1e-6 || rounded === 0 ? rounded.toString() : rounded.toExponential();
}

/** The words with a number of at most nine digits: "88.418708240534514 mm" is shown as "88.4187082 mm", and um as µm. */
export function shortened(words: string): string {
  const parts = split(words);
  if (!parts || !Number.isFinite(parts.number)) return words;
  const unit = parts.unit === "um" ? "µm" : parts.unit;
  const digits = words.replace(/[eE].*|[^\d]/g, "").replace(/^0+/, "").length;
  const number = digits > 9 ? String(Number(parts.number.toPrecision(9))) : words.trim().slice(0, words.trim().length - parts.unit.length).trim();
  return unit ? `${number} ${unit}` : number;
}

/** Millimetres to the nanometre, as a place on the axis is sent. */
export function inMillimetres(place: number): string {
  return `${Number((place * 1e3).toFixed(6)) + 0} mm`;
}

/** As people say it: "1.2 m", "52 mm", "24 µm". */
export function short(length: number, digits = 4): string {
  const size = Math.abs(length);
  if (!Number.isFinite(length)) return "∞";
  if (size >= 1) return `${plain(length, digits)} m`;
  if (size >= 1e-4 || size === 0) return `${plain(length * 1e3, digits)} mm`;
  return `${plain(length * 1e6, digits)} µm`;
}

/**
 * What was typed, with the unit of the value before where none was typed: "41.5" becomes "41.5 mm". Digits that no number
 * holds ("1e400") stay as they were typed, and the host says what is wrong.
 */
export function withUnit(typed: string, before: unknown, otherwise: string): string {
  const parts = split(typed);
  if (!parts) return typed;
  const unit = parts.unit || (typeof before === "string" && split(before)?.unit) || otherwise;
  if (!Number.isFinite(parts.number)) return parts.unit ? typed : `${typed} ${unit}`;
  return `${parts.number}${unit ? ` ${unit}` : ""}`;
}

/** The words with their number moved by so many steps of `step`, rounded to a tenth of it. */
export function stepped(words: string, by: number): string | null {
  const parts = split(words);
  if (!parts) return null;
  const size = Math.abs(parts.number);
  const step = size === 0 ? 0.1 : 10 ** (Math.floor(Math.log10(size)) - 1);
  const moved = Number((parts.number + by * step).toPrecision(10));
  return `${moved}${parts.unit ? ` ${parts.unit}` : ""}`;
}

/** A step along the axis that suits a drawing of this length: 0.1 mm for one of 75 mm. */
export function axisStep(length: number): number {
  return 10 ** Math.floor(Math.log10(Math.max(length, 1e-9) / 500));
}

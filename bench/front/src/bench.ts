/** The state of one bench on this side of the wire: what the host said last, and what was asked of it since. */

import { base64, read, written } from "./address";
import type { Host } from "./host";
import { metres } from "./numbers";
import type {
  Answer, BenchDocument, FromHost, Look, Note, Parts, PictureMessage, Pin, Side, SideAperture, SideElement, SideSensor, Table, Value, ValueMessage, Where,
} from "./protocol";

/** What is selected: an element's number, or one of the two that always are there. */
export type Selected = number | "sensor" | "light field";

export interface Shown {
  bitmap: ImageBitmap;
  about: PictureMessage;
}

interface Refused {
  words: string;
  where: Where | null;
}
/** One list for all times without any: views that show it are not drawn again. */
const NOTHING: Refused[] = [];

/** What the host answered to a question, and its pictures by their addresses. */
export interface Answered<What extends Answer["what"] = Answer["what"]> {
  message: Extract<Answer, { what: What }>;
  pictures: string[];
}

/** After so long the newest value is sent although no state of those before has come, milliseconds. */
const PATIENCE = 150;
/** After so long without a new value a hand that drags holds still, milliseconds. */
const REST = 30;
/** In a drag the views wait for the next picture at most so long, milliseconds. */
const TOGETHER = 50;
const REMARK = 12_000;
const ADDRESS_AFTER = 250;
const LONGEST_ADDRESS = 200_000;

const PLAIN = JSON.stringify({ black: 0, linear: false, channel: null, photodiodes: "sum", axis: "x" });

export interface Options {
  /** Whether the document stands in the page's address. */
  address?: boolean;
}

export class Bench extends EventTarget {
  open = false;
  /** Why not. */
  absent: string;
  parts: Parts | null = null;
  document: BenchDocument | null = null;
  side: Side | null = null;
  notes: Note[] = [];
  canUndo = false;
  canRedo = false;
  selected: Selected = "sensor";
  picture: Shown | null = null;
  /** Pinned states with their thumbnails, and the picture of the one that is compared with. */
  pins: { about: Pin; thumbnail: string }[] = [];
  pinned: ImageBitmap | null = null;
  look: Look = { black: 0, linear: false, channel: null, photodiodes: "sum", axis: "x" };
  /** Of the presets, in their order. */
  thumbnails: string[] = [];
  /** Frames of a sweep. */
  frames: { values: string[]; label: string; bitmaps: ImageBitmap[] } | null = null;
  value: ValueMessage | null = null;
  /** (rows, columns) of views, when the light field has been opened. */
  views: [number, number] | null = null;
  /** Why there is no picture. */
  without: string | null = null;
  /** What was refused since something was asked; several changes at once where a connection came back. */
  refused: Refused[] = NOTHING;
  /** What the host did besides, or in another way. */
  remark: string | null = null;
  /** Centres of the light field's bands, metres, if it has them. */
  bands: number[] | null = null;
  progress: { done: number; total: number; words: string } | null = null;
  /** The newest to each question. */
  readonly answers = new Map<string, Answered>();
  decoded: Answered<"decoded"> | null = null;
  /** What was refocused since. */
  refocused: Answered<"refocused"> | null = null;
  /** Whether decoded views are still to come. */
  decoding = false;
  /** Whether a picture of what was asked last is still to come. */
  waiting = false;

  /** Of what was asked last that shows another picture. */
  turn = 0;

  /** In a drag, until the next picture has come: all views are drawn in one frame with it. */
  together: Promise<void> | null = null;

  private release: () => void = () => {};
  private silent = false;
  /** What is selected once the host has answered this turn: an element that it adds. */
  private selectAt = Infinity;
  private selectThen: Selected = "sensor";
  private accepted: BenchDocument | null = null;
  next: { where: Where; value: Value } | null = null;
  /** Values that were changed, by the turn of their message, until the host has answered: a lost connection loses none. */
  private unanswered: { turn: number; where: Where; value: Value }[] = [];
  /** The newest turn whose state has come; those after it are under way. */
  private heard = 0;
  private timer = 0;
  private addressTimer = 0;
  private remarkTimer = 0;
  private restTimer = 0;
  private pictures = 0;
  private latestPicture = 0;
  /** Questions under way, each with the newest that was asked meanwhile. */
  private readonly asked = new Map<string, object | null>();

  constructor(private readonly host: Host, readonly options: Options = {}) {
    super();
    this.absent = host.awaited;
    host.onmessage = (message, buffers) => void this.hear(message, buffers);
    host.onstate = (state) => void this.connection(state);
  }

  start(): void {
    if (this.options.address) window.addEventListener("hashchange", this.addressChanged);
    this.host.start();
  }

  close(): void {
    window.removeEventListener("hashchange", this.addressChanged);
    window.clearTimeout(this.timer);
    window.clearTimeout(this.addressTimer);
    window.clearTimeout(this.remarkTimer);
    window.clearTimeout(this.restTimer);
    this.host.close();
  }

  // --- what is asked of the host ---

  /** Change one value; while moving, the host takes the newest of those that have come, and few are under way. */
  set(where: Where, value: Value, moving = false): void {
    if (this.document) this.document = patched(this.document, where, value);
    window.clearTimeout(this.restTimer);
    if (moving) {
      if (this.open && this.turn > this.heard) this.wait();
      this.next = { where, value };
      if (this.turn - this.heard < this.host.ahead) this.sendNext();
      this.restTimer = window.setTimeout(() => this.rest(where, value), REST);
    } else {
      this.next = this.remark = null;
      this.settle();
      this.ask({ do: "set", where, value, moving: false });
      const within = (each: Where) => where.every((step, at) => each[at] === step);
      this.unanswered = [...this.unanswered.filter((each) => !within(each.where)), { turn: this.turn, where, value }];
    }
    this.changed();
  }

  /** Let the views wait for the picture that is under way. */
  private wait(): void {
    this.together ??= new Promise((resolve) => {
      const timer = window.setTimeout(() => this.release(), TOGETHER);
      this.release = () => {
        window.clearTimeout(timer);
        this.together = null;
        this.release = () => {};
        resolve();
      };
    });
  }

  /** A hand that holds still sees the whole picture. */
  private rest(where: Where, value: Value): void {
    this.next = null;
    this.settle();
    this.ask({ do: "set", where, value, moving: true, rests: true });
    this.changed();
  }

  act(message: { do: string } & { [name: string]: unknown }, buffers?: ArrayBuffer[]): void {
    if (!this.heardOf()) return;
    this.remark = null; // of what was done before
    window.clearTimeout(this.restTimer);
    this.next = null;
    this.settle();
    this.ask(message, buffers);
    this.changed();
  }

  /** Whether the host hears what is asked now, or later; otherwise this is said. */
  private heardOf(): boolean {
    const heard = this.open || this.silent;
    if (!heard) this.refuse("This was not done, because there is no connection. Values that you change meanwhile are sent when it is back.");
    this.changed();
    return heard;
  }

  /** The host finds a place that suits the kind, unless one is given. */
  add(kind: string, z?: string): void {
    this.selectThen = this.elements.length;
    this.act({ do: "add", kind, ...(z === undefined ? {} : { z }) });
    this.selectAt = this.turn;
  }

  /** The copy comes behind the element. */
  duplicate(element: number): void {
    this.selectThen = element + 1;
    this.act({ do: "duplicate", element });
    this.selectAt = this.turn;
  }

  /** Ask about the camera or a pixel ("value"); while an answer is under way, the newest question waits for it. */
  question(what: string, options: object = {}): void {
    const waits = this.asked.has(what);
    this.asked.set(what, waits ? options : null);
    if (waits) return;
    if (what === "decoded") this.decoding = true;
    this.host.send(what === "value" ? { do: what, ...options } : { do: "ask", what, ...options });
  }

  /** Questions that are answered, or will not be, are followed by those that wait for them. */
  private answered(...all: string[]): void {
    for (const what of all) {
      const next = this.asked.get(what);
      this.asked.delete(what);
      if (next) this.question(what, next);
    }
  }

  export(what: string, options: object = {}): void {
    if (this.heardOf()) this.host.send({ do: "export", what, ...options });
  }

  /** Change how the picture is shown. */
  show(look: Partial<Look>): void {
    this.look = { ...this.look, ...look };
    this.host.send({ do: "look", look: this.look, turn: this.turn });
    this.changed();
  }

  pin(): void {
    if (this.heardOf()) this.host.send({ do: "pin" });
  }

  unpin(number?: number): void {
    this.host.send({ do: "unpin", ...(number === undefined ? {} : { number }) });
  }

  compareWith(number: number | null): void {
    this.host.send({ do: "compare", number, turn: this.turn });
  }

  scrub(options: object): void {
    if (!this.heardOf()) return;
    this.frames = null;
    this.question("scrub", options);
  }

  endScrub(): void {
    this.frames?.bitmaps.forEach((each) => each.close());
    this.frames = null;
    this.changed();
  }

  select(selected: Selected): void {
    if (this.selected === selected) return;
    this.selected = selected;
    this.changed();
  }

  forgive(): void {
    this.refused = NOTHING;
    this.remark = null;
    this.changed();
  }

  private refuse(words: string, where: Where | null = null): void {
    this.refused = [...this.refused, { words, where }];
  }

  // --- what can be asked of the document ---

  get elements(): Table[] {
    return this.document?.camera.elements ?? [];
  }

  partOf(selected: Selected): SideElement | SideSensor | SideAperture | undefined {
    if (selected === "light field") return this.side?.aperture ?? undefined;
    return selected === "sensor" ? this.side?.sensor : this.side?.elements[selected];
  }

  /** Where a part stands on the axis, metres. The document is the one source of places; the drawing follows it. */
  placeOf(selected: Selected): number {
    const table = this.tableOf(selected);
    const z = metres(table?.["z"] ?? "0 mm");
    return Number.isFinite(z) ? z : (this.partOf(selected)?.z ?? 0);
  }

  tableOf(selected: Selected): Table | undefined {
    if (selected === "light field") return this.document?.aperture as unknown as Table | undefined;
    return selected === "sensor" ? this.document?.camera.sensor : this.elements[selected];
  }

  whereOf(selected: Selected): Where {
    if (selected === "light field") return ["aperture"];
    return selected === "sensor" ? ["sensor"] : ["elements", selected];
  }

  notesOf(selected: Selected): Note[] {
    return this.notes.filter((note) => note.element === selected);
  }

  // --- what the host says ---

  private async connection(state: "open" | "closed" | "silent"): Promise<void> {
    const wasSilent = this.silent;
    this.open = state === "open";
    this.silent = state === "silent";
    if (!this.open) this.absent = this.host.why ?? (this.document || this.silent ? this.host.lost : this.host.awaited);
    if (this.silent || wasSilent) {
      // Nothing was lost: what was sent is still to be answered.
      this.changed();
      return;
    }
    this.settle();
    this.asked.clear();
    if (this.open) {
      const document = this.accepted ?? (this.options.address ? await this.inAddress() : null);
      this.ask({ do: "hello", ...(document instanceof Error ? {} : { document, changes: this.unanswered }) });
      for (const each of this.unanswered) each.turn = this.turn;
      if (document instanceof Error) this.refuse(document.message);
      if (JSON.stringify(this.look) !== PLAIN) this.host.send({ do: "look", look: this.look, turn: this.turn });
    } else {
      this.progress = null;
      this.waiting = false;
    }
    this.changed();
  }

  private async hear(message: FromHost, buffers: DataView[]): Promise<void> {
    switch (message.is) {
      case "parts":
        this.parts = message;
        this.thumbnails = buffers.map((each) => dataAddress(each));
        break;
      case "state":
        this.hearState(message);
        break;
      case "notes":
        if (message.turn >= this.turn) this.notes = message.notes;
        break;
      case "no picture":
        this.without = message.words;
        this.finished();
        break;
      case "failed":
        this.refuse(message.words);
        this.decoding = false;
        this.answered(...this.asked.keys());
        this.finished();
        break;
      case "picture":
        if (message.turn >= this.turn && !message.coarse) this.waiting = false;
        this.without = null;
        this.progress = null;
        await this.showPicture(message, buffers[0]);
        break;
      case "pins":
        await this.hearPins(message, buffers);
        break;
      case "value":
        this.value = message;
        this.answered("value");
        break;
      case "answer":
        await this.hearAnswer(message, buffers);
        break;
      case "file":
        if (buffers[0]) saved(message.name, new Blob([bytesOf(buffers[0])], { type: message.type }));
        this.progress = null;
        break;
      case "refused":
        this.hearRefused(message);
        break;
      case "progress":
        this.progress = message.done < message.total ? message : null;
        break;
    }
    // In a drag a picture's state follows it, and is drawn with the next one.
    if (message.is === "state" && message.document === null) this.wait();
    else this.release();
    this.changed();
  }

  private hearState(message: Extract<FromHost, { is: "state" }>): void {
    this.side = message.side;
    this.views = message.grid ? [message.grid[0]!, message.grid[1]!] : null;
    this.bands = message.bands;
    this.canUndo = message.undo;
    this.canRedo = message.redo;
    this.accepted = message.document ?? this.accepted;
    if (message.document) this.unanswered = this.unanswered.filter((each) => each.turn > message.turn);
    if (message.document && message.turn >= this.turn && !this.next) {
      this.document = message.document;
      this.keepAddress();
    }
    if (message.turn >= this.selectAt) {
      this.selectAt = Infinity;
      this.selected = this.selectThen;
    }
    if (typeof this.selected === "number" && this.selected >= this.side.elements.length)
      this.selected = this.side.elements.length ? this.side.elements.length - 1 : "sensor";
    this.heard = Math.max(this.heard, message.turn);
    window.clearTimeout(this.timer);
    this.sendNext();
  }

  private hearRefused(message: Extract<FromHost, { is: "refused" }>): void {
    if (message.done) {
      this.remark = message.words;
      window.clearTimeout(this.remarkTimer);
      this.remarkTimer = window.setTimeout(() => {
        this.remark = null;
        this.changed();
      }, REMARK);
      return;
    }
    this.refuse(message.words, message.where as Where | null);
    this.decoding = false;
    this.selectAt = Infinity;
    this.answered(...this.asked.keys());
    if (!this.next && message.turn >= this.turn) this.document = this.accepted; // the host's state follows
    this.finished();
  }

  /** What was asked is answered, in one way or another. */
  private finished(): void {
    this.waiting = false;
    this.progress = null;
    this.settle();
    this.sendNext();
  }

  private async hearPins({ pins, psnr, same }: Extract<FromHost, { is: "pins" }>, buffers: DataView[]): Promise<void> {
    this.pins = pins.map((about, number) => ({ about, thumbnail: dataAddress(buffers[number]!) }));
    const bitmap = buffers[pins.length] ? await decoded(buffers[pins.length]!) : null;
    this.pinned?.close();
    this.pinned = bitmap;
    if (this.picture) this.picture.about = { ...this.picture.about, psnr, same };
  }

  private async hearAnswer(message: Answer, buffers: DataView[]): Promise<void> {
    this.answered(message.what);
    if (message.what === "scrub") {
      this.progress = null;
      this.frames = { values: message.values, label: message.label, bitmaps: await Promise.all(buffers.map(decoded)) };
      return;
    }
    const pictures = buffers.map((each) => dataAddress(each));
    if (message.what === "refocused") this.refocused = { message, pictures };
    else if (message.what === "decoded") {
      this.decoded = { message, pictures };
      this.refocused = null;
      this.decoding = false;
    } else this.answers.set(message.what, { message, pictures });
  }

  /** Pictures are decoded beside one another; one that is older than what is shown is not shown. */
  private async showPicture(about: PictureMessage, bytes: DataView | undefined): Promise<void> {
    if (!bytes) return;
    const number = ++this.pictures;
    const bitmap = await decoded(bytes);
    if (number < this.latestPicture) {
      bitmap.close();
      return;
    }
    this.latestPicture = number;
    this.picture?.bitmap.close();
    this.picture = { bitmap, about };
  }

  // --- latest wins ---

  private sendNext(): void {
    if (!this.next) return;
    const { where, value } = this.next;
    this.next = null;
    this.ask({ do: "set", where, value, moving: true });
    window.clearTimeout(this.timer);
    this.timer = window.setTimeout(() => {
      this.settle();
      this.sendNext();
    }, PATIENCE);
  }

  /** Nothing is under way any more. */
  private settle(): void {
    window.clearTimeout(this.timer);
    this.heard = this.turn;
    this.release();
  }

  private ask(message: object, buffers?: ArrayBuffer[]): void {
    this.turn += 1;
    this.asked.clear(); // the host gives up what a change makes obsolete
    this.refused = NOTHING;
    this.waiting = this.open;
    this.host.send({ ...message, turn: this.turn }, buffers);
  }

  private changed(): void {
    this.dispatchEvent(new Event("change"));
  }

  // --- the address ---

  private keepAddress(): void {
    if (!this.options.address) return;
    window.clearTimeout(this.addressTimer);
    this.addressTimer = window.setTimeout(async () => {
      if (!this.document) return;
      const { pathname, search } = window.location;
      const fragment = await written(this.document);
      // Browsers cut what is longer; a camera with that many cells is kept as a file.
      window.history.replaceState(null, "", pathname + search + (fragment.length < LONGEST_ADDRESS ? fragment : ""));
    }, ADDRESS_AFTER);
  }

  private readonly addressChanged = async (): Promise<void> => {
    const document = await this.inAddress();
    if (document instanceof Error) this.refuse(document.message);
    else if (document) this.act({ do: "load", document });
    this.changed();
  };

  private async inAddress(): Promise<BenchDocument | Error | null> {
    try {
      return await read(window.location.hash);
    } catch {
      return new Error(`The camera in this address, ${window.location.hash.slice(0, 16)}…, is cut or damaged: copy the whole address again. The bench shows ${this.document ? "the camera of before" : "the one that it was started with"}.`);
    }
  }
}

/** The document with another value in one place, all else shared with it; null takes away. */
function patched(document: BenchDocument, where: Where, value: Value): BenchDocument {
  const inCamera = where[0] === "elements" || where[0] === "sensor";
  return put(document as unknown as Value, inCamera ? ["camera", ...where] : where, value, inCamera) as unknown as BenchDocument;
}

function put(at: Value, path: Where, value: Value, takesAway: boolean): Value {
  if (!path.length) return value;
  const [step, ...rest] = path as [string | number, ...Where];
  if (Array.isArray(at)) return at.map((each, number) => (number === step ? put(each, rest, value, takesAway) : each));
  if (typeof at !== "object" || at === null) return at;
  const copy = { ...at, [step]: put(at[step] ?? null, rest, value, takesAway) };
  if (takesAway && copy[step] === null) delete copy[step];
  return copy;
}

function bytesOf(view: DataView): Uint8Array<ArrayBuffer> {
  return new Uint8Array(view.buffer as ArrayBuffer, view.byteOffset, view.byteLength);
}

/** A picture's address that any page may show, whatever its policy says of those made in it. */
function dataAddress(view: DataView): string {
  const bytes = bytesOf(view);
  return `data:image/${bytes[0] === 0xff ? "jpeg" : "webp"};base64,${base64(bytes)}`;
}

/** By an image of a data address: a Blob is registered in the browser's own process, for which the page waits. */
async function decoded(view: DataView): Promise<ImageBitmap> {
  const image = new Image();
  const loaded = new Promise((resolve, reject) => [image.onload, image.onerror] = [resolve, reject]);
  image.src = dataAddress(view);
  await loaded;
  return createImageBitmap(image);
}

export function saved(name: string, file: Blob): void {
  const address = URL.createObjectURL(file);
  const link = document.createElement("a");
  link.href = address;
  link.download = name;
  // VS Code listens for such clicks at the page's body.
  link.hidden = true;
  document.body.append(link);
  link.click();
  link.remove();
  window.setTimeout(() => URL.revokeObjectURL(address), 10_000);
}

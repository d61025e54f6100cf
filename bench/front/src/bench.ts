/** The state of one bench on this side of the wire: what the host said last, and what was asked of it since. */

import { read, written } from "./address";
import type { Host } from "./host";
import type {
  AnswerMessage, BenchDocument, DecodedMessage, FromHost, Note, Parts, PictureMessage, RefocusedMessage, Side, SideAperture, SideElement, SideSensor, Table, Value, ValueMessage, Where,
} from "./protocol";

/** What is selected: an element's number, or one of the two that always are there. */
export type Selected = number | "sensor" | "light field";

export interface Shown {
  bitmap: ImageBitmap;
  about: PictureMessage;
}

/** What the host answered, and its pictures by their addresses. */
export interface Answer {
  message: AnswerMessage;
  pictures: string[];
}

/** After so long the newest place is sent although the picture of the last one has not come, milliseconds. */
const PATIENCE = 150;
const ADDRESS_AFTER = 250;
const LONGEST_ADDRESS = 200_000;

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
  pinned: ImageBitmap | null = null;
  value: ValueMessage | null = null;
  /** (rows, columns) of views, when the light field has been opened. */
  views: [number, number] | null = null;
  /** Why there is no picture. */
  without: string | null = null;
  refused: { words: string; where: Where | null } | null = null;
  progress: { done: number; total: number; words: string } | null = null;
  /** The newest to each question. */
  readonly answers = new Map<string, Answer>();
  decoded: { message: DecodedMessage; pictures: string[] } | null = null;
  /** What was refocused since. */
  refocused: { message: RefocusedMessage; picture: string } | null = null;
  /** Whether decoded views are still to come. */
  decoding = false;
  /** Whether a picture of what was asked last is still to come. */
  waiting = false;

  /** Of what was asked last that shows another picture. */
  turn = 0;

  private silent = false;
  /** What is selected once the host has answered this turn: an element that it adds. */
  private selectAt = Infinity;
  private selectThen: Selected = "sensor";
  private accepted: BenchDocument | null = null;
  private next: { where: Where; value: Value } | null = null;
  private underway = 0;
  private timer = 0;
  private addressTimer = 0;
  private pictures = 0;
  private latestPicture = 0;
  private valueUnderway = false;
  private nextValue: [number, number] | null = null;

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
    this.host.close();
  }

  // --- what is asked of the host ---

  /** Change one value; while moving, only the newest is sent, when the picture of the one before has come. */
  set(where: Where, value: Value, moving = false): void {
    if (this.document) this.document = patched(this.document, where, value);
    if (moving) {
      this.next = { where, value };
      if (!this.underway) this.sendNext();
    } else {
      this.next = null;
      this.settle();
      this.ask({ do: "set", where, value, moving: false });
    }
    this.changed();
  }

  act(message: { do: string } & { [name: string]: unknown }, buffers?: ArrayBuffer[]): void {
    this.next = null;
    this.settle();
    this.ask(message, buffers);
    this.changed();
  }

  add(kind: string, z: string): void {
    this.selectThen = this.elements.length;
    this.act({ do: "add", kind, z });
    this.selectAt = this.turn;
  }

  /** The copy comes behind the element. */
  duplicate(element: number): void {
    this.selectThen = element + 1;
    this.act({ do: "duplicate", element });
    this.selectAt = this.turn;
  }

  /** The pixel's numbers; the newest asked for, when those of the one before have come. */
  askValue(x: number, y: number): void {
    this.nextValue = [x, y];
    if (this.valueUnderway) return;
    this.valueUnderway = true;
    this.host.send({ do: "value", x, y });
    this.nextValue = null;
  }

  question(what: string, options: object = {}): void {
    if (what === "decoded") this.decoding = true;
    this.host.send({ do: "ask", what, ...options });
  }

  export(what: string, options: object = {}): void {
    this.host.send({ do: "export", what, ...options });
  }

  pin(on: boolean): void {
    this.host.send({ do: "pin", on });
    if (!on) {
      this.pinned = null;
      this.changed();
    }
  }

  select(selected: Selected): void {
    if (this.selected === selected) return;
    this.selected = selected;
    this.changed();
  }

  forgive(): void {
    this.refused = null;
    this.changed();
  }

  // --- what can be asked of the document ---

  get elements(): Table[] {
    return this.document?.camera.elements ?? [];
  }

  partOf(selected: Selected): SideElement | SideSensor | SideAperture | undefined {
    if (selected === "light field") return this.side?.aperture ?? undefined;
    return selected === "sensor" ? this.side?.sensor : this.side?.elements[selected];
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
    if (!this.open) this.absent = this.document || this.silent ? this.host.lost : this.host.awaited;
    if (this.silent || wasSilent) {
      // Nothing was lost: what was sent is still to be answered.
      this.changed();
      return;
    }
    this.settle();
    this.valueUnderway = false;
    if (this.open) {
      const document = this.document ?? (this.options.address ? await read(window.location.hash) : null);
      this.ask({ do: "hello", ...(document ? { document } : {}) });
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
        break;
      case "state":
        this.side = message.side;
        this.views = message.grid ? [message.grid[0]!, message.grid[1]!] : null;
        this.canUndo = message.undo;
        this.canRedo = message.redo;
        this.accepted = message.document;
        if (message.turn >= this.turn && !this.next) {
          this.document = message.document;
          this.keepAddress();
        }
        if (message.turn >= this.selectAt) {
          this.selectAt = Infinity;
          this.selected = this.selectThen;
        }
        if (typeof this.selected === "number" && this.selected >= this.side.elements.length)
          this.selected = this.side.elements.length ? this.side.elements.length - 1 : "sensor";
        break;
      case "notes":
        if (message.turn >= this.turn) this.notes = message.notes;
        break;
      case "no picture":
        this.without = message.words;
        this.waiting = false;
        this.progress = null;
        this.settle();
        this.sendNext();
        break;
      case "failed":
        this.refused = { words: message.words, where: null };
        this.decoding = false;
        this.waiting = false;
        this.progress = null;
        this.settle();
        this.sendNext();
        break;
      case "picture":
        if (message.turn >= this.turn && !message.coarse) this.waiting = false;
        this.without = null;
        this.progress = null;
        if (message.turn >= this.underway) {
          this.settle();
          this.sendNext();
        }
        await this.show(message, buffers[0]);
        break;
      case "pinned":
        this.pinned?.close();
        this.pinned = buffers[0] ? await decoded(buffers[0]) : null;
        if (this.picture) this.picture.about = { ...this.picture.about, same: this.pinned !== null };
        break;
      case "value":
        this.value = message;
        this.valueUnderway = false;
        if (this.nextValue) this.askValue(...this.nextValue);
        break;
      case "answer":
        this.hearAnswer(message, buffers.map(dataAddress));
        break;
      case "file":
        if (buffers[0]) saved(message.name, message.type, buffers[0]);
        this.progress = null;
        break;
      case "refused":
        this.refused = { words: message.words, where: message.where ?? null };
        this.decoding = false;
        this.selectAt = Infinity;
        this.waiting = false;
        this.progress = null;
        this.valueUnderway = false;
        this.settle();
        if (!this.next) this.document = this.accepted;
        this.sendNext();
        break;
      case "progress":
        this.progress = message.done < message.total ? message : null;
        break;
    }
    this.changed();
  }

  private hearAnswer(message: AnswerMessage | DecodedMessage | RefocusedMessage, pictures: string[]): void {
    if (message.what === "refocused") this.refocused = { message, picture: pictures[0]! };
    else if (message.what === "decoded") {
      this.decoded = { message, pictures };
      this.refocused = null;
      this.decoding = false;
    } else this.answers.set(message.what, { message, pictures });
  }

  /** Pictures are decoded beside one another; one that is older than what is shown is not shown. */
  private async show(about: PictureMessage, bytes: DataView | undefined): Promise<void> {
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
    this.underway = this.turn;
    this.timer = window.setTimeout(() => {
      this.underway = 0;
      this.sendNext();
    }, PATIENCE);
  }

  /** Nothing is under way any more. */
  private settle(): void {
    window.clearTimeout(this.timer);
    this.underway = 0;
  }

  private ask(message: object, buffers?: ArrayBuffer[]): void {
    this.turn += 1;
    this.refused = null;
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
    const document = await read(window.location.hash);
    if (document) this.act({ do: "load", document });
  };
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
  let letters = "";
  for (const byte of bytesOf(view)) letters += String.fromCharCode(byte);
  return `data:image/jpeg;base64,${btoa(letters)}`;
}

function decoded(view: DataView): Promise<ImageBitmap> {
  return createImageBitmap(new Blob([bytesOf(view)], { type: "image/jpeg" }));
}

function saved(name: string, type: string, view: DataView): void {
  const address = URL.createObjectURL(new Blob([bytesOf(view)], { type }));
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

/** What carries messages: a WebSocket of the server, or the model of a notebook's widget. */

import type { FromHost, Where } from "./protocol";

/** A message goes as JSON, its arrays of bytes beside it. */
export interface Host {
  send(message: object, buffers?: ArrayBuffer[]): void;
  onmessage: (message: FromHost, buffers: DataView[]) => void;
  onstate: (state: "open" | "closed" | "silent") => void;
  /** What is said while it is not open, the first time and later. */
  readonly awaited: string;
  readonly lost: string;
  /** Values of a drag that may be under way at once: it takes the newest of them. */
  readonly ahead: number;
  /** Why the other side closed the connection, if it said so. */
  readonly why: string | null;
  /** Begins; handlers are set before. */
  start(): void;
  /** Ends for good. */
  close(): void;
}

/** One frame: length of the JSON (uint32, little-endian), the JSON, then the buffers, whose lengths the JSON has. */
export function packed(message: object, buffers: ArrayBuffer[] = []): ArrayBuffer {
  const json = new TextEncoder().encode(JSON.stringify({ ...message, buffers: buffers.map((each) => each.byteLength) }));
  const total = buffers.reduce((sum, each) => sum + each.byteLength, 4 + json.length);
  const frame = new Uint8Array(total);
  new DataView(frame.buffer).setUint32(0, json.length, true);
  frame.set(json, 4);
  let at = 4 + json.length;
  for (const each of buffers) {
    frame.set(new Uint8Array(each), at);
    at += each.byteLength;
  }
  return frame.buffer;
}

export function unpacked(frame: ArrayBuffer): { message: FromHost; buffers: DataView[] } {
  const length = new DataView(frame).getUint32(0, true);
  const message = JSON.parse(new TextDecoder().decode(new Uint8Array(frame, 4, length)));
  let at = 4 + length;
  const buffers = (message.buffers ?? []).map((size: number) => {
    const view = new DataView(frame, at, size);
    at += size;
    return view;
  });
  return { message, buffers };
}

/** What the server takes of one message, bytes: `LARGEST_MESSAGE` of vcc/bench/server.py, which closes at more. */
const LARGEST_MESSAGE = 2 ** 25;
/** Close codes of vcc/bench/server.py, and of WebSockets: what to say, and whether another try may help. */
const CLOSED: { [code: number]: { words: string; again: boolean } } = {
  4403: { words: "This address lacks the token of the bench, or has that of an earlier one: open the address that vcc bench printed.", again: false },
  1013: { words: "The bench has no room for another client, or this one read too slowly. It tries again.", again: true },
  1008: { words: "The bench did not understand this page and closed the connection: reload the page.", again: false },
  1009: { words: `A message was too large: a bench takes up to ${LARGEST_MESSAGE / 2 ** 20} MiB at once. Reload the page, or open the camera as a file.`, again: false },
};
const FIRST_WAIT = 300;
const LONGEST_WAIT = 10_000;

/** What is read of a message that is not sent. */
type Sent = { do: string; turn?: number; where?: Where | null; name?: string };

/** Connects to the server, and again whenever it was lost, a little later each time. */
export class SocketHost implements Host {
  onmessage: Host["onmessage"] = () => {};
  onstate: Host["onstate"] = () => {};
  readonly awaited = "Waiting for the server …";
  readonly lost = "The server is gone. What you see stays; the bench goes on when the server is back.";
  /** More would wait in a busy page as pictures that are old when they are drawn. */
  readonly ahead = 4;
  why: string | null = null;
  private socket: WebSocket | null = null;
  private wait = FIRST_WAIT;
  private timer = 0;
  private ended = false;
  /** By which the server knows this client again, with its steps and what it has pinned. */
  private key = "";

  constructor(private readonly address: string) {}

  start(): void {
    const address = new URL(this.address);
    if (this.key) address.searchParams.set("key", this.key);
    const socket = new WebSocket(address);
    socket.binaryType = "arraybuffer";
    this.socket = socket;
    socket.onmessage = (event) => {
      const { message, buffers } = unpacked(event.data as ArrayBuffer);
      if (message.is !== "key") {
        if (message.is === "picture") this.wait = FIRST_WAIT; // only what works ends the backing off
        this.onmessage(message, buffers);
        return;
      }
      this.key = message.key;
      this.onstate("open");
    };
    socket.onclose = ({ code }) => {
      this.socket = null;
      if (this.ended) return;
      const why = CLOSED[code];
      this.why = why?.words ?? null;
      this.onstate("closed");
      if (why && !why.again) return;
      this.timer = window.setTimeout(() => this.start(), this.wait);
      this.wait = Math.min(2 * this.wait, LONGEST_WAIT);
    };
  }

  send(message: object, buffers: ArrayBuffer[] = []): void {
    if (this.socket?.readyState !== WebSocket.OPEN) return;
    const frame = packed(message, buffers);
    if (frame.byteLength <= LARGEST_MESSAGE) this.socket.send(frame);
    else this.refuse(message as Sent, frame.byteLength);
  }

  /** Say what is too large; a greeting goes without its document, so that the bench goes on with what the server has. */
  private refuse(message: Sent, bytes: number): void {
    const greets = message.do === "hello";
    const what = greets ? "The camera of this page" : message.do === "upload" ? `The file ${message.name ?? ""}`.trim() : "What was to be sent";
    const end = greets ? "the bench shows the server's" : "nothing was changed: make it smaller, or name the file in the camera file that the bench is started with";
    const words = `${what} has ${(bytes / 2 ** 20).toFixed(1)} MiB, and a bench takes up to ${LARGEST_MESSAGE / 2 ** 20} MiB at once; ${end}.`;
    this.onmessage({ is: "refused", words, where: message.where ?? null, do: message.do, turn: message.turn ?? 0 }, []);
    if (greets) this.send({ ...message, document: undefined });
  }

  close(): void {
    this.ended = true;
    window.clearTimeout(this.timer);
    this.socket?.close();
  }
}

/** After so long without a word from Python it is said that it does not answer, milliseconds. */
const SILENCE = 4000;

/** What a widget's model has that is used here; anywidget's has more. */
export interface WidgetModel {
  send(content: object, callbacks?: undefined, buffers?: ArrayBuffer[]): unknown;
  on(name: "msg:custom", handler: (message: FromHost | Heard, buffers?: DataView[]) => void): void;
  off(name: "msg:custom", handler: (message: FromHost | Heard, buffers?: DataView[]) => void): void;
}

/** Python says at once that it heard something; what it makes of it may take longer. */
interface Heard {
  is: "heard";
}

export class WidgetHost implements Host {
  onmessage: Host["onmessage"] = () => {};
  onstate: Host["onstate"] = () => {};
  readonly awaited = "Waiting for Python …";
  readonly lost = "Python does not answer: it runs a cell, and then the bench goes on; or it was restarted, and then the cell of the bench is to be run again.";
  /** A kernel answers each message by several, and each that waits delays those after it. */
  readonly ahead = 2;
  readonly why = null;
  private timer = 0;
  private silent = false;
  private readonly hears = (message: FromHost | Heard, buffers?: DataView[]) => {
    window.clearTimeout(this.timer);
    this.timer = 0;
    if (this.silent) this.onstate("open");
    this.silent = false;
    if (message.is !== "heard") this.onmessage(message, buffers ?? []);
  };

  constructor(private readonly model: WidgetModel) {}

  start(): void {
    this.model.on("msg:custom", this.hears);
    this.onstate("open");
  }

  send(message: object, buffers: ArrayBuffer[] = []): void {
    if (!this.timer) this.timer = window.setTimeout(() => this.hearNothing(), SILENCE);
    void this.carry(message, buffers);
  }

  close(): void {
    window.clearTimeout(this.timer);
    this.model.off("msg:custom", this.hears);
  }

  /** Some hosts throw where the kernel is gone, some reject, some say nothing. */
  private async carry(message: object, buffers: ArrayBuffer[]): Promise<void> {
    try {
      await this.model.send(message, undefined, buffers);
    } catch {
      this.hearNothing();
    }
  }

  private hearNothing(): void {
    window.clearTimeout(this.timer);
    this.timer = 0;
    this.silent = true;
    this.onstate("silent");
  }
}

/** A host made up in the browser, for work on the front end and its tests: thin lenses, and pictures blurred by defocus. */

import type { Host } from "../src/host";
import { inMillimetres, metres, short } from "../src/numbers";
import type { BenchDocument, FromHost, Kind, Parameter, Rays, Side, SideElement, Snap, Table, Value, Where } from "../src/protocol";

const DEPTHS = [0.6, 1.2, 4];

const DOCUMENT: BenchDocument = {
  camera: {
    elements: [
      { kind: "lens", name: "main", z: "0 mm", focal_length: "50 mm", diameter: "20 mm" },
      { kind: "mask", name: "code", z: "30 mm", pattern: [[1, 0, 1, 1], [0, 1, 0, 1], [1, 1, 0, 0], [1, 0, 1, 0]], width: "12 mm" },
      { kind: "diffuser", z: "42 mm", kernel: { name: "gaussian", sigma: 0.01 }, diameter: "18 mm" },
    ],
    sensor: { z: "52.17 mm", shape: [400, 500], pitch: "30 um" },
  },
  light_field: "desk", views: null, aperture: { z: "0 mm", decentre: ["0 mm", "0 mm"] }, exposure: null, noise: false,
};

function parameter(name: string, unit: Parameter["unit"], takes: Parameter["takes"], more: Partial<Parameter> = {}): Parameter {
  return { name, unit, takes, words: "", needed: true, default: null, choices: [], ...more };
}

const maybe = { needed: false };
const COMMON = [
  parameter("z", "length", ["number"], { ...maybe, default: "0 m" }),
  parameter("decentre", "length", ["list"], { ...maybe, default: ["0 m", "0 m"] }),
  parameter("name", null, ["text"], { ...maybe, default: "" }),
];
const length = (name: string, more: Partial<Parameter> = {}) => parameter(name, "length", ["number"], more);

const KINDS: Kind[] = [
  { kind: "lens", words: "A thin lens.", parameters: [...COMMON, length("focal_length"), length("diameter", maybe)] },
  { kind: "mask", words: "A mask.", parameters: [...COMMON, parameter("pattern", null, ["array", "name"], { family: "pattern" }), length("width", maybe)] },
  { kind: "diffuser", words: "A diffuser.", parameters: [...COMMON, parameter("kernel", null, ["array", "name"], { family: "kernel" }), length("diameter", maybe), parameter("normalise", null, ["truth"], { ...maybe, default: false })] },
  { kind: "lens_array", words: "An array of lenslets.", parameters: [...COMMON, length("pitch"), length("focal_length"), parameter("layout", null, ["text"], { ...maybe, default: "square", choices: ["square", "hexagonal"] })] },
];

const PARTS: FromHost = {
  is: "parts",
  light_fields: ["desk", "scene"],
  kinds: KINDS,
  families: {
    pattern: [{ kind: "circle", words: "A round hole.", parameters: [length("diameter")] }, { kind: "cells", words: "Cells.", parameters: [parameter("values", null, ["array"]), length("width")] }],
    kernel: [{ kind: "gaussian", words: "", parameters: [parameter("sigma", null, ["number"])] }, { kind: "top_hat", words: "", parameters: [parameter("width", null, ["number"])] }],
  },
  sensor: [length("z"), parameter("shape", null, ["list"]), length("pitch"), parameter("fill_factor", null, ["number"], { ...maybe, default: 1 }), parameter("electronics", null, ["table"], { ...maybe, parameters: [parameter("full_well", null, ["number"], { ...maybe, default: 10000 })] })],
  gallery: ["A conventional camera", "A plenoptic camera"],
};

type Message = { do: string; turn?: number; [name: string]: unknown };

export class MockHost implements Host {
  onmessage: Host["onmessage"] = () => {};
  onstate: Host["onstate"] = () => {};
  readonly awaited = "Waiting for the mock …";
  readonly lost = "The mock is gone.";
  private document = DOCUMENT;
  private before: BenchDocument | null = null;
  private past: BenchDocument[] = [];
  private future: BenchDocument[] = [];
  private gone = false;
  private pinned = false;

  start(): void {
    window.setTimeout(() => this.onstate("open"), 0);
  }

  close(): void {
    this.gone = true;
  }

  /** For tests: the host goes, and comes back as one that has never heard of this client. */
  lose(): void {
    this.gone = true;
    this.document = DOCUMENT;
    this.past = this.future = [];
    this.onstate("closed");
  }

  comeBack(): void {
    this.gone = false;
    this.onstate("open");
  }

  send(message: object): void {
    const asked = structuredClone(message) as Message;
    window.setTimeout(() => {
      if (!this.gone) void this.receive(asked);
    }, 2);
  }

  private async receive(asked: Message): Promise<void> {
    const turn = asked.turn ?? 0;
    switch (asked.do) {
      case "hello":
        if (asked["document"]) this.document = asked["document"] as BenchDocument;
        this.onmessage(PARTS, []);
        break;
      case "set":
        if (!this.set(asked["where"] as Where, asked["value"] as Value, asked["moving"] === true, turn)) return;
        break;
      case "add":
        this.change((elements) => elements.push({ kind: asked["kind"] as string, z: asked["z"] as string, ...NEW[asked["kind"] as string] }));
        break;
      case "remove":
        this.change((elements) => elements.splice(asked["element"] as number, 1));
        break;
      case "duplicate":
        this.change((elements) => elements.push(structuredClone(elements[asked["element"] as number]!)));
        break;
      case "reorder":
        this.change((elements) => {
          const order = elements.map((_, each) => each).sort((one, other) => metres(elements[one]!["z"]) - metres(elements[other]!["z"]));
          const one = asked["element"] as number;
          const other = order[order.indexOf(one) + (asked["by"] as number)];
          if (other !== undefined) [elements[one]!["z"], elements[other]!["z"]] = [elements[other]!["z"]!, elements[one]!["z"]!];
        });
        break;
      case "undo":
      case "redo": {
        const [from, to] = asked.do === "undo" ? [this.past, this.future] : [this.future, this.past];
        const other = from.pop();
        if (other) {
          to.push(this.document);
          this.document = other;
        }
        break;
      }
      case "load":
        if (asked["document"]) this.put(asked["document"] as BenchDocument);
        break;
      case "focus":
        this.put(patched(this.document, ["camera", "sensor", "z"], inMillimetres(this.sharp(DEPTHS[Math.min(2, Math.floor((asked["x"] as number) / 170))]!) ?? 0.05)));
        break;
      case "pin":
        this.pinned = asked["on"] === true;
        this.onmessage({ is: "pinned" }, this.pinned ? [await this.jpeg(false)] : []);
        return;
      case "value": {
        const { x, y } = asked as unknown as { x: number; y: number };
        this.onmessage({ is: "value", x, y, irradiance: [x / 500, y / 400, 0.25], recorded: this.document.noise ? [x, y, 9] : null }, []);
        return;
      }
      case "ask":
        this.answered(asked["what"] as string);
        return;
      default:
        return;
    }
    await this.answer(turn, asked["moving"] === true);
  }

  private answered(what: string): void {
    if (what === "mtf") {
      const curve = (width: number) => Array.from({ length: 60 }, (_, at): [number, number] => [at / 4, Math.exp(-((at / width) ** 2))]);
      this.onmessage({ is: "answer", what: "mtf", across: curve(20), down: curve(28), distance: 1.2 }, []);
    } else this.onmessage({ is: "answer", what: "explain", words: `The sensor stands at ${String(this.document.camera.sensor["z"])}.` }, []);
  }

  private set(where: Where, value: Value, moving: boolean, turn: number): boolean {
    const path = where[0] === "elements" || where[0] === "sensor" ? ["camera", ...where] : where;
    if (["z", "pitch", "focal_length", "diameter", "width"].includes(String(where[where.length - 1])) && value !== null && Number.isNaN(metres(value))) {
      this.onmessage({ is: "refused", words: `${String(where[where.length - 1])} is a length such as "41.5 mm", not ${JSON.stringify(value)}`, where, turn }, []);
      return false;
    }
    this.before ??= this.document;
    this.document = patched(this.document, path, value);
    if (!moving) {
      this.past.push(this.before);
      this.future = [];
      this.before = null;
    }
    return true;
  }

  private put(document: BenchDocument): void {
    this.past.push(this.document);
    this.future = [];
    this.document = document;
  }

  private change(how: (elements: Table[]) => void): void {
    const copy = structuredClone(this.document);
    how((copy.camera.elements ??= []));
    this.put(copy);
  }

  private async answer(turn: number, moving: boolean): Promise<void> {
    this.onmessage({
      is: "state", turn, document: this.document, undo: this.past.length > 0, redo: this.future.length > 0, side: this.side(),
      grid: [9, 9],
    }, []);
    const began = performance.now();
    const bytes = await this.jpeg(moving);
    const [rows, columns] = this.document.camera.sensor["shape"] as [number, number];
    this.onmessage({
      is: "picture", turn, coarse: moving, moving, shape: [rows, columns], white: this.document.exposure ?? 1, missing: 0.012,
      took: performance.now() - began, psnr: this.pinned ? 31.4 : null,
    }, [bytes]);
    if (!moving) this.onmessage({ is: "notes", turn, notes: [{ element: 1, words: "The mask's cells are finer than the light field can show: ghosts appear behind it." }] }, []);
  }

  // --- thin lenses ---

  private get lenses(): { z: number; power: number; half: number }[] {
    return (this.document.camera.elements ?? [])
      .filter((each) => each["kind"] === "lens")
      .map((each) => ({ z: metres(each["z"]), power: 1 / metres(each["focal_length"]), half: each["diameter"] ? metres(each["diameter"]) / 2 : Infinity }))
      .sort((one, other) => one.z - other.z);
  }

  /** A ray's points up to z, from the entrance plane on. */
  private traced(height: number, slope: number, end: number): [number, number, number][] {
    const points: [number, number, number][] = [];
    let [z, y, s] = [0, height, slope];
    for (const lens of this.lenses.filter((each) => each.z < end)) {
      y += s * (lens.z - z);
      z = lens.z;
      const through = Math.abs(y) <= lens.half;
      points.push([z, y, through ? 1 : 0]);
      if (!through) return points;
      s -= y * lens.power;
    }
    points.push([end, y + s * (end - z), 1]);
    return points;
  }

  /** Where the image of a point on the axis is. */
  private sharp(distance: number): number | null {
    const [far, high, slope] = [10, 1e-4, 1e-4 / distance];
    const points = this.traced(high, slope, far);
    const [[z, y], [end, last]] = [points[points.length - 2] ?? [0, high, 1], points[points.length - 1]!];
    const meets = z - (y * (end - z)) / (last - y);
    return meets > z && meets < 1 ? meets : null;
  }

  private side(): Side {
    const sensor = this.document.camera.sensor;
    const z = metres(sensor["z"]);
    const half = (metres(sensor["pitch"]) * (sensor["shape"] as number[])[0]!) / 2;
    const start = -0.45 * z;
    const snaps: Snap[] = DEPTHS.flatMap((distance) => {
      const place = this.sharp(distance);
      return place ? [{ z: place, words: `${short(distance)} sharp` }] : [];
    });
    const rays: Rays[] = ["near", "focused", "off axis"].map((colour, number) => {
      const distance = DEPTHS[number]!;
      const paths = [-4, -3, -2, -1, 0, 1, 2, 3, 4].map((each): [number, number, number][] => {
        const height = each * 2.4e-3;
        return [[start, height + (height / distance) * start, 1], ...this.traced(height, height / distance, z)];
      });
      return { colour, distance, words: `${["near", "middle", "far"][number]}: ${short(distance)}`, paths };
    });
    return {
      from: start, to: z, half: 0.0125, words: ["Sharp: 1.2 m."], rays, snaps, aperture: null,
      sensor: { z, half, decentre: 0, label: ["sensor", "500 × 400, 30 µm"] },
      elements: (this.document.camera.elements ?? []).map((each): SideElement => {
        const rim = each["diameter"] ?? each["width"];
        const size = rim ? metres(rim) / 2 : null;
        const kind = String(each["kind"]);
        const place = metres(each["z"]);
        const drawn = ({ lens: "lens", mask: "mask", diffuser: "frosted", lens_array: "glass" } as const)[kind] ?? "sheet";
        return {
          drawn, z: place, length: 0, decentre: 0, half: size, openings: size ? [[place, -size, size]] : [], label: [String(each["name"] || kind), String(each["focal_length"] ?? rim ?? "")],
          converging: metres(each["focal_length"] ?? 1) > 0,
          ...(kind === "mask" ? { shades: [-3, -2, -1, 0, 1, 2].map((cell): [number, number, number] => [cell * 2e-3, (cell + 1) * 2e-3, cell & 1]) } : {}),
          ...(kind === "lens_array" ? { profile: Array.from({ length: 241 }, (_, at): [number, number] => [-0.012 + at * 1e-4, 1 - (((at % 12) - 6) / 6) ** 2]) } : {}),
          ...(kind === "diffuser" ? { roughness: [[0, 1]] as [number, number][] } : {}),
        };
      }),
    };
  }

  private async jpeg(coarse: boolean): Promise<DataView> {
    const [rows, columns] = this.document.camera.sensor["shape"] as [number, number];
    const scale = coarse ? 0.5 : 1;
    const canvas = new OffscreenCanvas(columns * scale, rows * scale);
    const context = canvas.getContext("2d")!;
    context.scale(scale, scale);
    context.fillStyle = "#39424a";
    context.fillRect(0, 0, columns, rows);
    const z = metres(this.document.camera.sensor["z"]);
    DEPTHS.forEach((distance, number) => {
      const away = Math.abs((this.sharp(distance) ?? 1) - z) * 8e3 * scale;
      context.filter = away > 0.2 ? `blur(${Math.min(away, 40)}px)` : "none";
      context.fillStyle = ["#e8a33d", "#d8d4c8", "#6aa7d8"][number]!;
      context.beginPath();
      context.arc(85 + 165 * number, 200, 62, 0, 7);
      context.fill();
      context.fillStyle = "#111";
      context.font = "600 30px sans-serif";
      context.textAlign = "center";
      context.fillText(short(distance), 85 + 165 * number, 210);
    });
    const blob = await canvas.convertToBlob({ type: "image/jpeg", quality: 0.9 });
    return new DataView(await blob.arrayBuffer());
  }
}

const NEW: { [kind: string]: Table } = {
  lens: { focal_length: "50 mm", diameter: "20 mm" },
  mask: { pattern: { name: "circle", diameter: "8 mm" } },
  diffuser: { kernel: { name: "gaussian", sigma: 0.01 } },
  lens_array: { pitch: "1 mm", focal_length: "4 mm" },
};

function patched(document: BenchDocument, path: Where, value: Value): BenchDocument {
  const copy = structuredClone(document);
  let at = copy as unknown as Record<string | number, unknown>;
  for (const step of path.slice(0, -1)) at = at[step] as Record<string | number, unknown>;
  const last = path[path.length - 1]!;
  if (value === null && path[0] === "camera") delete at[last];
  else at[last] = value;
  return copy;
}

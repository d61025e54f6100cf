/** What the module gives: the bench in an element of a page, on any host, and as a notebook's widget. */

import { Bench, type Options } from "./bench";
import { SocketHost, WidgetHost, type Host, type WidgetModel } from "./host";
import { register, type BenchFrame } from "./view";

const WIDGET_HEIGHT = "520px";

/** Put a bench into an element; what it returns takes it away again. */
export function mount(element: HTMLElement, host: Host, options: Options = {}): () => void {
  register();
  const bench = new Bench(host, options);
  const frame = document.createElement("vcc-bench") as BenchFrame;
  frame.bench = bench;
  element.append(frame);
  bench.start();
  return () => {
    bench.close();
    frame.remove();
  };
}

/** The bench of the server that this page came from, with the document in the address. */
function mountServed(element: HTMLElement): () => void {
  const address = new URL("bench", window.location.href);
  address.protocol = address.protocol.replace("http", "ws");
  address.hash = "";
  const token = new URLSearchParams(window.location.search).get("token");
  address.search = token === null ? "" : `?token=${encodeURIComponent(token)}`;
  return mount(element, new SocketHost(address.href), { address: true });
}

/** JupyterLab and VS Code have themes of their own, which need not be the system's. */
function themed(): string {
  const { body } = document;
  if (body.dataset["jpThemeLight"] === "true" || body.classList.contains("vscode-light")) return "light";
  if (body.dataset["jpThemeLight"] === "false" || body.classList.contains("vscode-dark")) return "dark";
  return "";
}

function render({ model, el }: { model: WidgetModel; el: HTMLElement }): () => void {
  const room = document.createElement("div");
  room.style.cssText = `width: 100%; height: ${el.style.height || WIDGET_HEIGHT}`;
  // Keys that mean something on the bench mean nothing to JupyterLab while they are pressed there.
  room.dataset["lmSuppressShortcuts"] = "true";
  const theme = themed();
  if (theme) room.style.setProperty("--bench-scheme", theme);
  el.append(room);
  const end = mount(room, new WidgetHost(model));
  return end;
}

/** The server's page has a place for the bench; a notebook has none, and calls `render`. */
const place = document.querySelector<HTMLElement>("main[data-vcc-bench]");
if (place) mountServed(place);

export default { render };

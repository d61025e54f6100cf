/** What the module gives: the bench in an element of a page, on any host, and as a notebook's widget. */

import { Bench, type Options } from "./bench";
import { SocketHost, WidgetHost, type Host, type WidgetModel } from "./host";
import { settled } from "./room";
import { register, type BenchFrame } from "./view";

/** Put a bench into an element of a page; what it returns takes it away again. */
export function mount(element: HTMLElement, host: Host, options: Options = {}): () => void {
  const bench = new Bench(host, options);
  const leave = show(element, bench);
  bench.start();
  return () => {
    bench.close();
    leave();
  };
}

function show(element: HTMLElement, bench: Bench): () => void {
  register();
  const frame = document.createElement("vcc-bench") as BenchFrame;
  frame.bench = bench;
  element.append(frame);
  return () => frame.remove();
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

/** The server's page has a place for the bench; a notebook has none, and takes the widget. */
const place = document.querySelector<HTMLElement>("main[data-vcc-bench]");
if (place) mountServed(place);

/** A widget, made once for each model: one bench, which all cells that show it share. */
export default () => {
  let bench: Bench;
  let started = false;
  return {
    initialize({ model }: { model: WidgetModel }): () => void {
      bench = new Bench(new WidgetHost(model));
      return () => bench.close();
    },
    render({ el }: { el: HTMLElement }): () => void {
      const room = document.createElement("div");
      const leaveRoom = settled(room);
      el.append(room);
      const leave = show(room, bench);
      if (!started) bench.start();
      started = true;
      return () => {
        leave();
        leaveRoom();
        room.remove();
      };
    },
  };
};

/** The bench on the mock host; the host is there for tests and for hands. */

import { mount } from "../src/main";
import { MockHost } from "./host";

const host = new MockHost();
mount(document.getElementById("bench")!, host, { address: true });
Object.assign(window, { mock: host });

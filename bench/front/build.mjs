// The one bundle of the bench, from its sources: `npm run build` writes it where the Python package has it,
// `node build.mjs --to FILE` elsewhere.
import { build } from "esbuild";
import { dirname, resolve } from "node:path";
import { fileURLToPath } from "node:url";

const here = dirname(fileURLToPath(import.meta.url));
const asked = process.argv.indexOf("--to");
await build({
  absWorkingDir: here, bundle: true, format: "esm", target: "es2022", minify: true, charset: "utf8", legalComments: "inline",
  entryPoints: ["src/main.ts"],
  outfile: asked > 0 ? resolve(process.argv[asked + 1]) : resolve(here, "../../src/vcc/bench/static/bench.js"),
});

// The one bundle of the bench, from its sources: `npm run build` writes it where the Python package has it,
// `node build.mjs --to FILE` elsewhere, `npm run mock` writes build/mock.html, the bench on a host made up in the browser.
import { build } from "esbuild";
import { mkdir, writeFile } from "node:fs/promises";
import { dirname, resolve } from "node:path";
import { fileURLToPath } from "node:url";

const here = dirname(fileURLToPath(import.meta.url));
const shared = {
  absWorkingDir: here, bundle: true, format: "esm", target: "es2022", minify: true, charset: "utf8", legalComments: "inline",
};

if (process.argv.includes("--mock")) {
  const made = await build({ ...shared, entryPoints: ["mock/page.ts"], write: false });
  await mkdir(resolve(here, "build"), { recursive: true });
  const script = made.outputFiles[0].text.replaceAll("</script", "<\\/script");
  await writeFile(
    resolve(here, "build/mock.html"),
    `<!doctype html><html lang="en"><meta charset="utf-8"><meta name="viewport" content="width=device-width">` +
      `<title>bench on a mock</title><style>html,body{margin:0;height:100%}#bench{height:100%}</style>` +
      `<body><main id="bench"></main><script type="module">${script}</script>`,
  );
} else {
  const asked = process.argv.indexOf("--to");
  const outfile = asked > 0 ? resolve(process.argv[asked + 1]) : resolve(here, "../../src/vcc/bench/static/bench.js");
  await build({ ...shared, entryPoints: ["src/main.ts"], outfile });
}

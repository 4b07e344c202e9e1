// usage: node check.js RESULTS [PYTHON]
//
// 1. Khronos' gltf-validator on every .gltf and .glb of a result folder: no error, no warning.
// 2. scene.glb in a stock three.js viewer in headless Chromium: as many meshes, triangles and textures as the file says,
//    and at points of lit walls and of the lamps the colours that the bake's own arrays ask for (expected.py).
// 3. The page asks for nothing outside itself.
// Exit status 1 and one line a fault otherwise.  CHROMIUM names the browser where it is not /usr/bin/chromium.
import { execFileSync } from "node:child_process";
import { existsSync, readFileSync, readdirSync } from "node:fs";
import path from "node:path";
import { fileURLToPath } from "node:url";

import { build } from "esbuild";
import validator from "gltf-validator";
import { chromium } from "playwright-core";

const HERE = path.dirname(fileURLToPath(import.meta.url));
const ROOT = path.join(HERE, "..", "..");
const [results, python = path.join(ROOT, ".venv", "bin", "python")] = process.argv.slice(2);
const faults = [];

async function validate(file) {
  const report = await validator.validateBytes(new Uint8Array(readFileSync(file)), {
    uri: path.basename(file),
    maxIssues: 0,
    externalResourceFunction: async (uri) =>
      new Uint8Array(readFileSync(path.join(path.dirname(file), decodeURIComponent(uri)))),
  });
  const { numErrors, numWarnings, messages } = report.issues;
  console.log(`${path.basename(file)}: ${numErrors} errors, ${numWarnings} warnings (gltf-validator)`);
  for (const { code, severity, message, pointer } of messages.filter((m) => m.severity < 2).slice(0, 10)) {
    faults.push(`${path.basename(file)}: ${severity ? "warning" : "error"} ${code} ${pointer}: ${message}`);
  }
}

async function page_of_viewer() {
  const bundle = await build({
    entryPoints: [path.join(HERE, "viewer.js")],
    bundle: true,
    minify: true,
    format: "iife",
    write: false,
  });
  const script = bundle.outputFiles[0].text.replaceAll("</script", "<\\/script");
  return `<!doctype html><meta charset="utf-8"><body><script>${script}</script></body>`;
}

function probes() {
  const script = path.join(HERE, "expected.py");
  const env = { ...process.env, PYTHONPATH: ROOT };
  return JSON.parse(execFileSync(python, [script, results], { env, encoding: "utf8", maxBuffer: 1 << 26 }));
}

async function view() {
  const executablePath = process.env.CHROMIUM ?? "/usr/bin/chromium";
  if (!existsSync(executablePath)) {
    faults.push(`no browser at ${executablePath}: install chromium, or name it in CHROMIUM`);
    return;
  }
  const expected = probes();
  const browser = await chromium.launch({
    executablePath,
    args: ["--no-sandbox", "--use-angle=swiftshader", "--enable-unsafe-swiftshader"],
  });
  try {
    const page = await browser.newPage();
    const outside = [];
    page.on("request", (request) => /^(data|blob|about):/.test(request.url()) || outside.push(request.url()));
    page.on("pageerror", (error) => faults.push(`page: ${error.message}`));
    page.on("console", (message) => message.type() === "error" && faults.push(`page: ${message.text()}`));
    await page.setContent(await page_of_viewer());
    await page.evaluate((bytes) => window.open_model(bytes), readFileSync(path.join(results, "scene.glb"), "base64"));
    const failed = await page.evaluate(() => window.model_error);
    if (failed) throw new Error(failed);
    const model = await page.evaluate(() => ({ ...window.model, colour: undefined }));
    console.log(`scene.glb: ${model.meshes.length} meshes, ${model.triangles} triangles, ${model.textures} textures (three.js)`);
    for (const [what, n] of Object.entries(expected.counts)) {
      const found = what === "meshes" ? model.meshes.length : model[what];
      if (found !== n) faults.push(`scene.glb: ${found} ${what} in the viewer, ${n} in the bake`);
    }
    let worst = 0;
    for (const probe of expected.probes) {
      const seen = await page.evaluate((p) => window.model.colour(p), probe);
      const off = Math.max(...seen.map((c, k) => Math.abs(c - probe.rgb[k])));
      worst = Math.max(worst, off);
      if (off > probe.within) {
        faults.push(`scene.glb: ${probe.name}: rgb ${seen} in the viewer, ${probe.rgb} (within ${probe.within}) baked`);
      }
    }
    const n = new Set(expected.probes.map((p) => p.name)).size;
    console.log(`scene.glb: ${expected.probes.length} points on ${n} surfaces, at most ${worst} of 255 off`);
    for (const url of outside) faults.push(`the page asked for ${url}`);
  } finally {
    await browser.close();
  }
}

if (!results || !existsSync(path.join(results, "scene.glb"))) {
  console.error(`usage: node check.js RESULTS [PYTHON]; no scene.glb in ${results}`);
  process.exit(2);
}
for (const name of readdirSync(results).sort()) {
  if (/\.(gltf|glb)$/.test(name)) await validate(path.join(results, name));
}
await view();
for (const fault of faults) console.error(fault);
process.exit(faults.length ? 1 : 0);

// Builds crates/artgs-view/dist/ from src/. `--check` builds into memory and fails if the committed bundle differs; CI runs
// it so that the bundle always matches the committed sources.
import { build } from "esbuild";
import { createHash } from "node:crypto";
import { readFileSync, readdirSync, writeFileSync, mkdirSync } from "node:fs";
import { gzipSync } from "node:zlib";

const MOST = 2 * 1024 * 1024;
// Inside the crate that embeds it, so that the packaged crate is complete.
const DIST = "../crates/artgs-view/dist";

/** Hash of the names and contents of all sources of the bundle. */
function sourcesHash() {
  const files = [...readdirSync("src").map((f) => `src/${f}`), "package.json", "package-lock.json", "build.mjs"].sort();
  const hash = createHash("sha256");
  for (const file of files) hash.update(file).update("\0").update(readFileSync(file)).update("\0");
  return hash.digest("hex");
}

const { outputFiles } = await build({
  entryPoints: { viewer: "src/main.ts" },
  bundle: true,
  format: "esm",
  target: "es2022",
  minify: true,
  charset: "utf8",
  legalComments: "none",
  banner: {
    js: "/* artgs viewer, MIT OR Apache-2.0. Contains three.js (MIT, three.js authors) and Spark (MIT, World Labs). */",
  },
  loader: { ".css": "css" },
  outdir: DIST,
  write: false,
});
const built = new Map(outputFiles.map((f) => [f.path.split("/").pop(), Buffer.from(f.contents)]));
// The source of Spark's worker is a string that names a missing source map; browsers would request it.
const script = built.get("viewer.js").toString().replaceAll(/\/\/# sourceMappingURL=[\w.-]+/g, "");
if (script.includes("sourceMappingURL")) throw new Error("the bundle still names a source map");
built.set("viewer.js", Buffer.from(script));
built.set("index.html", readFileSync("src/index.html"));
built.set("sources.sha256", Buffer.from(`${sourcesHash()}\n`));

const packed = [...built.values()].reduce((sum, bytes) => sum + gzipSync(bytes, { level: 9 }).length, 0);
if (packed >= MOST) throw new Error(`the page is ${packed} bytes gzipped, above ${MOST}`);
if (process.argv.includes("--check")) {
  const stale = [...built].filter(([name, bytes]) => {
    try {
      return !readFileSync(`${DIST}/${name}`).equals(bytes);
    } catch {
      return true;
    }
  });
  if (stale.length > 0) {
    console.error(`crates/artgs-view/dist differs from the sources: ${stale.map(([name]) => name).join(", ")}; run npm run build`);
    process.exit(1);
  }
} else {
  mkdirSync(DIST, { recursive: true });
  for (const [name, bytes] of built) writeFileSync(`${DIST}/${name}`, bytes);
}
console.log(`${packed} bytes gzipped`);

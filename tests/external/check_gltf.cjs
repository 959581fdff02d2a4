// Asks the Khronos validator: node check_gltf.cjs FILE.glb… with the npm package gltf-validator beside it or in
// NODE_PATH. Fails on any error or warning, and on a file without an animation or without a skin.
const fs = require("fs");
const validator = require("gltf-validator");

async function check(path) {
  const report = await validator.validateBytes(new Uint8Array(fs.readFileSync(path)), { maxIssues: 0 });
  const { numErrors, numWarnings, messages } = report.issues;
  const info = report.info;
  console.log(
    `${path}: ${numErrors} errors, ${numWarnings} warnings; ${info.drawCallCount} draw calls, ` +
      `${info.totalTriangleCount} triangles, ${info.animationCount} animations, skins ${info.hasSkins}`,
  );
  for (const m of messages.filter((m) => m.severity < 2)) console.log(`  ${m.code} ${m.pointer}: ${m.message}`);
  const kinds = new Set(messages.filter((m) => m.severity >= 2).map((m) => m.code));
  if (kinds.size > 0) console.log(`  hints: ${[...kinds].join(", ")}`);
  return numErrors + numWarnings === 0 && info.animationCount === 1 && info.hasSkins;
}

(async () => {
  let good = process.argv.length > 2;
  for (const path of process.argv.slice(2)) good = (await check(path)) && good;
  process.exit(good ? 0 : 1);
})();

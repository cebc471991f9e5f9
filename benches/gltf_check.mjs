// Validates glTF files by Khronos' validator: a line for each, exit code 1 if one has an error.
//
//   npm install --no-save gltf-validator
//   node benches/gltf_check.mjs FILES...
import { createRequire } from "node:module";
import { readFileSync } from "node:fs";
import { dirname, resolve } from "node:path";

const validator = createRequire(resolve("package.json"))("gltf-validator");
let errors = 0;
for (const file of process.argv.slice(2)) {
  const beside = (uri) => Promise.resolve(new Uint8Array(readFileSync(resolve(dirname(file), uri))));
  const bytes = new Uint8Array(readFileSync(file));
  const { issues } = await validator.validateBytes(bytes, { externalResourceFunction: beside });
  const codes = [...new Set(issues.messages.filter((m) => m.severity < 2).map((m) => m.code))];
  console.log(`${file}: ${issues.numErrors} errors, ${issues.numWarnings} warnings ${codes.join(" ")}`);
  errors += issues.numErrors;
}
process.exit(errors > 0 || process.argv.length < 3 ? 1 : 0);

// run_micropython.mjs MODULE_FOLDER PROGRAM.py: runs a program under npm's MicroPython with the folder's modules.
// npm i @micropython/micropython-webassembly-pyscript@1.27, and NODE_PATH or MICROPYTHON at its folder.
import { readFileSync, readdirSync } from "node:fs";
import { join } from "node:path";
import { pathToFileURL } from "node:url";

const [, , folder, program] = process.argv;
const { loadMicroPython } = await import(pathToFileURL(join(process.env.MICROPYTHON, "micropython.mjs")).href);
const python = await loadMicroPython({ stdout: (line) => console.log(line), linebuffer: true, heapsize: 4 * 1024 * 1024 });
for (const name of readdirSync(folder)) {
  if (name.endsWith(".py")) python.FS.writeFile("/" + name, readFileSync(join(folder, name)));
}
python.runPython("import sys\nsys.path.append('/')\n" + readFileSync(program, "utf8"));

// The TextMate grammar over every shipped file: numbers have their units, statements their keyword, and no line is left
// without a colour that should have one. Run: node test/grammar.js
const fs = require("fs");
const path = require("path");
const assert = require("assert");
const oniguruma = require("vscode-oniguruma");
const { Registry, parseRawGrammar } = require("vscode-textmate");

const here = path.join(__dirname, "..");
const root = path.join(here, "..", "..");

function files(folder) {
  return fs.readdirSync(folder, { withFileTypes: true }).flatMap((entry) => {
    const inner = path.join(folder, entry.name);
    return entry.isDirectory() ? files(inner) : inner.endsWith(".mech") ? [inner] : [];
  });
}

async function main() {
  await oniguruma.loadWASM(fs.readFileSync(require.resolve("vscode-oniguruma/release/onig.wasm")).buffer);
  const registry = new Registry({
    onigLib: Promise.resolve({
      createOnigScanner: (patterns) => new oniguruma.OnigScanner(patterns),
      createOnigString: (text) => new oniguruma.OnigString(text),
    }),
    loadGrammar: async () =>
      parseRawGrammar(fs.readFileSync(path.join(here, "syntaxes/mech.tmLanguage.json"), "utf8"), "mech.json"),
  });
  const grammar = await registry.loadGrammar("source.mech");
  const all = [...files(path.join(root, "examples")), ...files(path.join(root, "stdlib"))];
  assert(all.length > 20);
  let lines = 0;
  for (const file of all) {
    let stack = null;
    for (const line of fs.readFileSync(file, "utf8").split("\n")) {
      const { tokens, ruleStack } = grammar.tokenizeLine(line, stack);
      stack = ruleStack;
      lines += 1;
      const code = tokens.filter((t) => !t.scopes.some((s) => /^(comment|string)/.test(s)));
      for (const token of code) {
        const text = line.slice(token.startIndex, token.endIndex);
        const plain = token.scopes.length === 1;
        assert(!(plain && /(?<![\w.])\d/.test(text)), `${file}: a number without colour in ${line}`);
        assert(!(plain && /\b(mm|deg|MPa)\b/.test(text)), `${file}: a unit without colour in ${line}`);
      }
      const first = /^ {4}([a-z]+) [A-Za-z_]\w*( =|:| \{|\b)/.exec(line);
      if (first && !/^\s*\w+\s*=/.test(line)) {
        const token = tokens.find((t) => line.slice(t.startIndex, t.endIndex) === first[1]);
        assert(token && token.scopes.some((s) => s.startsWith("keyword")), `${file}: no keyword in ${line}`);
      }
    }
  }
  console.log(`${all.length} files, ${lines} lines`);
}

main().catch((error) => {
  console.error(error.message);
  process.exit(1);
});

// The extension activated as VS Code would, with the real language client and the real server (FLEXURA names the command;
// without it nothing is tried), in a stand-in for the part of VS Code's interface that both use. Run: node test/activation.js
const assert = require("assert");
const fs = require("fs");
const os = require("os");
const path = require("path");
const Module = require("module");
const { pathToFileURL, fileURLToPath } = require("url");

const flexura = process.env.FLEXURA;
if (!flexura) {
  console.log("SKIPPED: set FLEXURA to the flexura command to activate the extension");
  process.exit(0);
}

const DESIGN = `edition 1
use std.materials.rigur
use std.processes.polyjet
use std.motors.nema17
use std.flexures.leaf
use std.flexures.wire

mechanism flap {
    point O = (0 mm, 0 mm)
    point B = (-25 mm, 0 mm)
    point P = (30 mm, 0 mm)
    ground base { B, O }
    link   arm  { O, P }
    hinge bend: base to arm at O  into base toward B  into arm toward P  as leaf { thickness = free 0.8 mm in 0.6 mm .. 1.4 mm }
    material rigur
    print on polyjet
    cycle 4 steps over 1 s
    drive bend from 0 deg to 20 deg with nema17
    minimize { stress(below = 5 MPa) }
    export csv, report
}
`;
const folder = fs.realpathSync(fs.mkdtempSync(path.join(os.tmpdir(), "flexura-")));
const file = path.join(folder, "flap.mech");
fs.writeFileSync(file, DESIGN);

// ── the stand-in ───────────────────────────────────────────────────────────────────────────
const disposable = () => ({ dispose() {} });
class EventEmitter {
  constructor() {
    this.heard = new Set();
    this.event = (listener, self) => {
      const bound = listener.bind(self);
      this.heard.add(bound);
      return { dispose: () => this.heard.delete(bound) };
    };
  }
  fire(value) { [...this.heard].forEach((listener) => listener(value)); }
  dispose() { this.heard.clear(); }
}
class Uri {
  constructor(text) { this.text = text; this.scheme = text.split(":")[0]; this.path = new URL(text).pathname; }
  get fsPath() { return fileURLToPath(this.text); }
  toString() { return this.text; }
  static parse(text) { return new Uri(text); }
  static file(name) { return new Uri(pathToFileURL(name).href); }
}
class CancellationTokenSource {
  constructor() {
    this.emitter = new EventEmitter();
    this.token = { isCancellationRequested: false, onCancellationRequested: this.emitter.event };
  }
  cancel() { this.token.isCancellationRequested = true; this.emitter.fire(); }
  dispose() {}
}
class Disposable {
  constructor(dispose) { this.dispose = dispose; }
  static from(...all) { return new Disposable(() => all.forEach((one) => one.dispose())); }
}
class CodeActionKind {
  constructor(value) { this.value = value; }
  append(part) { return new CodeActionKind(this.value ? `${this.value}.${part}` : part); }
}
for (const [name, value] of [["Empty", ""], ["QuickFix", "quickfix"], ["Refactor", "refactor"], ["RefactorExtract", "refactor.extract"], ["RefactorInline", "refactor.inline"], ["RefactorRewrite", "refactor.rewrite"], ["Source", "source"], ["SourceOrganizeImports", "source.organizeImports"]])
  CodeActionKind[name] = new CodeActionKind(value);
class WorkspaceEdit {
  constructor() { this.changes = new Map(); }
  replace(uri, range, text) { this.changes.set(uri.toString(), [...(this.changes.get(uri.toString()) ?? []), [range, text]]); }
}
// What is only made and handed on: classes that keep what they are given.
const plain = (name) => ({ [name]: class { constructor(...given) { this.given = given; } } })[name];
const lenient = (own, missing) =>
  new Proxy(own, { get: (target, name) => (name in target || typeof name === "symbol" ? target[name] : (target[name] = missing(name))) });

const commands = new Map();
const providers = new Map();
const findings = new Map();
const shown = [];
const progress = [];
const applied = [];
const opened = [];
const document = {
  uri: Uri.file(file), fileName: file, languageId: "mech", version: 1, isDirty: false, eol: 1, lineCount: DESIGN.split("\n").length,
  getText: () => DESIGN, save: async () => true,
};
const say = async (message) => void shown.push(message);
const events = (name) => (name.startsWith("on") ? new EventEmitter().event : undefined);
const vscode = lenient(
  {
    version: "1.90.0", CodeActionKind, EventEmitter, WorkspaceEdit, Uri, CancellationTokenSource, Disposable,
    CancellationError: class extends Error {},
    env: { language: "en", appName: "stand-in", openExternal: async (uri) => opened.push(uri.toString()) > 0 },
    commands: {
      registerCommand(name, run) {
        assert(!commands.has(name), `${name} is registered twice`);
        commands.set(name, run);
        return { dispose: () => commands.delete(name) };
      },
    },
    tasks: { registerTaskProvider: (type, provider) => (providers.set(`task ${type}`, provider), disposable()) },
    TaskScope: { Workspace: 2, Global: 1 },
    ProgressLocation: { Window: 10, Notification: 15 },
    workspace: lenient(
      {
        textDocuments: [document], notebookDocuments: [], workspaceFolders: undefined,
        getConfiguration: (section) => ({
          get: (name, otherwise) => (section === "flexura" && name === "path" ? flexura : otherwise),
          has: () => false, inspect: () => undefined,
        }),
        getWorkspaceFolder: () => undefined,
        createFileSystemWatcher: () => lenient(disposable(), events),
        applyEdit: async (edit) => applied.push(edit) > 0,
        fs: { isWritableFileSystem: () => true },
      },
      events,
    ),
    languages: lenient(
      {
        match: (selector, d) => (d.languageId === "mech" ? 10 : 0),
        createDiagnosticCollection: () => ({
          set: (uri, all) => findings.set(uri.toString(), all), delete: (uri) => findings.delete(uri.toString()),
          clear() {}, dispose() {},
        }),
      },
      (name) => (...given) => (providers.set(name, given.find((one) => typeof one === "object" && !Array.isArray(one) && one !== null && Object.keys(one).some((k) => k.startsWith("provide")))), disposable()),
    ),
    window: lenient(
      {
        activeTextEditor: { document }, visibleTextEditors: [], tabGroups: { all: [], ...lenient({}, events), onDidChangeTabs: new EventEmitter().event, onDidChangeTabGroups: new EventEmitter().event },
        showInformationMessage: say, showErrorMessage: say, showWarningMessage: say,
        createOutputChannel: () => ({ append() {}, appendLine() {}, show() {}, clear() {}, dispose() {}, replace() {}, hide() {} }),
        withProgress: (options, work) => {
          progress.push(options.title);
          return work({ report: (step) => progress.push(step.message) }, new CancellationTokenSource().token);
        },
      },
      events,
    ),
  },
  plain,
);
const load = Module._load;
Module._load = (name, ...rest) => (name === "vscode" ? vscode : load(name, ...rest));

// ── what is asked of the extension ─────────────────────────────────────────────────────────
async function until(what, good) {
  for (let i = 0; i < 1200; i += 1) {
    if (good()) return;
    await new Promise((wait) => setTimeout(wait, 50));
  }
  throw new Error(`${what} never came; told: ${shown.join("; ")}`);
}

async function main() {
  const manifest = JSON.parse(fs.readFileSync(path.join(__dirname, "..", "package.json"), "utf8"));
  const extension = require(path.join(__dirname, "..", manifest.main));
  const context = { subscriptions: [] };
  await extension.activate(context);
  assert.deepStrictEqual(shown, [], "no complaint");

  // Every command of the palette is there, and a provider for what the server offers.
  for (const { command } of manifest.contributes.commands) assert(commands.has(command), `no ${command}`);
  for (const of of ["Hover", "CompletionItem", "Definition", "Reference", "Rename", "DocumentSymbol", "FoldingRange", "DocumentFormattingEdit", "CodeActions", "SignatureHelp", "InlayHints", "DocumentSemanticTokens", "CodeLens"])
    assert([...providers.keys()].some((name) => name.includes(of)), `no provider for ${of}: ${[...providers.keys()]}`);
  const tasks = providers.get("task flexura").provideTasks();
  assert.deepStrictEqual(tasks.map((task) => task.given[2]), ["check", "build", "test"]);

  await until("findings", () => (findings.get(document.uri.toString()) ?? []).length > 0);
  await commands.get("flexura.simulate")();
  assert(shown.some((text) => text.includes("bend needs")), shown.join("; "));
  const built = await commands.get("flexura.build")();
  assert(built.good && fs.existsSync(path.join(folder, "flap.lock")), JSON.stringify(built));
  assert(progress.some((text) => text?.startsWith("optimising")), progress.join("; "));
  await commands.get("flexura.showReport")();
  await until("the report", () => opened.some((uri) => uri.endsWith("/flap.html")));
  await commands.get("flexura.applyOptimised")();
  await commands.get("flexura.betterRest")();
  await until("edits", () => applied.length === 2);
  for (const edit of applied) assert.deepStrictEqual([[...edit.changes.keys()], [...edit.changes.values()][0].length], [[document.uri.toString()], 1]);
  await commands.get("flexura.restart")();
  assert(commands.has("flexura.build"), "after a restart the commands are there again");
  vscode.window.activeTextEditor = undefined;
  await commands.get("flexura.build")();
  assert(shown.at(-1).startsWith("Open a .mech file"), shown.at(-1));
  const count = commands.size;
  await extension.deactivate();
  console.log(`activated: ${count} commands, ${providers.size} providers; ${shown.filter((t) => t.includes("built"))[0]}`);
}

main()
  .then(() => fs.rmSync(folder, { recursive: true }))
  .catch((error) => {
    console.error(error);
    process.exit(1);
  });

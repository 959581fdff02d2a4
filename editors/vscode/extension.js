// Starts the language server, and gives its commands the file in the editor. What they do, the server does: builds and
// simulations show their progress, can be cancelled, and what they find stands in the margin.
const vscode = require("vscode");
const { LanguageClient } = require("vscode-languageclient/node");
const path = require("path");

let client;

const command = () => vscode.workspace.getConfiguration("flexura").get("path", "flexura");

// Of these the server reads the file on the disk.
const SAVED = new Set(["flexura.build", "flexura.showReport"]);

// The client registers the server's commands; from the palette they come without a file.
async function executeCommand(name, given, next) {
  let address = given?.[0];
  if (!address) {
    const document = vscode.window.activeTextEditor?.document;
    if (document?.languageId !== "mech") {
      vscode.window.showInformationMessage("Open a .mech file first.");
      return undefined;
    }
    address = document.uri.toString();
  }
  if (SAVED.has(name)) {
    const dirty = vscode.workspace.textDocuments.filter((d) => d.languageId === "mech" && d.isDirty);
    await Promise.all(dirty.map((d) => d.save()));
  }
  try {
    return await next(name, [address]);
  } catch (error) {
    vscode.window.showErrorMessage(`Flexura: ${error.message}`);
    return undefined;
  }
}

async function start() {
  const server = { command: command(), args: ["lsp"] };
  const options = {
    documentSelector: [{ scheme: "file", language: "mech" }],
    middleware: { executeCommand },
  };
  client = new LanguageClient("flexura", "Flexura", server, options);
  try {
    await client.start();
  } catch (error) {
    vscode.window.showErrorMessage(`Cannot start "${command()} lsp": ${error.message}. Set "flexura.path".`);
  }
}

// `flexura check`, `build` and `test` as tasks, whose findings go into the list of problems.
function task(verb, file, folder, definition) {
  const cwd = path.dirname(file);
  const execution = new vscode.ProcessExecution(command(), [verb, file], { cwd });
  return new vscode.Task(definition ?? { type: "flexura", command: verb }, folder, verb, "flexura", execution, "$flexura");
}

const tasks = {
  provideTasks() {
    const document = vscode.window.activeTextEditor?.document;
    if (document?.languageId !== "mech") return [];
    const folder = vscode.workspace.getWorkspaceFolder(document.uri) ?? vscode.TaskScope.Workspace;
    return ["check", "build", "test"].map((verb) => task(verb, document.uri.fsPath, folder));
  },
  resolveTask({ definition, scope }) {
    const file = definition.file ?? vscode.window.activeTextEditor?.document.uri.fsPath;
    return file && task(definition.command, file, scope ?? vscode.TaskScope.Workspace, definition);
  },
};

async function activate(context) {
  context.subscriptions.push(
    vscode.tasks.registerTaskProvider("flexura", tasks),
    vscode.commands.registerCommand("flexura.restart", async () => {
      await deactivate();
      await start();
    }),
  );
  await start();
}

async function deactivate() {
  if (client && client.isRunning()) {
    await client.stop();
  }
}

module.exports = { activate, deactivate };

// Starts the language server, and runs the command on the file in the editor.
const vscode = require("vscode");
const { LanguageClient } = require("vscode-languageclient/node");

let client;

const command = () => vscode.workspace.getConfiguration("flexura").get("path", "flexura");

async function start() {
  const server = { command: command(), args: ["lsp"] };
  const options = { documentSelector: [{ scheme: "file", language: "mech" }] };
  client = new LanguageClient("flexura", "Flexura", server, options);
  try {
    await client.start();
  } catch (error) {
    vscode.window.showErrorMessage(`Cannot start "${command()} lsp": ${error.message}. Set "flexura.path".`);
  }
}

async function run(name) {
  const editor = vscode.window.activeTextEditor;
  if (!editor || editor.document.languageId !== "mech") {
    vscode.window.showInformationMessage("Open a .mech file first.");
    return;
  }
  await editor.document.save();
  const file = editor.document.uri.fsPath;
  const folder = vscode.workspace.getWorkspaceFolder(editor.document.uri) ?? vscode.TaskScope.Workspace;
  const execution = new vscode.ProcessExecution(command(), [name, file], { cwd: require("path").dirname(file) });
  const task = new vscode.Task({ type: "flexura", command: name }, folder, name, "flexura", execution, "$flexura");
  await vscode.tasks.executeTask(task);
}

async function activate(context) {
  context.subscriptions.push(
    vscode.commands.registerCommand("flexura.build", () => run("build")),
    vscode.commands.registerCommand("flexura.simulate", () => run("simulate")),
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

// Starts `pcadlang lsp` for programs.

const { workspace } = require("vscode");
const { LanguageClient } = require("vscode-languageclient/node");

let client;

exports.activate = () => {
  const command = workspace.getConfiguration("pcad").get("command");
  const server = { command, args: ["lsp"] };
  client = new LanguageClient("pcad", "pcad", server, { documentSelector: [{ language: "pcad" }] });
  return client.start();
};

exports.deactivate = () => client?.stop();

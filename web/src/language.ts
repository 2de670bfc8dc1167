// The language server over its own WebSocket: diagnostics, completion, hover, format, rename.

import { languageServerExtensions, LSPClient, type Transport } from "@codemirror/lsp-client";
import type { Extension } from "@codemirror/state";

/** The language server; it is connected again when the connection is lost. */
export class LanguageServer {
  private readonly client = new LSPClient({
    rootUri: "file:///studio",
    timeout: 10_000,
    extensions: languageServerExtensions(),
  });
  private wait = 500;

  constructor(private readonly address: string) {
    this.connect();
  }

  /** The editor's extension for a file. */
  extension(file: string): Extension {
    return this.client.plugin(fileUri(file), "pcad");
  }

  private connect(): void {
    const socket = new WebSocket(this.address);
    let handlers: ((value: string) => void)[] = [];
    const transport: Transport = {
      send(message) {
        if (socket.readyState !== WebSocket.OPEN) throw new Error("the language server is away");
        socket.send(message);
      },
      subscribe: (handler) => void handlers.push(handler),
      unsubscribe: (handler) => void (handlers = handlers.filter((h) => h !== handler)),
    };
    socket.onmessage = (message) => {
      for (const handler of handlers) handler(String(message.data));
    };
    socket.onopen = () => {
      this.wait = 500;
      this.client.connect(transport);
      this.client.initializing.catch((error) => console.warn(error));
    };
    socket.onclose = () => {
      if (this.client.connected) this.client.disconnect();
      setTimeout(() => this.connect(), this.wait);
      this.wait = Math.min(2 * this.wait, 10_000);
    };
  }
}

/** The address under which the language server knows a file. */
function fileUri(file: string): string {
  return `file:///studio/${file.split("/").map(encodeURIComponent).join("/")}`;
}

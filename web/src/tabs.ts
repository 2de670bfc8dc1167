// Tabs as ARIA describes them: arrow keys move between them, only the chosen one is in sight.

import { h } from "./dom";

export interface Tab {
  key: string;
  name: string;
  panel: HTMLElement;
  /** Called when the tab comes into sight or leaves it. */
  setVisible?(visible: boolean): void;
}

/** A row of tabs over their panels. */
export class Tabs {
  readonly element: HTMLElement;
  private readonly buttons = new Map<string, HTMLButtonElement>();
  private chosen = "";

  constructor(
    private readonly tabs: Tab[],
    private readonly onChoose: (key: string) => void,
  ) {
    const row = h("div", { class: "tab-row", role: "tablist" });
    const panels = h("div", { class: "tab-panels" });
    for (const { key, name, panel } of tabs) {
      const tab = h(
        "button",
        { type: "button", role: "tab", id: `tab-${key}`, "aria-controls": `panel-${key}` },
        name,
      );
      tab.addEventListener("click", () => this.choose(key, true));
      tab.addEventListener("keydown", (event) => this.key(event));
      this.buttons.set(key, tab);
      row.append(tab);
      panel.id = `panel-${key}`;
      panel.setAttribute("role", "tabpanel");
      panel.setAttribute("aria-labelledby", `tab-${key}`);
      panel.hidden = true;
      panels.append(panel);
    }
    this.element = h("div", { class: "tabs" }, row, panels);
  }

  /** Brings a tab into sight. */
  choose(key: string, byUser = false): void {
    if (!this.buttons.has(key) || key === this.chosen) return;
    const before = this.tabs.find((tab) => tab.key === this.chosen);
    this.chosen = key;
    for (const tab of this.tabs) {
      const shown = tab.key === key;
      tab.panel.hidden = !shown;
      const element = this.buttons.get(tab.key)!;
      element.setAttribute("aria-selected", String(shown));
      element.tabIndex = shown ? 0 : -1;
    }
    before?.setVisible?.(false);
    this.tabs.find((tab) => tab.key === key)?.setVisible?.(true);
    if (byUser) this.onChoose(key);
  }

  /** Hides a tab's button; another is chosen if it was in sight. */
  hide(key: string, hidden: boolean): void {
    this.buttons.get(key)!.hidden = hidden;
    if (hidden && this.chosen === key) {
      this.choose(this.tabs.find((tab) => tab.key !== key)!.key, true);
    }
  }

  private key(event: KeyboardEvent): void {
    const keys = this.tabs.map((t) => t.key).filter((k) => !this.buttons.get(k)!.hidden);
    const by = { ArrowLeft: -1, ArrowRight: 1 }[event.key];
    if (!by) return;
    const to = keys[(keys.indexOf(this.chosen) + by + keys.length) % keys.length]!;
    this.choose(to, true);
    this.buttons.get(to)!.focus();
    event.preventDefault();
  }
}

// The tab Trace: the choices of the state that is shown, and a control for the selected one.

import type { Actions } from "./actions";
import { buildTree, passes, visibleRows, type Node, type Row } from "./address_tree";
import { button, fill, filterField, h, number } from "./dom";
import { Latest } from "./connection";
import { wholeChoice, type Choices, type Densities, type Moved, type State, type Value } from "./protocol";
import { Panel } from "./panel";
import { SelectedChoice } from "./selected_choice";
import { stateOf } from "./studio_data";
import { VirtualList } from "./virtual_list";

const ROW = 26;

/** A value that a choice shall have. */
interface Assignment {
  address: string;
  value: Value;
  last: boolean;
  drag: boolean;
}

/** The tree of choices. */
export class TracePanel extends Panel {
  readonly element: HTMLElement;

  private data: Choices | null = null;
  private rows: Row[] = [];
  private opened = new Set<string>();
  private selected: string | null = null;
  private words: string[] = [];
  private readonly joint = h("div", { class: "joint" });
  private readonly observed = h("details", { class: "observed", hidden: true });
  private readonly list: VirtualList;
  private readonly selection: SelectedChoice;
  private readonly undo = button("Undo", () => this.enter(":undo"));
  private readonly redo = button("Redo", () => this.enter(":redo"));
  private readonly assigns: Latest<Assignment>;

  constructor(actions: Actions) {
    super(actions, ["session", "view", "at", "run", "runs", "draws", "modes"]);
    const hint = "Filter: part of an address, $tag, family";
    const filter = filterField("Filter choices", hint, (words) => {
      this.words = words;
      this.rebuild();
    });
    this.list = new VirtualList(ROW, (i) => this.line(this.rows[i]!, i));
    this.list.element.tabIndex = 0;
    this.list.element.setAttribute("role", "tree");
    this.list.element.setAttribute("aria-label", "Choices");
    this.list.element.addEventListener("keydown", (event) => this.key(event));
    this.selection = new SelectedChoice(
      (value, move) => this.assign(value, move),
      (text) => this.enter(text),
      (address) => this.why(address),
    );
    this.element = h(
      "div",
      { class: "panel trace" },
      h("div", { class: "panel-tools" }, filter, this.undo, this.redo),
      this.joint,
      this.error.element,
      h(
        "div",
        { class: "row head", "aria-hidden": "true" },
        h("span", { class: "name" }, "Choice"),
        h("span", { class: "value" }, "Value"),
        h("span", { class: "family" }, "From"),
        h("span", { class: "density" }, "Log dens."),
        h("span", { class: "acceptance" }, "Acc."),
      ),
      this.list.element,
      this.observed,
      this.selection.element,
    );
    this.assigns = new Latest((assignment) => this.send(assignment), (e) => this.failAssign(e));
    actions.store.on(["session", "view"], () => this.showHistory());
    this.showHistory();
  }

  protected show(): void {
    const { store } = this.actions;
    if (store.now.dragging) return;
    const state = stateOf(store.now);
    const revision = state?.session
      ? store.now.session?.revision
      : store.now.view === "best" && store.currentRun?.revision;
    if (this.isNew(JSON.stringify([state, revision]))) this.reads.call();
  }

  protected async read(): Promise<void> {
    const state = stateOf(this.actions.store.now);
    if (!state) {
      this.data = null;
      this.joint.replaceChildren();
      this.observed.hidden = true;
      this.rebuild();
      return;
    }
    const data = await this.readAll(state);
    if (this.actions.store.now.dragging) return;
    const first = this.data === null;
    this.data = data;
    this.error.clear();
    // A small trace is shown open; of a large one the branches are opened by hand.
    if (first && data.choices.length <= 40) this.openAll();
    this.showJoint(data);
    this.showObserved(data);
    this.rebuild();
  }

  /** All choices of a state, in as many answers as the program gives them. */
  private async readAll(state: State): Promise<Choices> {
    const { connection } = this.actions;
    const data = await connection.ask<Choices>("choices", { state });
    const choices = [...data.choices];
    while (choices.length < data.total) {
      const params = { state, from: choices.length };
      const more = await connection.ask<Choices>("choices", params);
      if (more.choices.length === 0) break;
      choices.push(...more.choices);
    }
    return { ...data, choices: choices.map(wholeChoice) };
  }

  private openAll(): void {
    for (const { node } of visibleRows(buildTree(this.data?.choices ?? []), () => true)) {
      if (node.children.length <= 12) this.opened.add(node.path);
    }
  }

  private showJoint(d: Densities): void {
    fill(
      this.joint,
      h("b", {}, `log joint ${number(d.log_joint, 5)}`),
      h(
        "span",
        { class: "muted" },
        ` = ${number(d.log_prior)} (choices) + ${number(d.log_likelihood)} (observed)`,
      ),
    );
  }

  private showObserved({ observed }: Choices): void {
    this.observed.hidden = observed.length === 0;
    const most = 500;
    const lines = observed.slice(0, most).map(({ address, log_density }) => {
      return h("div", {}, h("code", {}, address), h("span", {}, number(log_density)));
    });
    if (observed.length > most) lines.push(h("div", {}, `and ${observed.length - most} more`));
    fill(this.observed, h("summary", {}, `Observed (${observed.length})`), ...lines);
  }

  private rebuild(): void {
    const all = this.data?.choices ?? [];
    const some = this.words.length > 0 ? all.filter((c) => passes(c, this.words)) : all;
    const root = buildTree(some);
    const isOpen = (node: Node) => this.words.length > 0 || this.opened.has(node.path);
    this.rows = visibleRows(root, isOpen);
    this.list.update(this.rows.length);
    const at = this.rows.findIndex((row) => row.node.path === this.selected);
    if (at < 0) this.list.element.removeAttribute("aria-activedescendant");
    else this.list.element.setAttribute("aria-activedescendant", `choice-${at}`);
    const choice = all.find((c) => c.address === this.selected) ?? null;
    this.selection.show(choice, this.editable());
  }

  /** Only the session's own state can be changed. */
  private editable(): boolean {
    return this.actions.store.now.view === "session";
  }

  private line({ node, depth, open }: Row, index: number): HTMLElement {
    const { choice } = node;
    const branch = node.children.length > 0;
    const line = h("div", {
      class: "row",
      role: "treeitem",
      id: `choice-${index}`,
      "aria-level": depth + 1,
      "aria-selected": String(node.path === this.selected),
      ...(branch ? { "aria-expanded": String(open) } : {}),
    });
    const name = h("span", { class: "name" });
    name.style.paddingLeft = `${depth * 14}px`;
    name.append(
      h("span", { class: "twist" }, branch ? (open ? "▾" : "▸") : ""),
      h("code", {}, depth === 0 ? `@${node.name}` : node.name),
    );
    if (choice?.forced) name.append(h("span", { class: "badge" }, "forced"));
    if (choice?.frozen) name.append(h("span", { class: "badge" }, "frozen"));
    line.append(name);
    if (choice) {
      line.append(
        h("span", { class: "value", title: choice.text }, choice.text),
        h("span", { class: "family" }, choice.family),
        h("span", { class: "density" }, number(choice.log_density)),
        h("span", { class: "acceptance" }, percent(choice.acceptance)),
      );
    } else {
      const count = `${node.count} ${node.count === 1 ? "choice" : "choices"}`;
      line.append(h("span", { class: "value muted" }, count));
    }
    line.addEventListener("click", () => {
      this.list.element.focus({ preventScroll: true });
      this.select(index, branch);
    });
    return line;
  }

  private select(index: number, toggle: boolean): void {
    const node = this.rows[index]?.node;
    if (!node) return;
    this.selected = node.path;
    if (toggle) {
      if (this.opened.has(node.path)) this.opened.delete(node.path);
      else this.opened.add(node.path);
    }
    this.rebuild();
    this.list.reveal(index);
  }

  private key(event: KeyboardEvent): void {
    const at = this.rows.findIndex((row) => row.node.path === this.selected);
    const row = this.rows[at];
    const moves: Record<string, number> = { ArrowDown: at + 1, ArrowUp: at - 1 };
    Object.assign(moves, { Home: 0, End: this.rows.length - 1 });
    Object.assign(moves, { PageDown: at + 15, PageUp: at - 15 });
    const to = moves[event.key];
    const twist =
      row &&
      row.node.children.length > 0 &&
      ((event.key === "ArrowRight" && !row.open) ||
        (event.key === "ArrowLeft" && row.open) ||
        event.key === "Enter" ||
        event.key === " ");
    if (to !== undefined) this.select(Math.min(this.rows.length - 1, Math.max(0, to)), false);
    else if (twist) this.select(at, true);
    else if (event.key === "ArrowLeft" && row) this.selectParent(at);
    else if (event.key === "Enter" && row?.node.choice) this.selection.focus();
    else return;
    event.preventDefault();
  }

  private selectParent(at: number): void {
    const depth = this.rows[at]!.depth;
    for (let i = at - 1; i >= 0; i--) {
      if (this.rows[i]!.depth < depth) {
        this.select(i, false);
        return;
      }
    }
  }

  private assign(value: Value, move: { last: boolean; drag: boolean }): void {
    if (this.selected === null) return;
    this.actions.store.set({ dragging: true });
    this.assigns.call({ address: this.selected, value, ...move });
  }

  private async send({ address, value, drag, last }: Assignment): Promise<void> {
    const answer = await this.actions.drag<Moved>("assign", { address, value, drag }, last);
    if (!answer) return;
    this.error.clear();
    this.showMoved(address, value, answer);
    if (last) this.endDrag();
  }

  private showMoved(address: string, value: Value, densities: Densities): void {
    this.showJoint(densities);
    const choice = this.data?.choices.find((c) => c.address === address);
    if (!choice) return;
    choice.value = value;
    choice.text = typeof value === "number" ? number(value, 5) : JSON.stringify(value);
    this.list.update(this.rows.length);
  }

  private failAssign(error: unknown): void {
    this.error.show(error);
    this.endDrag();
  }

  private endDrag(): void {
    this.selection.stop();
    this.actions.store.set({ dragging: false });
    this.isNew("");
    this.actions.refreshSession();
    this.follow();
  }

  private enter(text: string): void {
    void this.error.guard(async () => {
      const reply = await this.actions.enter(text);
      // Directives such as `freeze` answer nothing: they are part of the program now.
      this.selection.say(reply.text || `${text} is part of the program now`);
      this.actions.refreshSession();
    });
  }

  private why(address: string): void {
    void this.error.guard(async () => {
      const { store, connection } = this.actions;
      const params = { session: store.now.session?.session, address };
      const answer = await connection.ask<{ text: string }>("why", params);
      this.selection.say(answer.text);
    });
  }

  private showHistory(): void {
    const session = this.actions.store.now.session;
    const editable = this.editable();
    this.undo.disabled = !session?.undo || !editable;
    this.redo.disabled = !session?.redo || !editable;
    this.undo.title = session?.undo ? `Undo ${session.undo}` : "Nothing to undo";
    this.redo.title = session?.redo ? `Redo ${session.redo}` : "Nothing to redo";
  }
}

function percent(fraction: number | null): string {
  return fraction === null ? "" : `${Math.round(100 * fraction)}%`;
}

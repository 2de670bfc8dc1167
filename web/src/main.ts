// The page: connects, puts the panels together, and keeps the address up to date.

import "./style.css";
import "uplot/dist/uPlot.min.css";
import { Actions, Store } from "./actions";
import { Connection } from "./connection";
import { button, fill, h } from "./dom";
import { acceptDrops } from "./drop";
import { ComparePanel } from "./compare_panel";
import { ErrorBox } from "./errors";
import { readPlace, writePlace } from "./fragment";
import { GalleryPanel } from "./gallery_panel";
import { ModesPanel } from "./modes_panel";
import type { Panel } from "./panel";
import { PlotsPanel } from "./plots_panel";
import { ProgramPanel } from "./program_panel";
import { PromptPanel } from "./prompt_panel";
import { RunsPanel } from "./runs_panel";
import { ScenePanel } from "./scene_panel";
import { splitter } from "./splitter";
import { Tabs, type Tab } from "./tabs";
import { TopBar } from "./top_bar";
import { TracePanel } from "./trace_panel";

const place = readPlace(location.hash);
const store = new Store();
const connection = new Connection(place.token);
const actions = new Actions(connection, store);
// Until everything is read, the address says what shall be opened.
let loaded = false;

/** What another tab did. */
const told = h("div", { class: "banner told", role: "status", hidden: true });
actions.onTold = (text, act) => {
  const close = button("×", () => (told.hidden = true), { class: "quiet", "aria-label": "Dismiss" });
  const task = () => {
    told.hidden = true;
    void errors.guard(act!.task);
  };
  fill(told, text, act ? button(act.name, task) : null, close);
  told.hidden = false;
};

const banner = h("div", { class: "banner", role: "status", hidden: true });
const errors = new ErrorBox();
actions.onError = (error) => errors.show(error);

const bar = new TopBar(actions);
const program = new ProgramPanel(actions);
bar.onStart = () => program.commit();
const scene = new ScenePanel(actions, bar.chooser);

const programTab = h("div", { class: "panel program-tab" });
const tabOf = (key: string, name: string, panel: Pick<Panel, "element" | "setVisible">): Tab => {
  return { key, name, panel: panel.element, setVisible: (v) => panel.setVisible(v) };
};
const tabs = new Tabs(
  [
    { key: "program", name: "Program", panel: programTab },
    tabOf("trace", "Trace", new TracePanel(actions)),
    tabOf("plots", "Plots", new PlotsPanel(actions)),
    tabOf("modes", "Modes", new ModesPanel(actions)),
    tabOf("prompt", "Prompt", new PromptPanel(actions)),
    tabOf("compare", "Compare", new ComparePanel(actions)),
    tabOf("gallery", "Gallery", new GalleryPanel(actions)),
    tabOf("runs", "Runs", new RunsPanel(actions)),
  ],
  (tab) => store.set({ tab }),
);

const wide = button("⤢", () => {
  const on = document.querySelector("main")!.classList.toggle("wide");
  wide.setAttribute("aria-pressed", String(on));
}, { class: "quiet widen", title: "Give these tabs more room", "aria-pressed": "false" });
wide.setAttribute("aria-label", "Give these tabs more room");
tabs.element.querySelector(".tab-row")!.append(wide);

const left = h("aside", { class: "left", "aria-label": "Program" });
const root = document.getElementById("studio")!;
root.append(
  banner,
  told,
  bar.element,
  bar.error.element,
  bar.runError.element,
  errors.element,
  h(
    "main",
    {},
    left,
    splitter("--left", "Width of the program", 375, 1),
    h("section", { class: "middle", "aria-label": "Scene" }, scene.element),
    splitter("--right", "Width of the tabs", 450, -1),
    h("aside", { class: "right", "aria-label": "Panels" }, tabs.element),
  ),
);

// On a narrow page the program is one of the tabs.
const narrow = matchMedia("(max-width: 1100px)");
const arrange = () => {
  (narrow.matches ? programTab : left).append(program.element);
  tabs.hide("program", !narrow.matches);
};
narrow.addEventListener("change", arrange);

const remember = () => {
  const { session, run, view, at, tab } = store.now;
  if (!loaded) return;
  const now = { token: place.token, session: session?.session ?? null, run, view, at, tab };
  history.replaceState(null, "", writePlace(now));
};
store.on(["session", "run", "view", "at", "tab"], remember);
store.on(["tab"], () => tabs.choose(store.now.tab));
tabs.choose(place.tab ?? "trace");
store.set({ tab: place.tab ?? "trace" });
arrange();
acceptDrops(root, (file) => bar.chooser.take(file));
// A program without a scene gives its room to the tabs; on the first page there is nothing for them.
store.on(["session", "wanting", "run", "runs"], () => {
  const { session, wanting, run, runs, tab } = store.now;
  const first = session === null && runs.length === 0;
  root.classList.toggle("first", first);
  root.classList.toggle("blank", first && wanting === null);
  const of = store.currentRun;
  const flat = session !== null && !session.has_view && (!of || of.session === session.session);
  root.classList.toggle("flat", flat);
  if (flat && run !== null && tab === "trace") store.set({ tab: "plots" });
});

connection.onChange = (connected) => {
  store.set({ connected });
  if (connected) {
    banner.hidden = true;
    void errors.guard(async () => {
      await actions.load(place);
      loaded = true;
      remember();
    });
  } else {
    banner.hidden = false;
    banner.textContent = place.token
      ? "The connection to pcadlang is lost; trying to reach it again …"
      : "Open the address that `pcadlang studio` printed: this one has no token.";
  }
};
root.classList.add("first", "blank");
connection.connect();

// The settings of a run: preset, beside Start; time, chains, seed and parameters of the program.

import { fill, h, setOptions } from "./dom";
import type { Session, Settings } from "./protocol";

/** The form behind the gear of the top bar. */
export class SettingsForm {
  readonly element = h("form", { class: "popover", id: "settings", hidden: true });
  /** How much is done: it stands beside Start. */
  readonly quality = h("select", { name: "quality", "aria-label": "Quality" });
  private readonly time = field("time", "as preset");
  private readonly chains = field("chains", "as preset");
  private next = "fast";
  private readonly seed = field("seed", "as preset");
  private readonly params = h("div", { class: "params" });
  private presets: Session["presets"] = [];
  /** The program and photograph that the choice of a preset was for. */
  private chosenFor = "";

  constructor(private readonly toggle: HTMLElement) {
    const row = (text: string, control: HTMLElement) => {
      return h("label", {}, h("span", {}, text), control);
    };
    this.element.append(
      row("Time, seconds", this.time),
      row("Chains", this.chains),
      row("Seed", this.seed),
      h("details", {}, h("summary", {}, "Parameters of the program"), this.params),
    );
    this.element.addEventListener("submit", (event) => event.preventDefault());
    this.element.addEventListener("keydown", (event) => {
      if (event.key === "Escape") this.open(false);
    });
    document.addEventListener("pointerdown", (event) => {
      const target = event.target as Node;
      const inside = this.element.contains(target) || toggle.contains(target);
      if (!this.element.hidden && !inside) this.open(false);
    });
    toggle.setAttribute("aria-expanded", "false");
    toggle.setAttribute("aria-controls", "settings");
  }

  /** Shows or hides the form. */
  open(shown = this.element.hidden): void {
    this.element.hidden = !shown;
    this.toggle.setAttribute("aria-expanded", String(shown));
    if (shown) this.time.focus();
    else this.toggle.focus();
  }

  /** Takes the presets and parameters of a session's program. */
  setSession(session: Session | null): void {
    const presets = session?.presets ?? [];
    const key = JSON.stringify([session?.program, session?.observe, presets]);
    if (key !== this.chosenFor) {
      this.chosenFor = key;
      this.presets = presets;
      this.quality.value = "";
    }
    const old = new Map([...this.fields()].map((f) => [f.name, f.value]));
    fill(
      this.params,
      ...(session?.params ?? []).map(({ name, value, about }) => {
        const input = field(name, String(value ?? ""));
        input.value = old.get(name) ?? "";
        return h("label", { title: about ?? null }, h("code", {}, name), input);
      }),
    );
    if ((session?.params ?? []).length === 0) this.params.append("It has none.");
  }

  /** The settings as they are filled in; what is empty stays as preset. */
  settings(): Settings {
    const result: Settings = {};
    const isTimed = this.time.value.trim() !== "";
    // A time that was filled in selects its own preset.
    const quality = this.quality.value || (isTimed ? "" : this.next);
    if (quality && this.presets.length > 0) result.quality = quality;
    for (const input of [this.time, this.chains, this.seed]) {
      const value = Number(input.value);
      if (input.value.trim() === "") continue;
      if (!Number.isFinite(value) || value < 0) {
        throw new Error(`${input.name} must be a number, not \`${input.value}\``);
      }
      result[input.name as "time" | "chains" | "seed"] = value;
    }
    const set: Record<string, string> = {};
    for (const { name, value } of this.fields()) if (value.trim() !== "") set[name] = value.trim();
    if (Object.keys(set).length > 0) result.set = set;
    return result;
  }

  private fields(): HTMLInputElement[] {
    return [...this.params.querySelectorAll("input")];
  }

  /** What Start does unless the user chose: `fast`, and once that was tried `accurate`. */
  setTried(isTried: boolean): void {
    this.next = isTried ? "accurate" : "fast";
    const text = (name: string) => {
      const preset = this.presets.find((p) => p.name === name);
      return preset ? `${name}, ${preset.about.split(",")[0]}` : name;
    };
    const first = isTried ? `now ${text("accurate")}` : `${text("fast")}, then accurate`;
    const all = this.presets.map(({ name }): [string, string] => [name, text(name)]);
    const value = this.quality.value;
    setOptions(this.quality, [["", first], ...all, ["own", "the program's own time"]], value);
    const about = this.presets.map((p) => `${p.name}: ${p.about}`);
    this.quality.title = ["How much Start does", ...about].join("\n");
    this.quality.hidden = this.presets.length === 0;
  }
}

function field(name: string, placeholder: string): HTMLInputElement {
  return h("input", { type: "text", name, placeholder, autocomplete: "off", spellcheck: "false" });
}

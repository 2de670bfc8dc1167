// The settings of a run: preset, time, chains, seed and parameters of the program.

import { fill, h } from "./dom";
import type { Session, Settings } from "./protocol";

/** The form behind the gear of the top bar. */
export class SettingsForm {
  readonly element = h("form", { class: "popover", id: "settings", hidden: true });
  private readonly quality = h("select", { name: "quality" });
  private readonly about = h("p", { class: "muted" });
  private readonly time = field("time", "as preset");
  private readonly chains = field("chains", "as preset");
  private readonly seed = field("seed", "as preset");
  private readonly params = h("div", { class: "params" });
  private presets: Session["presets"] | null = null;

  constructor(private readonly toggle: HTMLElement) {
    const row = (text: string, control: HTMLElement) => {
      return h("label", {}, h("span", {}, text), control);
    };
    this.element.append(
      row("Quality", this.quality),
      this.about,
      row("Time, seconds", this.time),
      row("Chains", this.chains),
      row("Seed", this.seed),
      h("details", {}, h("summary", {}, "Parameters of the program"), this.params),
    );
    this.element.addEventListener("submit", (event) => event.preventDefault());
    this.quality.addEventListener("change", () => this.explain());
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
    if (shown) this.quality.focus();
    else this.toggle.focus();
  }

  /** Takes the presets and parameters of a session's program. */
  setSession(session: Session | null): void {
    const presets = session?.presets ?? [];
    if (JSON.stringify(presets) !== JSON.stringify(this.presets)) {
      this.presets = presets;
      const options = presets.map(({ name }) => h("option", { value: name }, name));
      fill(this.quality, h("option", { value: "" }, "program's own"), ...options);
    }
    this.explain();
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
    if (this.quality.value) result.quality = this.quality.value;
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

  private explain(): void {
    const preset = (this.presets ?? []).find(({ name }) => name === this.quality.value);
    this.about.textContent = preset?.about ?? "";
    this.about.hidden = !preset?.about;
  }
}

function field(name: string, placeholder: string): HTMLInputElement {
  return h("input", { type: "text", name, placeholder, autocomplete: "off", spellcheck: "false" });
}

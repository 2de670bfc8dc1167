// The open things, in the fragment of the page's address: a reload finds everything as it was, and
// the token goes to nobody.

/** The parts of the fragment. */
export interface Place {
  token: string;
  session: number | null;
  run: string | null;
  view: string | null;
  at: number | null;
  tab: string | null;
}

/** Reads a fragment such as `#token=T&session=3&run=lathe-2&tab=trace`. */
export function readPlace(fragment: string): Place {
  const params = new URLSearchParams(fragment.replace(/^#/, ""));
  const whole = (name: string) => {
    const value = params.get(name);
    return value !== null && /^\d+$/.test(value) ? Number(value) : null;
  };
  return {
    token: params.get("token") ?? "",
    session: whole("session"),
    run: params.get("run"),
    view: params.get("view"),
    at: whole("at"),
    tab: params.get("tab"),
  };
}

/** The fragment of a place, without the parts that are absent. */
export function writePlace(place: Place): string {
  const params = new URLSearchParams();
  for (const [name, value] of Object.entries(place)) {
    if (value !== null && value !== "") params.set(name, String(value));
  }
  return `#${params}`;
}

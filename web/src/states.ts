// Which state is shown, of the session or of the run that is looked at.

import { hasBest, type State } from "./protocol";
import type { Known } from "./store";

/** The state that the viewer shows at present. */
export function stateOf(known: Readonly<Known>): State | null {
  const { view, at, run, session, draws, modes } = known;
  if (view === "session") return session ? { session: session.session } : null;
  if (run === null) return null;
  const within = (total: number) => (total > 0 ? Math.min(at ?? 0, total - 1) : null);
  if (view === "draws") {
    const draw = within(draws?.draws.length ?? 0);
    return draw === null ? null : { run, draw };
  }
  if (view === "film") {
    const film = within(draws?.film ?? 0);
    return film === null ? null : { run, film };
  }
  if (view === "modes") {
    const mode = within(modes);
    return mode === null ? null : { run, mode };
  }
  return hasBest(known.runs.find((r) => r.run === run) ?? null) ? { run } : null;
}

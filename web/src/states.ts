// The states that the studio shows, of the session or of the run that is looked at.

import { hasBest, type State } from "./protocol";
import type { Known } from "./store";
import type { Frame } from "./viewer_data";

/** The states of the chosen view, each with its place on the viewer's slider. */
export function statesOf(known: Readonly<Known>): [Frame, State][] {
  const { view, run, session, draws, modes } = known;
  const plain = (label: string, logJoint: number | null = null): Frame => {
    return { label, chain: null, logJoint };
  };
  const several = (total: number, make: (i: number) => [Frame, State]) => {
    return Array.from({ length: total }, (_, i) => make(i));
  };
  if (view === "session") {
    if (!session) return [];
    return [[plain("The session's state", session.log_joint), { session: session.session }]];
  }
  if (run === null) return [];
  if (view === "film") {
    return several(draws?.film ?? 0, (film) => [plain("From prior to posterior"), { run, film }]);
  }
  if (view === "modes") return several(modes, (mode) => [plain(`Mode ${mode + 1}`), { run, mode }]);
  if (view === "draws") {
    return (draws?.draws ?? []).map((d, draw) => [
      { label: `Chain ${d.chain}, draw ${d.draw}`, chain: d.chain, logJoint: d.log_joint },
      { run, draw },
    ]);
  }
  // A run that just began, or failed, has no state yet.
  const current = known.runs.find((r) => r.run === run) ?? null;
  return hasBest(current) ? [[plain("The best state so far"), { run }]] : [];
}

/** The state that is shown at present. */
export function stateOf(known: Readonly<Known>): State | null {
  const states = statesOf(known);
  return states[Math.min(known.at ?? 0, states.length - 1)]?.[1] ?? null;
}

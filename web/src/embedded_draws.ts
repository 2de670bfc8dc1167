// The draws that lie in a report as JSON, for its plots.

import { inflate } from "./inflate";
import type { Quantity } from "./protocol";

/** The JSON of a report's draws. */
export interface EmbeddedDraws {
  /** The draws of a chain are so many iterations apart. */
  every: number;
  quantities: {
    /** The least and the largest draw; null: no draw is finite. */
    low: number | null;
    high: number | null;
    /** For each chain numbers of 16 bits, deflated, in base64. */
    chains: string[];
  }[];
}

const NOT_FINITE = 65535;

/** Draws from their steps between the bounds; the page has the names. */
export async function readQuantities(
  { quantities }: EmbeddedDraws,
  names: string[],
): Promise<Quantity[]> {
  return Promise.all(
    quantities.map(async ({ low, high, chains }, i) => {
      const draw = (step: number) => {
        if (step === NOT_FINITE || low === null || high === null) return null;
        const share = step / (NOT_FINITE - 1);
        return low * (1 - share) + high * share;
      };
      const read = async (text: string) => {
        const bytes = await inflate(text);
        const data = new DataView(bytes.buffer);
        return Array.from({ length: bytes.length / 2 }, (_, k) => draw(data.getUint16(2 * k, true)));
      };
      return { name: names[i] ?? "", chains: await Promise.all(chains.map(read)) };
    }),
  );
}

// The choices of a trace as a tree: addresses split at `/`, branches before leaves in the order
// of the trace.

import type { Choice } from "./protocol";

/** A branch or a leaf of the tree. */
export interface Node {
  /** The part of the address after the last `/`. */
  name: string;
  /** The address so far, with its `@`. */
  path: string;
  children: Node[];
  choice: Choice | null;
  /** How many choices are at or below it. */
  count: number;
}

/** A line of the list: a node, and how deep it is. */
export interface Row {
  node: Node;
  depth: number;
  open: boolean;
}

/** Splits an address at its slashes, but not at those inside brackets. */
export function splitAddress(address: string): string[] {
  const parts: string[] = [];
  let depth = 0;
  let part = "";
  for (const c of address.replace(/^@/, "")) {
    if (c === "[") depth++;
    if (c === "]") depth--;
    if (c === "/" && depth === 0) {
      parts.push(part);
      part = "";
    } else {
      part += c;
    }
  }
  parts.push(part);
  return parts;
}

/** Builds the tree of choices. */
export function buildTree(choices: Choice[]): Node {
  const root: Node = { name: "", path: "@", children: [], choice: null, count: 0 };
  const known = new Map<string, Node>([["@", root]]);
  for (const choice of choices) {
    let node = root;
    node.count++;
    let path = "@";
    for (const name of splitAddress(choice.address)) {
      path = path === "@" ? `@${name}` : `${path}/${name}`;
      let child = known.get(path);
      if (!child) {
        child = { name, path, children: [], choice: null, count: 0 };
        known.set(path, child);
        node.children.push(child);
      }
      child.count++;
      node = child;
    }
    node.choice = choice;
  }
  root.children = root.children.map(shortened);
  return root;
}

/** Branches with one child only are one line together with it. */
function shortened(node: Node): Node {
  const [only, ...others] = node.children;
  if (only && others.length === 0 && node.choice === null) {
    return shortened({ ...only, name: `${node.name}/${only.name}` });
  }
  return { ...node, children: node.children.map(shortened) };
}

/** True if a choice passes the filter: parts of its address, its tags, or its family. */
export function passes(choice: Choice, words: string[]): boolean {
  const text = `${choice.address} ${choice.tags.map((t) => `$${t}`).join(" ")} ${choice.family}`;
  const lower = text.toLowerCase();
  return words.every((word) => lower.includes(word));
}

/** The lines to show: open branches and what is below them. */
export function visibleRows(root: Node, isOpen: (node: Node) => boolean): Row[] {
  const rows: Row[] = [];
  const visit = (node: Node, depth: number) => {
    const open = node.children.length > 0 && isOpen(node);
    rows.push({ node, depth, open });
    if (open) for (const child of node.children) visit(child, depth + 1);
  };
  for (const child of root.children) visit(child, 0);
  return rows;
}

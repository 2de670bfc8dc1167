// The page's colours within a page that has colours of its own.

import theme from "./theme.css";

/** The colours of both themes as variables of the elements that a selector finds. */
export function themed(selector: string): string {
  return theme.replaceAll(":root", selector);
}

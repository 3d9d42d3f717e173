/* The theme gives each block of code a navigation without a name, and wide tables no way to scroll by keys. */
const named = (found, role, name) =>
  document.querySelectorAll(`${found}:not([aria-label])`).forEach((element, k) => {
    if (role) element.setAttribute("role", role);
    element.setAttribute("aria-label", `${name} ${k + 1}`);
  });
new MutationObserver(() => {
  named(".md-code__nav", "", "Code block");
  named(".md-typeset__scrollwrap", "group", "Table");
  document.querySelectorAll(".md-typeset__scrollwrap").forEach((table) => (table.tabIndex = 0));
}).observe(document.documentElement, { childList: true, subtree: true });

// What the theme leaves out for keyboards and screen readers: tables that scroll can be focused, the search has a name.
addEventListener("load", () => {
  document.querySelectorAll(".md-typeset__scrollwrap, .output").forEach((box) => (box.tabIndex = 0));
  document.querySelectorAll(".md-search").forEach((box) => box.setAttribute("aria-label", "Search"));
  document.querySelectorAll(".md-code__nav").forEach((box, n) => box.setAttribute("aria-label", `Code ${n + 1}`));
});

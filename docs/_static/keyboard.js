/* What scrolls sideways in a small window can be reached by the keyboard, and the two drawers have names. */
addEventListener("DOMContentLoaded", () => {
  for (const part of document.querySelectorAll("pre, .math-wrapper, .table-wrapper")) part.tabIndex = 0;
  document.querySelector(".sidebar-drawer")?.setAttribute("aria-label", "all pages");
  document.querySelector(".toc-drawer")?.setAttribute("aria-label", "this page");
});

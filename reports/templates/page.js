"use strict";
/* Charts are drawn over their static pictures, which remain without scripts. */
for (const view of document.querySelectorAll("[data-spec]")) {
  const spec = JSON.parse(document.getElementById(view.dataset.spec).textContent);
  if (spec.usermeta && spec.usermeta.ratio) spec.height = Math.round(view.clientWidth * spec.usermeta.ratio);
  spec.config.legend.columns = Math.max(1, Math.floor(view.clientWidth / 170)); // entries of a legend side by side
  const still = view.querySelector("img");
  const options = { renderer: "svg", actions: false, loader: { target: "_self" }, ast: false };
  vegaEmbed(view, spec, options).then(() => view.classList.add("live"), () => view.replaceChildren(still));
}

/* What a link points into is opened. */
function open() {
  const target = location.hash.length > 1 && document.getElementById(decodeURIComponent(location.hash.slice(1)));
  for (let at = target && target.closest("details"); at; at = at.parentElement.closest("details")) at.open = true;
  if (target) target.scrollIntoView();
}
addEventListener("hashchange", open);
open();

/* The contents stay open beside a wide page, and close over a narrow one once something is chosen. */
const menu = document.getElementById("menu");
const wide = matchMedia("(min-width: 70rem)");
const arrange = () => { menu.open = wide.matches; };
wide.addEventListener("change", arrange);
arrange();
menu.addEventListener("click", (event) => { if (event.target.closest("a")) arrange(); });

/* Escape puts an explanation away, as it does the contents. */
addEventListener("keydown", (event) => {
  if (event.key !== "Escape") return;
  arrange();
  if (document.activeElement.classList.contains("term")) document.activeElement.blur();
  document.body.classList.add("quiet");
  addEventListener("pointermove", () => document.body.classList.remove("quiet"), { once: true });
});

/* Paper shows everything. */
addEventListener("beforeprint", () => { for (const folded of document.querySelectorAll("details")) folded.open = true; });

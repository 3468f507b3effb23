"use strict";
// Sorts the tables that may be sorted: first upwards, then downwards. Rows without a value always come last.
for (const table of document.querySelectorAll("table.sortable")) {
  const headings = [...table.tHead.rows[0].cells];
  headings.forEach((heading, column) => {
    heading.querySelector("button").addEventListener("click", () => {
      const direction = heading.getAttribute("aria-sort") === "ascending" ? "descending" : "ascending";
      headings.forEach((one) => one.removeAttribute("aria-sort"));
      heading.setAttribute("aria-sort", direction);
      const isNumber = heading.classList.contains("number");
      const sign = direction === "ascending" ? 1 : -1;
      const valueOf = (row) => row.cells[column].dataset.value;
      const rows = [...table.tBodies[0].rows].sort((first, second) => {
        const [a, b] = [valueOf(first), valueOf(second)];
        if (a === undefined || b === undefined) return (a === undefined) - (b === undefined);
        return sign * (isNumber ? a - b : a.localeCompare(b));
      });
      table.tBodies[0].append(...rows);
    });
  });
}

// The pictures of the index are those of the motions, so that each is in the page once.
for (const thumb of document.querySelectorAll(".thumb")) {
  const shots = document.getElementById(thumb.dataset.from).querySelectorAll("img");
  if (shots.length) thumb.style.backgroundImage = `url("${shots[Math.floor(shots.length / 2)].src}")`;
  else thumb.remove();
}

// Shows the motions whose names hold a text and, if that is wanted, which came close to a limit.
const [text, doubtful, found] = ["filter", "doubtful", "found"].map((name) => document.getElementById(name));
const cards = [...document.querySelectorAll(".cards > li")];
function filter() {
  const wanted = new Set(
    cards
      .filter((card) => card.dataset.motion.toLowerCase().includes(text.value.trim().toLowerCase()))
      .filter((card) => !doubtful.checked || ["close", "over"].includes(card.dataset.mark))
      .map((card) => card.dataset.motion),
  );
  for (const one of document.querySelectorAll("[data-motion]")) one.hidden = !wanted.has(one.dataset.motion);
  for (const row of document.querySelectorAll("table.sortable tbody tr")) row.hidden = !wanted.has(row.cells[0].textContent);
  found.textContent = `${wanted.size} of ${cards.length} motions`;
}
text.addEventListener("input", filter);
doubtful.addEventListener("change", filter);
document.querySelector(".filter").hidden = cards.length < 2;

// A link to a motion unfolds it.
function unfold() {
  const part = document.getElementById(decodeURIComponent(location.hash.slice(1)));
  const folded = part && part.querySelector("details.motion");
  if (!folded) return;
  folded.open = true;
  part.scrollIntoView();
}
addEventListener("hashchange", unfold);
unfold();

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

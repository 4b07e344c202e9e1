"use strict";
// Sort a table by a click on a column's head; numbers by data-value where a cell has one.
for (const table of document.querySelectorAll("table.sortable")) {
  table.tHead.addEventListener("click", (event) => {
    const head = event.target.closest("th");
    if (!head) return;
    const column = head.cellIndex;
    const down = head.dataset.down !== "1";
    for (const other of head.parentNode.cells) delete other.dataset.down;
    head.dataset.down = down ? "1" : "0";
    const key = (row) => row.cells[column].dataset.value ?? row.cells[column].textContent;
    const rows = [...table.tBodies[0].rows];
    const order = new Intl.Collator("en", { numeric: true });
    rows.sort((a, b) => {
      const [x, y] = [key(a), key(b)];
      const difference = x !== "" && y !== "" && !isNaN(x) && !isNaN(y) ? x - y : order.compare(x, y);
      return down ? -difference : difference;
    });
    table.tBodies[0].append(...rows);
  });
}
// Show or hide the quadtree lines over the maps.
const lines = document.getElementById("lines");
lines?.addEventListener("change", () => document.body.classList.toggle("plain", !lines.checked));

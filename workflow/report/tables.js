// Tables: sorted by a click on a heading, saved as CSV; a cohort's structures, found by words.
"use strict";

const cellValue = (cell) => cell?.dataset.value ?? cell?.textContent.trim() ?? "";

function compareCells(a, b) {
  const [x, y] = [Number(a), Number(b)], numeric = a !== "" && b !== "" && !Number.isNaN(x) && !Number.isNaN(y);
  if (a === "" || b === "") return (a === "") - (b === ""); // what is missing comes last
  return numeric ? x - y : a.localeCompare(b, undefined, { numeric: true });
}

function sortTable(table, heading) {
  const column = [...heading.parentElement.children].indexOf(heading);
  const descending = heading.getAttribute("aria-sort") === "ascending";
  for (const other of heading.parentElement.children) other.removeAttribute("aria-sort");
  heading.setAttribute("aria-sort", descending ? "descending" : "ascending");
  const body = table.tBodies[0], rows = [...body.rows].map((row) => [cellValue(row.cells[column]), row]);
  rows.sort(([a], [b]) => {
    if (a === "" || b === "") return compareCells(a, b);
    return descending ? compareCells(b, a) : compareCells(a, b);
  });
  body.append(...rows.map(([, row]) => row));
}

function tableCsv(table) {
  const quote = (text) => (/[",\n\r]/.test(text) ? `"${text.replaceAll('"', '""')}"` : text);
  return [...table.rows].map((row) => [...row.cells].map((cell) => quote(cell.dataset.column ?? cellValue(cell))).join(",")).join("\r\n") + "\r\n";
}

// Hides the structures of which not every word is said: in their names or their warnings.
function findStructures(words, said) {
  const entries = [...document.querySelectorAll("#table-overview tbody tr, .sheet-of-thumbs li")];
  for (const entry of entries) {
    const text = said[entry.querySelector("a")?.getAttribute("href")] ?? "";
    entry.hidden = !words.every((word) => text.includes(word));
  }
  const rows = entries.filter((entry) => entry.matches("tr"));
  return `${rows.filter((row) => !row.hidden).length} of ${rows.length}`;
}

document.addEventListener("DOMContentLoaded", () => {
  const find = document.querySelector(".find");
  if (find) {
    const said = JSON.parse(document.getElementById("said").textContent);
    const field = find.querySelector("input"), told = find.querySelector("output");
    field.addEventListener("input", () => {
      const words = field.value.toLowerCase().split(/\s+/).filter(Boolean);
      const count = findStructures(words, said);
      told.textContent = words.length ? count : "";
    });
  }
  for (const table of document.querySelectorAll("table.data")) {
    for (const heading of table.tHead.rows[0].cells) {
      const button = heading.querySelector("button");
      if (button) button.addEventListener("click", () => sortTable(table, heading));
    }
  }
  for (const link of document.querySelectorAll("a[data-csv]")) {
    link.addEventListener("click", () => {
      const table = document.getElementById(link.dataset.csv);
      if (link.href.startsWith("blob:")) URL.revokeObjectURL(link.href);
      link.href = URL.createObjectURL(new Blob([tableCsv(table)], { type: "text/csv" }));
    });
  }
});

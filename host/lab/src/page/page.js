"use strict";
// Tables that sort.
(() => {
  const sortable = (table) => {
    const body = table.tBodies[0];
    const rows = [...body.rows];
    const heads = [...table.tHead.rows[0].cells];
    const key = (row, column) => {
      const cell = row.cells[column];
      if (cell.dataset.key === undefined) return cell.textContent;
      return cell.dataset.key === "" ? null : Number(cell.dataset.key);
    };
    const compare = (a, b) => (typeof a === "number" ? a - b : a.localeCompare(b, "en", { numeric: true }));
    heads.forEach((head, column) => {
      if (column > 0 && rows.length > 0 && rows[0].cells[column].dataset.key === undefined) head.classList.add("words");
      const link = head.querySelector("a");
      const button = document.createElement("button");
      button.type = "button";
      button.append(...(link ? link.childNodes : [...head.childNodes]));
      head.replaceChildren(button);
      button.addEventListener("click", () => {
        // Up, down, and back to the order of the command line.
        const next = { none: "ascending", ascending: "descending", descending: "none" };
        const order = next[head.getAttribute("aria-sort") ?? "none"];
        heads.forEach((other) => other.removeAttribute("aria-sort"));
        if (order !== "none") head.setAttribute("aria-sort", order);
        const sign = order === "descending" ? -1 : 1;
        const sorted = order === "none" ? rows : [...rows].sort((a, b) => {
          const [x, y] = [key(a, column), key(b, column)];
          // What has no value stands last either way.
          if (x === null || y === null) return (x === null) - (y === null);
          return sign * compare(x, y);
        });
        body.append(...sorted);
      });
    });
  };

  document.querySelectorAll("table.sortable").forEach(sortable);
})();

"use strict";
// Tables that sort, and the values of a figure's points under the pointer or the arrow keys.
(() => {
  const data = JSON.parse(document.getElementById("data").textContent);

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

  const written = (value) => {
    if (typeof value !== "number") return String(value);
    if (Number.isInteger(value)) return value.toLocaleString("en");
    return String(Number(value.toPrecision(5)));
  };

  const hoverable = (plot) => {
    const figure = data.figures[plot.dataset.figure];
    const svg = plot.querySelector("svg");
    if (!figure || !svg) return;
    // The browser would show the titles as well.
    plot.setAttribute("aria-label", `${svg.querySelector("title").textContent}. Arrow keys go from point to point.`);
    plot.setAttribute("role", "group");
    plot.tabIndex = 0;
    svg.querySelectorAll("title").forEach((title) => title.remove());
    const ring = document.createElementNS("http://www.w3.org/2000/svg", "circle");
    ring.setAttribute("class", "ring");
    ring.setAttribute("r", "12");
    const tip = document.createElement("div");
    tip.className = "tip";
    tip.setAttribute("role", "status");
    tip.hidden = true;
    plot.append(tip);

    let at = null;
    const hide = () => {
      tip.hidden = true;
      ring.remove();
      at = null;
    };
    const show = (curve, index) => {
      at = { curve, index };
      const { name, points } = figure.curves[curve];
      const point = points[index];
      ring.setAttribute("cx", point.x);
      ring.setAttribute("cy", point.y);
      svg.append(ring);
      tip.textContent = [name, ...figure.columns.map((column, k) => `${column}: ${written(point.values[k])}`)].join("\n");
      tip.hidden = false;
      const scale = svg.clientWidth / svg.viewBox.baseVal.width;
      const [x, y] = [point.x * scale, point.y * scale];
      const seen = [plot.scrollLeft, plot.scrollLeft + plot.clientWidth];
      const left = x + 16 + tip.offsetWidth <= seen[1] ? x + 16 : x - 16 - tip.offsetWidth;
      tip.style.left = `${Math.max(seen[0], Math.min(left, seen[1] - tip.offsetWidth))}px`;
      tip.style.top = `${Math.max(0, Math.min(y + 12, svg.clientHeight - tip.offsetHeight))}px`;
      return x;
    };
    const nearest = (x, y) => {
      let best = null;
      figure.curves.forEach(({ points }, curve) => points.forEach((point, index) => {
        const distance = Math.hypot(point.x - x, point.y - y);
        if (!best || distance < best.distance) best = { curve, index, distance };
      }));
      return best;
    };
    svg.addEventListener("pointermove", (event) => {
      const box = svg.getBoundingClientRect();
      const scale = svg.viewBox.baseVal.width / box.width;
      const found = nearest((event.clientX - box.left) * scale, (event.clientY - box.top) * scale);
      if (found && found.distance < 80) show(found.curve, found.index);
      else hide();
    });
    svg.addEventListener("pointerleave", hide);
    plot.addEventListener("blur", hide);
    plot.addEventListener("keydown", (event) => {
      const step = { ArrowLeft: [0, -1], ArrowRight: [0, 1], ArrowUp: [-1, 0], ArrowDown: [1, 0] }[event.key];
      if (event.key === "Escape") hide();
      if (!step || figure.curves.length === 0 || event.ctrlKey || event.altKey || event.metaKey) return;
      event.preventDefault();
      const wrapped = (value, count) => (value + count) % count;
      let x;
      if (!at) {
        x = show(0, 0);
      } else {
        const curve = wrapped(at.curve + step[0], figure.curves.length);
        const { points } = figure.curves[curve];
        const { x: from, y: height } = figure.curves[at.curve].points[at.index];
        const closer = (best, point, k) =>
          Math.hypot(point.x - from, point.y - height) < Math.hypot(points[best].x - from, points[best].y - height) ? k : best;
        x = show(curve, step[0] === 0 ? wrapped(at.index + step[1], points.length) : points.reduce(closer, 0));
      }
      if (x < plot.scrollLeft || x > plot.scrollLeft + plot.clientWidth) plot.scrollLeft = x - plot.clientWidth / 2;
    });
  };

  document.querySelectorAll("table.sortable").forEach(sortable);
  document.querySelectorAll(".plot").forEach(hoverable);
})();

"use strict";
// Uses the page as a reader does, and leaves what it found in data-selftest.
addEventListener("load", () => {
  const failures = [];
  const check = (good, what) => { if (!good) failures.push(what); };
  const near = (a, b, slack) => a.left < b.right - slack && b.left < a.right - slack && a.top < b.bottom - slack && b.top < a.bottom - slack;
  const counts = { figures: 0, pictures: 0, tables: 0, sorted: 0, hovered: 0, texts: 0 };

  const figure = (plot) => {
    const name = plot.dataset.figure;
    const svg = plot.querySelector("svg");
    const box = svg.getBoundingClientRect();
    check(box.width > 300 && box.height > 100, `figure ${name} has no size`);
    counts.figures += 1;
    const texts = [...svg.querySelectorAll("text")].map((text) => [text.textContent.trim(), text.getBoundingClientRect()]);
    texts.forEach(([text, place], k) => {
      counts.texts += 1;
      const inside = place.left >= box.left && place.right <= box.right && place.top >= box.top && place.bottom <= box.bottom;
      check(inside, `figure ${name}: "${text}" leaves the picture`);
      texts.slice(k + 1).forEach(([other, there]) => check(!near(place, there, 1.5), `figure ${name}: "${text}" on "${other}"`));
    });
  };

  const hover = (plot, figure) => {
    const name = plot.dataset.figure;
    const svg = plot.querySelector("svg");
    const tip = plot.querySelector(".tip");
    check(tip !== null && tip.hidden, `hover ${name}: not ready`);
    if (tip === null) return;
    const box = svg.getBoundingClientRect();
    const scale = box.width / svg.viewBox.baseVal.width;
    const curve = figure.curves.at(-1);
    const point = curve.points.at(-1);
    const move = (x, y) => svg.dispatchEvent(new PointerEvent("pointermove", { clientX: box.left + x * scale, clientY: box.top + y * scale, bubbles: true }));
    move(point.x, point.y);
    check(!tip.hidden && tip.getBoundingClientRect().width > 20, `hover ${name}: no values`);
    check(figure.columns.every((column) => tip.textContent.includes(column)), `hover ${name}: columns are missing`);
    const ring = svg.querySelector(".ring");
    check(ring !== null && Math.hypot(ring.cx.baseVal.value - point.x, ring.cy.baseVal.value - point.y) < 1, `hover ${name}: another point`);
    move(-1000, -1000);
    check(tip.hidden, `hover ${name}: values stay`);
    // By keyboard: the first point, the next, and away.
    const press = (key) => plot.dispatchEvent(new KeyboardEvent("keydown", { key, cancelable: true }));
    press("ArrowRight");
    const first = tip.textContent;
    check(!tip.hidden && first.startsWith(figure.curves[0].name), `keys ${name}: not the first point`);
    press(figure.curves[0].points.length > 1 ? "ArrowRight" : "ArrowDown");
    check(tip.textContent !== first || figure.curves.length === 1, `keys ${name}: no next point`);
    press("Escape");
    check(tip.hidden && plot.tabIndex === 0, `keys ${name}: values stay`);
    counts.hovered += 1;
  };

  const sort = (table, k) => {
    const body = table.tBodies[0];
    counts.tables += 1;
    [...table.tHead.rows[0].cells].forEach((head, column) => {
      const before = [...body.rows];
      const button = head.querySelector("button");
      check(button !== null, `sort ${k}.${column}: no button`);
      if (button === null) return;
      const values = () => [...body.rows].map((row) => row.cells[column]).map((cell) =>
        cell.dataset.key === undefined ? cell.textContent : cell.dataset.key === "" ? null : Number(cell.dataset.key));
      const ordered = (sign) => {
        const all = values();
        const some = all.filter((value) => value !== null);
        check(all.slice(some.length).every((value) => value === null), `sort ${k}.${column}: what is empty is not last`);
        if (some.every((value) => typeof value === "number"))
          check(some.every((value, i) => i === 0 || sign * (value - some[i - 1]) >= 0), `sort ${k}.${column}: not in order`);
        return some.length;
      };
      button.click();
      check(head.getAttribute("aria-sort") === "ascending", `sort ${k}.${column}: aria-sort`);
      ordered(1);
      button.click();
      check(head.getAttribute("aria-sort") === "descending", `sort ${k}.${column}: aria-sort`);
      ordered(-1);
      check(table.querySelectorAll("[aria-sort]").length === 1, `sort ${k}.${column}: two columns say that they are sorted`);
      button.click();
      check(before.every((row, i) => body.rows[i] === row), `sort ${k}.${column}: the first order is lost`);
      counts.sorted += 1;
    });
  };

  try {
    const data = JSON.parse(document.getElementById("data").textContent);
    document.querySelectorAll(".plot").forEach((plot) => {
      figure(plot);
      hover(plot, data.figures[plot.dataset.figure]);
    });
    document.querySelectorAll("table.sortable").forEach(sort);
    document.querySelectorAll("img").forEach((img) => {
      counts.pictures += 1;
      check(img.naturalWidth > 0 && img.getBoundingClientRect().width > 50 && img.alt !== "", `picture ${img.alt} is not there`);
    });
    document.querySelectorAll("nav a, caption a").forEach((link) =>
      check(document.getElementById(link.getAttribute("href").slice(1)) !== null, `no place ${link.getAttribute("href")}`));
    check(window.planted === undefined, "planted code ran");
    check(document.documentElement.scrollWidth <= innerWidth, `the page is ${document.documentElement.scrollWidth} wide in ${innerWidth}`);
    const requests = performance.getEntriesByType("resource").map((entry) => entry.name).filter((name) => !name.startsWith("data:"));
    check(requests.length === 0, `requests: ${requests.join(" ")}`);
  } catch (error) {
    failures.push(`the check itself: ${error.stack}`);
  }
  const result = { counts, failures, width: innerWidth, scripts: document.scripts.length };
  document.documentElement.dataset.selftest = JSON.stringify(result);
});

"use strict";
// Uses the page as a reader does, and leaves what it found in data-selftest.
addEventListener("load", () => {
  const failures = [];
  const check = (good, what) => { if (!good) failures.push(what); };
  const near = (a, b, slack) => a.left < b.right - slack && b.left < a.right - slack && a.top < b.bottom - slack && b.top < a.bottom - slack;
  const counts = { figures: 0, charts: 0, pictures: 0, tables: 0, sorted: 0, hovered: 0, tools: 0, texts: 0 };

  const drawing = (name, svg) => {
    const box = svg.getBoundingClientRect();
    check(box.width > 300 && box.height > 100, `${name} has no size`);
    const texts = [...svg.querySelectorAll("text")].map((text) => [text.textContent.trim(), text.getBoundingClientRect()]).filter(([text]) => text !== "");
    texts.forEach(([text, place], k) => {
      counts.texts += 1;
      const inside = place.left >= box.left && place.right <= box.right && place.top >= box.top && place.bottom <= box.bottom;
      check(inside, `${name}: "${text}" leaves the picture`);
      texts.slice(k + 1).forEach(([other, there]) => check(!near(place, there, 1.5), `${name}: "${text}" on "${other}"`));
    });
    return texts.map(([text]) => text);
  };

  // The picture that stands there without scripts and on paper.
  const picture = (plot) => {
    plot.classList.remove("live");
    drawing(`figure ${plot.dataset.figure}`, plot.querySelector(":scope > svg"));
    plot.classList.add("live");
    counts.figures += 1;
  };

  const chart = (plot, figure) => {
    const name = `chart ${plot.dataset.figure}`;
    check(plot.querySelector(":scope > svg").getBoundingClientRect().width === 0, `${name}: the picture is still there`);
    const texts = drawing(name, plot.querySelector(".chart svg")).join("\n");
    const start = (text) => text.slice(0, 12);
    const named = figure.panels.flatMap((panel) => [panel.heading, panel.x.title, panel.y.title, ...panel.x.names, ...panel.y.names]);
    [figure.title, figure.subject, ...named].forEach((text) => check(texts.includes(start(text)), `${name}: no text "${text}"`));
    const series = figure.panels.flatMap((panel) => panel.series);
    series.filter(({ kind }) => kind !== "bars").forEach((one) => check(texts.includes(start(one.name)), `${name}: "${one.name}" is not in the legend`));
    counts.charts += 1;
  };

  const hover = (plot, figure) => {
    const name = plot.dataset.figure;
    const box = plot.querySelector(".chart");
    const shown = () => {
      const tip = box.querySelector(".tip");
      return tip !== null && tip.style.visibility !== "hidden" && tip.getBoundingClientRect().height > 20 ? tip.textContent : null;
    };
    check(shown() === null, `hover ${name}: not ready`);
    const charts = echarts.getInstanceByDom(box);
    const series = figure.panels.flatMap((panel) => panel.series);
    const one = series.at(-1);
    const point = one.points.at(-1);
    const [x, y] = charts.convertToPixel({ seriesIndex: series.length - 1 }, point.slice(0, 2));
    const move = (x, y) => {
      const root = box.firstElementChild;
      const { left, top } = root.getBoundingClientRect();
      root.dispatchEvent(new MouseEvent("mousemove", { clientX: left + x, clientY: top + y, bubbles: true }));
    };
    move(one.kind === "bars" ? x - 1 : x, y);
    const said = shown();
    check(said !== null, `hover ${name}: no values`);
    check(figure.columns.every((column) => said?.includes(column)), `hover ${name}: columns are missing`);
    check(said?.startsWith(one.name), `hover ${name}: another series`);
    const exact = figure.columns.map((column, k) => [column, point[k + 2]]).filter(([, value]) => typeof value === "string" || Number.isInteger(value));
    check(exact.every(([column, value]) => said?.includes(`${column}: ${value.toLocaleString("en")}`)), `hover ${name}: another point`);
    move(-1000, -1000);
    check(shown() === null, `hover ${name}: values stay`);
    // By keyboard: the first point, the next, and away.
    const status = plot.querySelector("[role=status]");
    const press = (key) => plot.dispatchEvent(new KeyboardEvent("keydown", { key, cancelable: true }));
    press("ArrowRight");
    const first = status.textContent;
    check(shown() === first && first.startsWith(series[0].name), `keys ${name}: not the first point`);
    press(series[0].points.length > 1 ? "ArrowRight" : "ArrowDown");
    check(shown() === status.textContent && status.textContent !== first || series.length === 1, `keys ${name}: no next point`);
    press("Escape");
    check(shown() === null && status.textContent === "" && plot.tabIndex === 0, `keys ${name}: values stay`);
    counts.hovered += 1;
  };

  // Legend and saving: of one scene and the overview, for they take long.
  const tools = (plot, figure) => {
    const name = plot.dataset.figure;
    const box = plot.querySelector(".chart");
    const charts = echarts.getInstanceByDom(box);
    const one = figure.panels.at(-1).series.at(-1);
    // What the reader would save.
    const saved = new DOMParser().parseFromString(decodeURIComponent(charts.getDataURL({ type: "svg" }).split(",").slice(1).join(",")), "image/svg+xml");
    check(saved.querySelector("parsererror, script, img") === null && saved.querySelector("text") !== null, `save ${name}: no picture`);
    // A series that the legend takes away and gives back.
    const last = () => box.querySelectorAll("path").length;
    const before = last();
    if (one.kind !== "bars") {
      charts.dispatchAction({ type: "legendUnSelect", name: one.name }, { flush: true });
      check(last() < before, `legend ${name}: nothing goes`);
      charts.dispatchAction({ type: "legendSelect", name: one.name }, { flush: true });
      check(last() === before, `legend ${name}: it does not come back`);
    }
    counts.tools += 1;
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
    const allowed = (_, value) => (typeof value === "string" ? value.replaceAll("\u0001", "\ufffd") : value);
    const data = JSON.parse(document.getElementById("data").textContent, allowed);
    for (const plot of document.querySelectorAll(".plot")) {
      check(plot.querySelector(".chart") !== null, `chart ${plot.dataset.figure}: is not made`);
      if (plot.querySelector(".chart") === null) continue;
      chart(plot, data.figures[plot.dataset.figure]);
      hover(plot, data.figures[plot.dataset.figure]);
      if (counts.tools < 9) tools(plot, data.figures[plot.dataset.figure]);
      picture(plot);
    }
    const paper = [...document.styleSheets].flatMap((sheet) => [...sheet.cssRules]).filter((rule) => rule.media?.mediaText === "print");
    check(paper.length > 0, "no style for paper");
    paper.forEach((rule) => { rule.media.mediaText = "all"; });
    const wide = (plot, what) => plot.querySelector(what)?.getBoundingClientRect().width ?? 0;
    document.querySelectorAll(".plot").forEach((plot) =>
      check(wide(plot, ":scope > svg") > 300 && wide(plot, ".chart") === 0, `figure ${plot.dataset.figure} is not the picture on paper`));
    paper.forEach((rule) => { rule.media.mediaText = "print"; });
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

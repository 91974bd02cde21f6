"use strict";
// Charts by Apache ECharts in place of the pictures that the page has without scripts, and their points under the arrow keys.
(() => {
  // A saved chart is XML, which allows no control characters, such as a file's name may have.
  const allowed = (_, value) => (typeof value === "string" ? value.replace(/[\u0000-\u001f\u007f-\u009f\ufffe\uffff]/g, "\ufffd") : value);
  const { figures } = JSON.parse(document.getElementById("data").textContent, allowed);
  // Pixels. A chart is as high as the picture in its place, which is WIDTH wide with ENDS above and below its rows of panels. Below NARROW
  // panels and legend stand under one another.
  const [WIDTH, ENDS, NARROW, HEAD, FOOT, LIST, ENTRY] = [1600, 140, 760, 68, 16, 240, 20];
  const [INK, FAINT, GRID, PAPER] = ["#000000", "#505050", "#dedede", "#ffffff"];
  const font = { color: INK, fontFamily: "sans-serif" };
  const cut = (width) => ({ width, overflow: "truncate" });
  const sum = (values) => values.reduce((a, b) => a + b, 0);

  const written = (value) => {
    if (typeof value !== "number") return String(value ?? "–");
    return Number.isInteger(value) ? value.toLocaleString("en") : String(Number(value.toPrecision(5)));
  };
  const said = (figure, name, point) => [name, ...figure.columns.map((column, k) => `${column}: ${written(point[k + 2])}`)].join("\n");

  const axis = (scale, gridIndex, most, margin, nameGap, isLined) => {
    const isNamed = scale.names.length > 0;
    const range = scale.log || !isNamed && scale.title === "" ? { min: scale.min, max: scale.max } : { scale: scale.min !== 0 };
    return {
      gridIndex,
      type: isNamed ? "category" : scale.log ? "log" : "value",
      data: scale.names,
      show: isNamed || scale.title !== "",
      boundaryGap: isNamed || scale.min === 0 ? isNamed : ["5%", "5%"],
      ...range,
      name: scale.title,
      nameLocation: "middle",
      nameGap,
      nameTextStyle: { ...font, fontSize: 13 },
      axisLabel: { ...font, ...cut(most), margin, hideOverlap: true },
      axisLine: { show: true, lineStyle: { color: INK }, onZero: false },
      splitLine: { show: isLined, lineStyle: { color: GRID } },
    };
  };

  const series = ({ name, kind, look, points }, at) => {
    const { colour, dashes, mark, size, hollow } = look;
    // Long lines have nine marks; their other points show under the pointer.
    const every = kind === "line" && points.length > 30 ? Math.ceil(points.length / 9) : 1;
    const unseen = { symbol: "circle", symbolSize: 6, itemStyle: { opacity: 0 } };
    const marks = { color: hollow ? PAPER : colour, borderColor: colour, borderWidth: 1.5, opacity: mark === "" ? 0 : 1 };
    return {
      type: { line: "line", points: "scatter", bars: "bar" }[kind],
      name,
      xAxisIndex: at,
      yAxisIndex: at,
      data: points.map((value, k) => ({ value, ...(k % every === 0 || k + 1 === points.length ? {} : unseen) })),
      symbol: mark === "" ? "circle" : `path://${mark}`,
      symbolSize: 0.65 * size,
      lineStyle: { color: colour, width: 2, type: dashes.length > 0 ? dashes : "solid" },
      itemStyle: kind === "bars" ? { color: "#464646" } : marks,
      silent: mark === "",
      label: { show: kind === "bars", position: "right", color: FAINT, formatter: ({ value }) => value.at(-1) },
      emphasis: { focus: "series", itemStyle: { opacity: 1 } },
    };
  };

  // Where things are in a chart of this width: its height, places of the panels, and the legend.
  const layout = (figure, names, width) => {
    const isNarrow = width < NARROW;
    const across = isNarrow ? 1 : figure.across;
    const rows = isNarrow ? figure.panels.map((_, at) => 0.55 * figure.rows[Math.floor(at / figure.across)]) : figure.rows;
    const below = isNarrow ? ENTRY * names.length : 0;
    const height = isNarrow ? HEAD + sum(rows) + below + FOOT : (width / WIDTH) * (ENDS + sum(rows));
    const scale = (height - HEAD - below - FOOT) / sum(rows);
    const wide = (width - 16 - (isNarrow || names.length === 0 ? 0 : LIST)) / across;
    const places = figure.panels.map((_, at) => {
      const row = Math.floor(at / across);
      return { left: 8 + wide * (at % across), top: HEAD + scale * sum(rows.slice(0, row)), wide, high: scale * rows[row] };
    });
    const legend = isNarrow ? { left: 8, top: height - FOOT - below } : { left: width - LIST, top: HEAD, bottom: FOOT };
    return { height, places, legend, room: (isNarrow ? width : LIST) - 80 };
  };

  const option = (figure, file, width) => {
    const all = figure.panels.flatMap((panel, at) => panel.series.map((one) => series(one, at)));
    const names = [...new Set(all.filter(({ type }) => type !== "bar").map(({ name }) => name))];
    const { height, places, legend, room } = layout(figure, names, width);
    const heading = { left: 8, top: 6, itemGap: 4, textStyle: { ...font, ...cut(width - 130), fontSize: 18, lineHeight: 22, fontWeight: "normal" } };
    const headings = figure.panels.map(({ heading: text }, at) => {
      const { left, top, wide } = places[at];
      return { text, left: left + 40, top, textStyle: { ...font, ...cut(wide - 60), fontSize: 14, fontWeight: "normal" } };
    });
    const subject = { subtext: [figure.subject, figure.note].filter(Boolean).join("\n"), subtextStyle: { color: FAINT, ...cut(width - 130), lineHeight: 15 } };
    return [height, {
      animation: false,
      backgroundColor: PAPER,
      textStyle: font,
      title: [{ text: figure.title, ...heading, ...subject }, ...headings],
      legend: {
        data: names,
        type: "scroll",
        orient: "vertical",
        itemWidth: 34,
        itemHeight: 9,
        itemGap: 2,
        textStyle: { ...font, ...cut(room), lineHeight: ENTRY - 2 },
        ...legend,
      },
      grid: figure.panels.map(({ heading }, at) => {
        const { left, top, wide, high } = places[at];
        const above = heading === "" ? 8 : 30;
        return { left: left + 8, top: top + above, width: wide - 32, height: high - above - 8, outerBoundsMode: "same", outerBoundsContain: "all" };
      }),
      // Margins: the lowest numbers of both axes would meet in the corner.
      xAxis: figure.panels.map(({ x }, at) => axis(x, at, 100, 13, 32, true)),
      yAxis: figure.panels.map(({ x, y }, at) => ({ ...axis(y, at, Math.min(240, 0.35 * places[at].wide), 8, 46, x.title !== ""), inverse: y.names.length > 0 })),
      series: all,
      tooltip: {
        trigger: "item",
        confine: true,
        className: "tip",
        position: ([x, y]) => [x + 14, y + 14],
        hideDelay: 0,
        transitionDuration: 0,
        backgroundColor: "var(--paper)",
        borderColor: "var(--ink)",
        textStyle: { color: "var(--ink)", fontSize: 13 },
        formatter: ({ seriesName, value }) => {
          const tip = document.createElement("div");
          tip.textContent = said(figure, seriesName, value);
          return tip;
        },
      },
      toolbox: {
        right: 8,
        top: 4,
        feature: {
          dataZoom: { filterMode: "none", title: { zoom: "Zoom into a rectangle", back: "Back" } },
          restore: { title: "All of it again" },
          saveAsImage: { title: "Save as SVG", name: file.replace(/\.svg$/, "") },
        },
      },
    }];
  };

  const live = (plot) => {
    const file = plot.dataset.figure;
    const figure = figures[file];
    const [box, status] = [document.createElement("div"), document.createElement("div")];
    box.className = "chart";
    status.className = "unseen";
    status.setAttribute("role", "status");
    plot.append(box, status);
    plot.classList.add("live");
    plot.setAttribute("role", "group");
    plot.setAttribute("aria-label", `${figure.subject}: ${figure.title}. Arrow keys go from point to point.`);
    plot.tabIndex = 0;
    const chart = echarts.init(box, null, { renderer: "svg", width: 1, height: 1, useCoarsePointer: true, pointerSize: 44 });
    const fit = () => {
      const width = plot.clientWidth;
      const [height, all] = option(figure, file, width);
      chart.resize({ width, height });
      chart.setOption(all);
    };
    fit();
    addEventListener("resize", fit);

    const series = figure.panels.flatMap((panel) => panel.series);
    let at = null;
    const act = (type, more) => chart.dispatchAction({ type, ...more });
    const hide = () => {
      act("hideTip");
      act("downplay");
      status.textContent = "";
      at = null;
    };
    plot.addEventListener("blur", hide);
    plot.addEventListener("keydown", (event) => {
      const step = { ArrowLeft: [0, -1], ArrowRight: [0, 1], ArrowUp: [-1, 0], ArrowDown: [1, 0] }[event.key];
      if (event.key === "Escape") hide();
      if (!step || event.ctrlKey || event.altKey || event.metaKey) return;
      event.preventDefault();
      const { selected } = chart.getOption().legend[0];
      const shown = [...series.keys()].filter((k) => selected[series[k].name] !== false);
      if (shown.length === 0) return;
      const wrapped = (value, count) => (value + count) % count;
      if (at === null || !shown.includes(at.seriesIndex)) {
        at = { seriesIndex: shown[0], dataIndex: 0 };
      } else if (step[0] === 0) {
        at.dataIndex = wrapped(at.dataIndex + step[1], series[at.seriesIndex].points.length);
      } else {
        const pixel = (k, point) => chart.convertToPixel({ seriesIndex: k }, point.slice(0, 2));
        const from = pixel(at.seriesIndex, series[at.seriesIndex].points[at.dataIndex]);
        const next = shown[wrapped(shown.indexOf(at.seriesIndex) + step[0], shown.length)];
        const far = series[next].points.map((point) => pixel(next, point)).map(([x, y]) => Math.hypot(x - from[0], y - from[1]));
        at = { seriesIndex: next, dataIndex: far.indexOf(Math.min(...far)) };
      }
      act("downplay");
      act("highlight", at);
      act("showTip", at);
      status.textContent = said(figure, series[at.seriesIndex].name, series[at.seriesIndex].points[at.dataIndex]);
    });
  };

  // A page may have a hundred figures: each is made when it comes near.
  const near = new IntersectionObserver((entries) => entries.filter(({ isIntersecting }) => isIntersecting).forEach(({ target }) => {
    near.unobserve(target);
    live(target);
  }), { rootMargin: "100%" });
  document.querySelectorAll(".plot").forEach((plot) => near.observe(plot));
})();

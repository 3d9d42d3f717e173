/* charts.js -- curves over time, one chart for each group of variables and unit, drawn by uPlot. */

const AT_FIRST = [
  "Multipliers λ",
  "Outputs",
  "Friction",
  "Coordinates",
  "Energies",
  "Generalized forces of constraint",
  "Residuals, zero where a constraint acts",
  "Gaps of contacts",
];
const MOST = 12; // curves of one chart
const HEIGHT = 190;

/* [{group, unit, places}]: what can be drawn together. */
function chartList() {
  const found = [];
  COLUMNS.forEach((v, k) => {
    if (v.type !== "Real" || v.discrete) return;
    let chart = found.find((c) => c.group === v.group && c.unit === v.unit);
    if (!chart) found.push((chart = { group: v.group, unit: v.unit, places: [] }));
    chart.places.push(k);
  });
  const rank = (c) => (AT_FIRST.indexOf(c.group) + 1 || 99);
  return found.sort((a, b) => rank(a) - rank(b));
}

/* The range of an axis: a curve that stays where it is lies in the middle. */
function roomy(low, high) {
  if (low === null || low < high) return uPlot.rangeNum(low ?? 0, high ?? 1, 0.1, true);
  const pad = Math.abs(low) / 2 || 1;
  return [low - pad, high + pad];
}

class Charts {
  constructor(box, choices, seek) {
    this.box = box;
    this.seek = seek;
    this.list = chartList();
    this.wanted = new Set(this.list.map((c) => c.group).filter((g) => AT_FIRST.includes(g)));
    this.drawn = [];
    this.trajectory = null;
    for (const group of new Set(this.list.map((c) => c.group))) {
      const tick = element("input", { type: "checkbox" });
      tick.checked = this.wanted.has(group);
      tick.addEventListener("change", () => {
        if (tick.checked) this.wanted.add(group);
        else this.wanted.delete(group);
        this.build();
      });
      choices.append(element("label", {}, tick, ` ${group}`));
    }
    new ResizeObserver(() => this.resize()).observe(box);
    matchMedia("(prefers-color-scheme: dark)").addEventListener("change", () => this.build());
  }

  show(trajectory) {
    this.trajectory = trajectory;
    if (!this.drawn.length) this.build();
    else for (const c of this.drawn) this.fill(c);
  }

  build() {
    for (const { plot } of this.drawn) plot.destroy();
    this.box.replaceChildren();
    this.drawn = [];
    if (!this.trajectory) return;
    for (const chart of this.list.filter((c) => this.wanted.has(c.group))) this.add(chart);
    this.resize();
  }

  add(chart) {
    const places = chart.places.slice(0, MOST);
    const title = `${chart.group}${chart.unit ? ` [${chart.unit}]` : ""}`;
    const more = chart.places.length - places.length;
    const caption = element("figcaption", {}, more ? `${title}, ${more} more not drawn` : title);
    const holder = element("div", { class: "plot", role: "img" });
    const marker = element("div", { class: "now" });
    this.box.append(element("figure", { class: "chart" }, caption, holder));
    const quiet = color("--quiet");
    const line = { stroke: color("--line"), width: 1 };
    const axis = { stroke: quiet, grid: line, ticks: line, font: "12px system-ui, sans-serif" };
    const options = {
      width: this.width(),
      height: HEIGHT,
      scales: { x: { time: false }, y: { range: (u, low, high) => roomy(low, high) } },
      axes: [
        { ...axis, values: (u, ticks) => ticks.map((t) => `${shown(t)} s`) },
        { ...axis, size: 64, values: (u, ticks) => ticks.map((y) => shown(y)) },
      ],
      cursor: { sync: { key: "time" }, drag: { x: true, y: false } },
      legend: { live: true },
      series: [
        { label: "t", value: (u, t) => (t === null ? "" : `${shown(t)} s`) },
        ...places.map((k, i) => ({
          label: COLUMNS[k].name,
          stroke: color(`--curve${i % 8}`),
          dash: i >= 8 ? [6, 3] : [],
          width: 1.75,
          points: { show: false },
          value: (u, y) => (y === null ? "" : shown(y)),
        })),
      ],
      hooks: {
        draw: [(u) => this.events(u)],
        ready: [(u) => u.over.append(marker)],
      },
    };
    const data = [this.trajectory.time, ...places.map((k) => this.trajectory.columns[k])];
    const plot = new uPlot(options, data, holder);
    plot.over.addEventListener("click", () => {
      const { left } = plot.cursor;
      if (left >= 0) this.seek(plot.posToVal(left, "x"));
    });
    const drawn = { plot, places, holder, marker, title };
    this.drawn.push(drawn);
    this.describe(drawn);
  }

  fill(drawn) {
    const { time, columns } = this.trajectory;
    drawn.plot.setData([time, ...drawn.places.map((k) => columns[k])]);
    this.describe(drawn);
  }

  /* What a reader who does not see the chart is told. */
  describe({ holder, places, title }) {
    const { columns } = this.trajectory;
    const curves = places.map((k) => {
      const column = columns[k];
      let [low, high] = [Infinity, -Infinity];
      for (const y of column) {
        if (y < low) low = y;
        if (y > high) high = y;
      }
      const last = shown(column[column.length - 1], 4);
      return `${COLUMNS[k].name} from ${shown(low, 4)} to ${shown(high, 4)}, at the end ${last}`;
    });
    holder.setAttribute("aria-label", `${title} over time: ${curves.join("; ")}`);
  }

  events(u) {
    const { ctx, bbox } = u;
    ctx.save();
    ctx.strokeStyle = color("--event");
    ctx.setLineDash([5, 4]);
    ctx.lineWidth = devicePixelRatio;
    for (const event of this.trajectory.events) {
      const x = Math.round(u.valToPos(event.time, "x", true));
      if (x < bbox.left || x > bbox.left + bbox.width) continue;
      ctx.beginPath();
      ctx.moveTo(x, bbox.top);
      ctx.lineTo(x, bbox.top + bbox.height);
      ctx.stroke();
    }
    ctx.restore();
  }

  now(t) {
    const [row] = this.trajectory.place(t);
    for (const { plot, marker } of this.drawn) {
      const x = plot.valToPos(t, "x");
      marker.style.transform = `translateX(${x}px)`;
      if (!(plot.cursor.left >= 0)) plot.setLegend({ idx: row });
      marker.hidden = !(x >= 0 && x <= plot.over.clientWidth);
    }
  }

  width() {
    const figure = this.box.firstElementChild;
    return Math.max(240, Math.floor((figure || this.box).clientWidth) - 2);
  }

  resize() {
    const width = this.width();
    for (const { plot } of this.drawn) if (plot.width !== width) plot.setSize({ width, height: HEIGHT });
  }
}

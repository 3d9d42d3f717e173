/* charts.js -- curves over time, drawn by uPlot: one beside the picture, and a chart for each group of
 * variables, type and unit. */

const AT_FIRST = [
  "Multipliers λ",
  "Outputs",
  "Friction",
  "Coordinates",
  "Energies",
  "Generalized forces of constraint",
  "Gaps of contacts",
];
const CHOSEN = "Of interest"; // the group of the curves that the model's page names
const MOST = 12; // curves of one chart
const HEIGHT = 190;
const NARROW = 260; // CSS pixels: below, a chart has smaller figures
const WORDS = { Boolean: "yes or no", Integer: "counts" }; // where a unit would stand

/* [{group, type, unit, places}]: what can be drawn together; at first the curves of the model's page. */
function chartList() {
  const found = [];
  const add = (k, group) => {
    const { type, unit } = COLUMNS[k];
    let chart = found.find((c) => c.group === group && c.type === type && c.unit === unit);
    if (!chart) found.push((chart = { group, type, unit, places: [] }));
    chart.places.push(k);
  };
  for (const name of FACTS.preset.curves) add(PLACE.get(name), CHOSEN);
  COLUMNS.forEach((v, k) => {
    if (v.type !== "Real" || !v.discrete) add(k, v.group);
  });
  const order = [CHOSEN, ...AT_FIRST];
  const rank = (c) => (order.indexOf(c.group) + 1 || 99);
  return found.sort((a, b) => rank(a) - rank(b));
}

function titled({ group, type, unit }) {
  const what = unit || WORDS[type];
  return what ? `${group} [${what}]` : group;
}

/* The range of an axis: a curve that stays where it is lies in the middle. */
function roomy(low, high) {
  if (low === null || low < high) return uPlot.rangeNum(low ?? 0, high ?? 1, 0.1, true);
  const pad = Math.abs(low) / 2 || 1;
  return [low - pad, high + pad];
}

/* An axis of truths or counts, and one of numbers. */
function upright(type) {
  if (type === "Boolean") {
    const words = (u, ticks) => ticks.map((y) => (y === 0 ? "no" : y === 1 ? "yes" : ""));
    return { scale: { range: [-0.15, 1.15] }, axis: { incrs: [1], values: words } };
  }
  const range = (u, low, high) => roomy(low, high);
  const whole = type === "Integer" ? { incrs: [1, 2, 5, 10, 20, 50, 100, 200, 500, 1000, 1e4, 1e5] } : {};
  return { scale: { range }, axis: { ...whole, values: (u, ticks) => ticks.map((y) => shown(y)) } };
}

/* Some columns of one type over time. */
class Chart {
  constructor(holder, places, title, legend, seek) {
    Object.assign(this, { holder, places, title, legend, seek });
    this.marker = element("div", { class: "now" });
  }

  size() {
    const width = Math.max(100, Math.floor(this.holder.clientWidth));
    return { width, height: this.legend ? HEIGHT : Math.max(80, this.holder.clientHeight) };
  }

  build(trajectory) {
    this.drop();
    const { places } = this;
    const size = this.size();
    const narrow = size.width < NARROW;
    const line = { stroke: color("--line"), width: 1 };
    const font = `${narrow ? 11 : 12}px system-ui, sans-serif`;
    const common = { stroke: color("--quiet"), grid: line, ticks: { ...line, size: narrow ? 4 : 8 }, font };
    const { type } = COLUMNS[places[0]];
    const { scale, axis } = upright(type);
    const stepped = type === "Real" ? {} : { paths: uPlot.paths.stepped({ align: 1 }) };
    const seconds = (u, ticks) => ticks.map((t) => `${shown(t)} s`);
    this.plot = new uPlot(
      {
        ...size,
        scales: { x: { time: false }, y: scale },
        axes: [
          { ...common, values: seconds, size: narrow ? 30 : 50 },
          { ...common, ...axis, size: narrow ? 46 : 64 },
        ],
        cursor: { sync: { key: "time" }, drag: { x: true, y: false } },
        legend: { show: this.legend, live: true },
        series: [
          { label: "t", value: (u, t) => (t === null ? "" : `${shown(t)} s`) },
          ...places.map((k, i) => ({
            label: COLUMNS[k].name,
            stroke: color(`--curve${i % 8}`),
            dash: i >= 8 ? [6, 3] : [],
            width: 1.75,
            points: { show: false },
            value: (u, y) => (y === null ? "" : worded(COLUMNS[k], y)),
            ...stepped,
          })),
        ],
        hooks: {
          draw: [(u) => this.events(u)],
          ready: [(u) => u.over.append(this.marker)],
        },
      },
      this.data(trajectory),
      this.holder
    );
    this.plot.over.addEventListener("click", () => {
      const { left } = this.plot.cursor;
      if (left >= 0) this.seek(this.plot.posToVal(left, "x"));
    });
    this.describe();
  }

  drop() {
    if (this.plot) this.plot.destroy();
    this.plot = null;
  }

  data(trajectory) {
    this.trajectory = trajectory;
    return [trajectory.time, ...this.places.map((k) => trajectory.columns[k])];
  }

  fill(trajectory) {
    this.plot.setData(this.data(trajectory));
    this.describe();
  }

  /* What a reader who does not see the chart is told. */
  describe() {
    const curves = this.places.map((k) => {
      const column = this.trajectory.columns[k];
      let [low, high] = [Infinity, -Infinity];
      for (const y of column) {
        if (y < low) low = y;
        if (y > high) high = y;
      }
      const told = [low, high, column[column.length - 1]].map((y) => worded(COLUMNS[k], y, 4));
      return `${COLUMNS[k].name} from ${told[0]} to ${told[1]}, at the end ${told[2]}`;
    });
    this.holder.setAttribute("aria-label", `${this.title} over time: ${curves.join("; ")}`);
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
    const { plot, marker } = this;
    const [row] = this.trajectory.place(t);
    const x = plot.valToPos(t, "x");
    marker.style.transform = `translateX(${x}px)`;
    if (this.legend && !(plot.cursor.left >= 0)) plot.setLegend({ idx: row });
    marker.hidden = !(x >= 0 && x <= plot.over.clientWidth);
  }

  resize() {
    const { plot } = this;
    const { width, height } = this.size();
    if (!plot || (plot.width === width && plot.height === height)) return;
    if (plot.width < NARROW !== width < NARROW) this.build(this.trajectory);
    else plot.setSize({ width, height });
  }
}

/* The charts that are ticked. */
class Charts {
  constructor(box, choices, seek) {
    Object.assign(this, { box, seek });
    this.list = chartList();
    const first = FACTS.preset.curves.length ? [CHOSEN] : AT_FIRST;
    this.wanted = new Set(this.list.map((c) => c.group).filter((g) => first.includes(g)));
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
    new ResizeObserver(() => this.drawn.forEach((c) => c.resize())).observe(box);
    onColors(() => this.build());
  }

  show(trajectory) {
    this.trajectory = trajectory;
    if (!this.drawn.length) this.build();
    else for (const c of this.drawn) c.fill(trajectory);
  }

  build() {
    for (const c of this.drawn) c.drop();
    this.box.replaceChildren();
    this.drawn = [];
    if (!this.trajectory) return;
    for (const chart of this.list.filter((c) => this.wanted.has(c.group))) this.add(chart);
    this.now(this.t || 0);
  }

  add(listed) {
    const { places } = listed;
    const drawn = places.slice(0, MOST);
    const title = titled(listed);
    const more = places.length - drawn.length;
    const caption = element("figcaption", {}, more ? `${title}, ${more} more not drawn` : title);
    const holder = element("div", { class: "plot", role: "img" });
    this.box.append(element("figure", { class: "chart" }, caption, holder));
    const chart = new Chart(holder, drawn, title, true, this.seek);
    chart.build(this.trajectory);
    this.drawn.push(chart);
  }

  now(t) {
    this.t = t;
    for (const c of this.drawn) c.now(t);
  }
}

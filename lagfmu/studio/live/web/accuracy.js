/* accuracy.js -- the trade of speed for accuracy, by hand: error against the run at 1e-13, and steps.
 *
 * The error of a quantity is its largest difference over the run, relative to its largest value. */

const DECADES = [3, 4, 5, 6, 7, 8, 9, 10, 11, 12];
const STEPS = PLACE.get("solver.steps");

class Accuracy {
  constructor(settings, changed) {
    this.settings = settings;
    this.tried = [];
    this.turn = 0;
    this.tight = { tolerance: TIGHTEST, method: DEFAULT_METHOD };
    this.slider = byId("tolerance");
    this.menu = byId("method");
    this.quantity = byId("quantity");
    const groups = ["Multipliers λ", "Outputs", "Coordinates", "Velocities", "Energies"];
    const able = COLUMNS.filter((v) => v.type === "Real" && !v.discrete && groups.includes(v.group));
    const first = FACTS.preset.curves; // with which the curves begin: of a mechanism the force in each joint
    const rank = (v) => (first.includes(v.name) ? first.indexOf(v.name) : first.length + groups.indexOf(v.group));
    able.sort((a, b) => rank(a) - rank(b));
    this.quantity.append(...able.map((v) => element("option", { value: v.name }, v.name)));
    this.quantity.addEventListener("change", () => this.draw());
    this.slider.addEventListener("input", () => {
      settings.tolerance = Number((10 ** -this.slider.valueAsNumber).toPrecision(3));
      this.show();
      changed();
    });
    this.menu.addEventListener("change", () => {
      settings.method = this.menu.value;
      changed();
    });
    onColors(() => this.draw());
    new ResizeObserver(() => this.draw()).observe(byId("trade").parentElement);
  }

  offer(methods) {
    this.menu.replaceChildren(...methods.map((m) => element("option", { value: m }, m)));
    this.menu.closest("label").hidden = methods.length < 2;
    this.show();
  }

  show() {
    const { tolerance, method } = this.settings;
    this.slider.value = -Math.log10(tolerance);
    this.slider.setAttribute("aria-valuetext", shown(tolerance, 3));
    byId("tolerance-shown").textContent = shown(tolerance, 3);
    if (method !== null) this.menu.value = method;
  }

  /* What was measured is of other settings. */
  forget() {
    this.turn++;
    this.present = null;
    byId("error-shown").textContent = "…";
  }

  /* Measures the present settings, then the whole curve of this method, as long as nothing changes. */
  async measure() {
    const turn = ++this.turn;
    const settings = this.settings.forRun();
    const { parameters, start, inputs, stopTime, stepSize } = settings;
    const key = JSON.stringify({ parameters, start, inputs, stopTime, stepSize });
    if (key !== this.key) this.tried = [];
    this.key = key;
    const present = await this.one(settings);
    if (turn !== this.turn) return;
    this.present = present;
    this.draw();
    for (const decade of DECADES) {
      const tolerance = Number(`1e-${decade}`);
      const { method } = settings;
      if (this.tried.some((r) => r.tolerance === tolerance && r.method === method)) continue;
      const row = await this.one({ ...settings, tolerance });
      if (turn !== this.turn) return;
      if (row.errors) this.tried.push(row);
      this.draw();
    }
  }

  async one(settings) {
    const { tolerance, method } = settings;
    try {
      const found = await computation.compare(settings, this.tight);
      return { tolerance, method, ...found };
    } catch (error) {
      return { tolerance, method, failed: error.message };
    }
  }

  draw() {
    const { present } = this;
    if (!present) return;
    const k = PLACE.get(this.quantity.value);
    const told = byId("error-shown");
    if (!present.errors || k === undefined) {
      told.textContent = present.failed || "no output to measure";
    } else {
      const steps = STEPS === undefined ? "" : `, ${present.steps[STEPS]} steps`;
      const error = shown(present.errors[k], 2);
      const time = shown(present.milliseconds, 2);
      told.textContent = `error of ${this.quantity.value}: ${error}${steps}, ${time} ms`;
    }
    this.curves(k);
  }

  curves(k) {
    const box = byId("trade");
    if (this.plot) this.plot.destroy();
    this.plot = null;
    box.hidden = STEPS === undefined || k === undefined || !this.tried.length;
    if (box.hidden) return;
    const floor = 1e-17;
    const at = (r) => [Math.max(1, r.steps[STEPS]), Math.max(floor, r.errors[k])];
    const methods = [...new Set(this.tried.map((r) => r.method))];
    const lines = methods.map((m) =>
      this.tried
        .filter((r) => r.method === m)
        .map(at)
        .sort((a, b) => a[0] - b[0])
    );
    if (this.present.errors) lines.push([at(this.present)]);
    const xs = [...new Set(lines.flat().map((p) => p[0]))].sort((a, b) => a - b);
    const data = [xs, ...lines.map((l) => xs.map((x) => (l.find((p) => p[0] === x) || [0, null])[1]))];
    const quiet = color("--quiet");
    const line = { stroke: color("--line"), width: 1 };
    const axis = { stroke: quiet, grid: line, ticks: line, font: "12px system-ui, sans-serif" };
    const power = (u, ticks) => ticks.map((v) => (v === null ? "" : shown(v, 2)));
    const decades = (u, ticks) => ticks.map((v) => (Math.log10(v) % 1 === 0 ? v : null));
    const thirds = (u, ticks) => ticks.map((v) => (Math.log10(v) % 3 === 0 ? v : null));
    const both = { grid: { ...line, filter: thirds }, ticks: { ...line, filter: thirds } };
    const series = methods.map((m, i) => ({
      label: m === null ? "error" : m,
      stroke: color(`--curve${i % 8}`),
      spanGaps: true,
      points: { show: true, size: 6 },
      value: (u, y) => (y === null ? "" : shown(y, 2)),
    }));
    if (this.present.errors) {
      const here = { show: true, size: 13, stroke: color("--ink"), fill: color("--event") };
      series.push({ label: "now", stroke: color("--ink"), paths: () => null, points: here });
    }
    this.plot = new uPlot(
      {
        width: Math.max(240, box.clientWidth - 2),
        height: 210,
        scales: { x: { time: false, distr: 3 }, y: { distr: 3 } },
        axes: [
          { ...axis, label: "steps", labelSize: 18, values: power, filter: decades, ticks: { ...line, filter: decades } },
          { ...axis, size: 64, values: power, filter: thirds, ...both },
        ],
        cursor: { drag: { x: false, y: false } },
        legend: { live: false },
        series: [{ label: "steps" }, ...series],
      },
      data,
      box
    );
    const text = lines.flat().map(([x, y]) => `${x} steps ${shown(y, 2)}`);
    box.setAttribute("aria-label", `error against steps: ${text.join("; ")}`);
  }
}

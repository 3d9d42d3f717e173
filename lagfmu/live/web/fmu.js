/* fmu.js -- runs of an FMU whose sources were compiled with importer.c to WebAssembly.
 *
 * A run is what fmpy.simulate_fmu does: the same calls, the same communication points, a row at each.
 * Runs in the worker; knows nothing of the page. */

const OK = 1; // fmi2OK and fmi2Warning; then come discard, error, fatal, pending
const STATUS = ["ok", "warning", "discard", "error", "fatal", "pending"];
const NUMBERS = ["Real", "Integer", "Boolean"];
const LONGEST = 1e6; // communication points of a run, all of which are kept

/* The FMU refused; `message` is its own reason, `log` all that it said. */
class Refused extends Error {
  constructor(log, what) {
    const said = log.filter((m) => m.status !== "ok" && m.status !== "warning");
    super(said.map((m) => m.message).join("; ") || `${what}: the FMU gave no reason`);
    this.log = log;
  }
}

/* Python's math.isclose, which fmpy compares times with. */
function isClose(a, b) {
  return a === b || Math.abs(a - b) <= 1e-9 * Math.max(Math.abs(a), Math.abs(b));
}

/* Problems of the settings in words; an FMU would not know these names. */
function problemsOf(variables, settings) {
  const problems = [];
  const kinds = { parameters: ["parameter", "solver"], start: ["start"], inputs: ["input"] };
  for (const [key, roles] of Object.entries(kinds)) {
    const known = variables.filter((v) => roles.includes(v.role) && NUMBERS.includes(v.type)).map((v) => v.name);
    for (const [name, value] of Object.entries(settings[key] || {})) {
      if (!known.includes(name)) {
        const listed = known.join(", ") || "none: this FMU has no such variable";
        problems.push(`${key}: '${name}' cannot be set, expected one of ${listed}`);
      } else if (typeof value !== "number" || !Number.isFinite(value)) {
        problems.push(`${key}: '${name}' = ${value}, expected a finite number`);
      }
    }
  }
  for (const key of ["stopTime", "stepSize"]) {
    const value = settings[key];
    if (!(Number.isFinite(value) && value > 0)) {
      problems.push(`${key} = ${value} s, expected a positive number`);
    }
  }
  if (settings.stopTime / settings.stepSize > LONGEST) {
    problems.push(`stepSize = ${settings.stepSize} s asks for more than ${LONGEST} points`);
  }
  const t = settings.tolerance;
  const { max } = variables.find((v) => v.name === "solver.tolerance");
  if (t !== null && !(t > 0 && t <= max)) {
    problems.push(`tolerance = ${t}, expected a positive number of at most ${max}, e.g. 1e-8`);
  }
  return problems;
}

class Fmu {
  /* `exports` of the module, and the variables as the page's facts list them. */
  constructor(exports, variables) {
    this.c = exports;
    this.variables = variables;
    this.byName = new Map(variables.map((v) => [v.name, v]));
    this.columns = variables.filter((v) => v.column);
    if (this.c._initialize) this.c._initialize();
    this.references = this.c.page_memory(4 * this.columns.length + 8);
    new Int32Array(this.c.memory.buffer, this.references, this.columns.length).set(
      this.columns.map((v) => v.reference)
    );
    this.row = this.c.page_memory(8 * this.columns.length + 8);
    this.menu = this.byName.get("solver.method");
    this.methods = this.menu ? this.menu.items.map((item) => item.name) : [];
  }

  log() {
    const start = this.c.page_log();
    const end = start + this.c.page_log_size();
    const found = [];
    for (let at = start; at < end; ) {
      const bytes = new Uint8Array(this.c.memory.buffer, at, end - at);
      const size = bytes.indexOf(0);
      const text = new TextDecoder().decode(bytes.slice(0, size));
      found.push({ status: STATUS[Number(text[0])] || "error", message: text.slice(1).trim() });
      at += size + 1;
    }
    return found;
  }

  check(status, what) {
    if (status > OK) throw new Refused(this.log(), what);
  }

  /* settings: parameters, start, inputs: {name: value}; tolerance or null; method or null; stopTime,
   * stepSize [s].  Returns {time, columns: [Float64Array], log, failed, milliseconds}; `failed` is the
   * reason of a step that could not be done, the rows end before it.  Throws Refused, or a RangeError
   * that names all problems. */
  run(settings) {
    const problems = problemsOf(this.variables, settings);
    const { method } = settings;
    if (method !== null && !this.methods.includes(method)) {
      problems.push(`method = '${method}', expected one of ${this.methods.join(", ")}`);
    }
    if (problems.length) throw new RangeError(problems.join("; "));
    const began = performance.now();
    const c = this.c;
    this.check(c.page_instantiate(), "fmi2Instantiate");
    for (const key of ["parameters", "start", "inputs"]) {
      for (const [name, value] of Object.entries(settings[key] || {})) {
        this.check(c.page_set(this.byName.get(name).reference, value), name);
      }
    }
    if (method !== null) {
      const { value } = this.menu.items.find((item) => item.name === method);
      this.check(c.page_set(this.menu.reference, value), "solver.method");
    }
    this.check(c.page_setup(settings.tolerance || 0, settings.stopTime), "fmi2SetupExperiment");
    this.check(c.page_initialize(), "initialization");
    const found = this.stepped(settings.stopTime, settings.stepSize);
    found.milliseconds = performance.now() - began;
    return found;
  }

  stepped(stop, step) {
    const width = this.columns.length;
    let room = Math.ceil(stop / step) + 3;
    const time = new Float64Array(room);
    const columns = this.columns.map(() => new Float64Array(room));
    let rows = 0;
    const sample = (t) => {
      this.check(this.c.page_read(this.references, width, this.row), "values");
      const values = new Float64Array(this.c.memory.buffer, this.row, width);
      time[rows] = t;
      for (let k = 0; k < width; k++) columns[k][rows] = values[k];
      rows++;
    };
    let t = 0;
    let failed = null;
    sample(t);
    for (let n = 1; t < stop && !isClose(t, stop); n++) {
      let next = n * step;
      if (next > stop && !isClose(next, stop)) next = stop;
      const status = this.c.page_step(t, next - t);
      if (status > OK) {
        failed = new Refused(this.log(), "fmi2DoStep").message;
        const reached = this.c.page_reached();
        if (reached > t) sample(reached);
        break;
      }
      t = next;
      sample(t);
    }
    return {
      time: time.slice(0, rows),
      columns: columns.map((column) => column.slice(0, rows)),
      log: this.log(),
      failed,
    };
  }
}

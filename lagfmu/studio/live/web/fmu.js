/* fmu.js -- runs of an FMU whose sources were compiled with importer.c to WebAssembly.
 *
 * A run is what an importer's is: the same settings, the same communication points, a row at each; the loop
 * is the FMU's own (batch.c).  Runs in the worker; knows nothing of the page. */

const [DONE, REFUSED, NO_MEMORY] = [0, 3, -1]; // statuses of a run
const NOTES = ["warning", "ok", "discard", "error"]; // what a message is
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

/* Does a value hold a rule of interface/variables.py?  Their messages come with the facts. */
const HOLDS = {
  settable: (v) => v.role !== "output",
  finite: (v, value) => typeof value === "number" && Number.isFinite(value),
  whole: (v, value) => v.type === "Real" || Number.isInteger(value),
  range: (v, value) => (v.min === null || value >= v.min) && (v.max === null || value <= v.max),
  positive: () => true, // an FMU does not describe it, and says it itself
};

/* What is wrong with a value of a variable; empty if nothing is. */
function problemOf(rules, variable, value) {
  const broken = Object.keys(rules).find((rule) => !HOLDS[rule](variable, value));
  if (!broken) return "";
  const numbers = { value, minimum: variable.min ?? -Infinity, maximum: variable.max ?? Infinity };
  const told = { name: variable.name };
  for (const [key, number] of Object.entries(numbers)) told[key] = asInPython(number);
  return rules[broken].replace(/\{(\w+)\}/g, (_, key) => told[key]);
}

/* As Python writes it. */
function asInPython(value) {
  const text = String(value);
  return text.replace("Infinity", "inf").replace("NaN", "nan").replace(/^-?\d+$/, "$&.0");
}

/* Problems of the settings in words; an FMU would not know these names. */
function problemsOf(variables, rules, settings) {
  const problems = [];
  const kinds = { parameters: ["parameter", "solver"], start: ["start"], inputs: ["input"] };
  for (const [key, roles] of Object.entries(kinds)) {
    const known = variables.filter((v) => roles.includes(v.role) && NUMBERS.includes(v.type));
    for (const [name, value] of Object.entries(settings[key] || {})) {
      const variable = known.find((v) => v.name === name);
      if (variable) {
        const problem = problemOf(rules, variable, value);
        if (problem) problems.push(`${key}: ${problem}`);
      } else {
        const listed = known.map((v) => v.name).join(", ") || "none: this FMU has no such variable";
        problems.push(`${key}: '${name}' cannot be set, expected one of ${listed}`);
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

/* 0, h, 2 h, ..., and the stop time [s]. */
function communicationPoints(stop, step) {
  const points = [0];
  for (let n = 1; points[n - 1] < stop && !isClose(points[n - 1], stop); n++) {
    const next = n * step;
    points.push(next > stop && !isClose(next, stop) ? stop : next);
  }
  return Float64Array.from(points);
}

class Fmu {
  /* `exports` of the module, the variables as the page's facts list them, and the messages of the rules. */
  constructor(exports, variables, rules) {
    this.c = exports;
    this.variables = variables;
    this.rules = rules;
    this.byName = new Map(variables.map((v) => [v.name, v]));
    this.columns = variables.filter((v) => v.column);
    if (this.c._initialize) this.c._initialize();
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
      found.push({ status: NOTES[Number(text[0])], message: text.slice(1).trim() });
      at += size + 1;
    }
    return found;
  }

  /* settings: parameters, start, inputs: {name: value}; tolerance or null; method or null; stopTime,
   * stepSize [s].  Returns {time, columns: [Float64Array], log, failed, milliseconds}; `failed` is the
   * reason of a step that could not be done, the rows end before it.  Throws Refused, or a RangeError
   * that names all problems. */
  run(settings) {
    const problems = problemsOf(this.variables, this.rules, settings);
    const { method, tolerance, stopTime, stepSize } = settings;
    if (method !== null && !this.methods.includes(method)) {
      problems.push(`method = '${method}', expected one of ${this.methods.join(", ")}`);
    }
    if (problems.length) throw new RangeError(problems.join("; "));
    const given = { ...settings.parameters, ...settings.start, ...settings.inputs };
    if (method !== null) given[this.menu.name] = this.menu.items.find((item) => item.name === method).value;
    const began = performance.now();
    const found = this.stepped(given, tolerance || 0, communicationPoints(stopTime, stepSize));
    found.milliseconds = performance.now() - began;
    return found;
  }

  stepped(given, tolerance, times) {
    const { c } = this;
    const width = this.columns.length;
    const references = Object.keys(given).map((name) => this.byName.get(name).reference);
    const held = [];
    const put = (numbers, Kind, room = numbers.length) => {
      const at = c.page_memory(Math.max(1, room) * Kind.BYTES_PER_ELEMENT);
      if (at === 0) throw new RangeError(`${times.length} points are more than fit in memory`);
      held.push(at);
      new Kind(c.memory.buffer, at, numbers.length).set(numbers);
      return at;
    };
    try {
      const vary = put(references, Uint32Array);
      const values = put(Object.values(given), Float64Array);
      const points = put(times, Float64Array);
      const keep = put(this.columns.map((v) => v.reference), Uint32Array);
      const rows = put([], Float64Array, width * times.length);
      const status = c.page_run(
        ...[references.length, vary, values, tolerance, times.length, points, width, keep, rows]
      );
      if (status === NO_MEMORY) throw new RangeError("a run needs more memory than there is");
      const reached = c.page_reached();
      if (status === REFUSED && reached === times[0]) throw new Refused(this.log(), "initialization");
      const time = times.filter((t) => t <= reached);
      const table = new Float64Array(c.memory.buffer, rows, width * time.length);
      return {
        time,
        columns: this.columns.map((_, k) => time.map((_, n) => table[n * width + k])),
        log: this.log(),
        failed: status === DONE ? null : new Refused(this.log(), "the step").message,
      };
    } finally {
      held.forEach((at) => c.page_release(at));
    }
  }
}

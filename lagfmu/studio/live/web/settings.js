/* settings.js -- what the reader set, and what the FMU has: only what differs is given to the FMU, as an
 * importer does, so that the other start values may move onto the constraints. */

const TIGHTEST = 1e-13;
const KEYS = { parameter: "parameters", solver: "parameters", start: "start", input: "inputs" };
const SETTABLE = FACTS.variables.filter((v) => v.role in KEYS && ["Real", "Integer", "Boolean"].includes(v.type));
const MENU = FACTS.variables.find((v) => v.name === "solver.method" && v.items.length);
const DEFAULT_METHOD = MENU ? MENU.items.find((item) => item.value === MENU.start).name : null;

class Settings {
  constructor() {
    this.clear();
  }

  clear() {
    this.values = new Map(); // of what was changed, by name
    this.tolerance = FACTS.experiment.tolerance;
    this.method = DEFAULT_METHOD;
    this.stopTime = FACTS.experiment.stopTime;
    this.stepSize = FACTS.experiment.stepSize;
  }

  get(variable) {
    return this.values.has(variable.name) ? this.values.get(variable.name) : variable.start;
  }

  set(variable, value) {
    if (value === variable.start) this.values.delete(variable.name);
    else this.values.set(variable.name, value);
  }

  forRun() {
    const { tolerance, method, stopTime, stepSize } = this;
    const found = { parameters: {}, start: {}, inputs: {}, tolerance, method, stopTime, stepSize };
    for (const v of SETTABLE) {
      if (this.values.has(v.name)) found[KEYS[v.role]][v.name] = this.values.get(v.name);
    }
    return found;
  }

  /* The text behind # in a link. */
  asLink() {
    const { tolerance, method, stopTime, stepSize } = this;
    const values = Object.fromEntries(this.values);
    return encodeURIComponent(JSON.stringify({ values, tolerance, method, stopTime, stepSize }));
  }

  /* Takes what a link says; returns what in it this FMU does not have. */
  takeLink(text) {
    let given;
    try {
      given = JSON.parse(decodeURIComponent(text));
    } catch {
      return ["the text behind # in the address, which is no settings of this page"];
    }
    const unknown = [];
    for (const [name, value] of Object.entries((given && given.values) || {})) {
      const v = SETTABLE.find((candidate) => candidate.name === name);
      if (v && Number.isFinite(value)) this.set(v, value);
      else unknown.push(name);
    }
    for (const key of ["tolerance", "stopTime", "stepSize"]) {
      if (given && Number.isFinite(given[key]) && given[key] > 0) this[key] = given[key];
    }
    if (given && typeof given.method === "string" && MENU) this.method = given.method;
    return unknown;
  }
}

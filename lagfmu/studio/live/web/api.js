/* api.js -- window.lagfmu: the page's FMU for scripts; the page itself uses it too.
 *
 *   await lagfmu.run({parameters: {m: 2.5}, start: {theta: 0.3}, inputs: {F: 1}, tolerance: 1e-9,
 *                     method: "auto", stopTime: 2, stepSize: 0.01})
 *   -> {time: [...], values: {"lambda.surface": [...], ...}, log: [{status, message}, ...]}
 *
 * A row a communication point, as fmpy has it.  What is left out is as in the FMU.  A run that the FMU
 * refuses rejects with its message; `error.log` holds the rest, and if a step failed, `error.result` the
 * rows up to there. */

const FACTS = JSON.parse(document.getElementById("facts").textContent);
FACTS.variables = FACTS.variables.map((row, place) => {
  const v = Object.fromEntries(FACTS.usual.map(([key, usual], k) => [key, row[k] ?? usual]));
  return { ...v, reference: v.reference ?? place, group: FACTS.groups[v.group] };
});

/* What a script element holds, packed. */
async function inflated(box) {
  const bytes = Uint8Array.from(atob(box.textContent.trim()), (c) => c.charCodeAt(0));
  const stream = new Blob([bytes]).stream().pipeThrough(new DecompressionStream("deflate"));
  return new Response(stream).arrayBuffer();
}

class Computation {
  constructor() {
    this.waiting = new Map();
    this.count = 0;
    this.loaded = this.load();
  }

  async load() {
    const text = await inflated(document.getElementById("worker-source"));
    const module = await inflated(document.getElementById("module"));
    const url = URL.createObjectURL(new Blob([text], { type: "text/javascript" }));
    this.worker = new Worker(url);
    this.worker.onmessage = ({ data }) => this.answered(data);
    this.worker.onerror = (event) => {
      for (const { reject } of this.waiting.values()) reject(new Error(event.message));
      this.waiting.clear();
    };
    return this.ask({ kind: "load", module, variables: FACTS.variables, rules: FACTS.rules }, [module]);
  }

  ask(job, transfer = []) {
    const id = ++this.count;
    return new Promise((resolve, reject) => {
      this.waiting.set(id, { resolve, reject });
      this.worker.postMessage({ ...job, id }, transfer);
    });
  }

  answered({ id, result, error, log }) {
    const { resolve, reject } = this.waiting.get(id);
    this.waiting.delete(id);
    if (error === undefined) resolve(result);
    else reject(Object.assign(new Error(error), { log }));
  }

  async run(settings) {
    await this.loaded;
    return this.ask({ kind: "run", settings });
  }

  async compare(settings, tight) {
    await this.loaded;
    return this.ask({ kind: "compare", settings, tight });
  }
}

/* A run that was recorded, in place of one that is computed. */
class Recording {
  constructor(box) {
    this.loaded = this.load(box);
  }

  /* One number after the other: the times, then column by column; of several runs one after the other. */
  async load(box) {
    const numbers = new Float64Array(await inflated(box));
    const count = FACTS.modes ? FACTS.modes.length : 1;
    const rows = numbers.length / (COLUMNS.length + 1) / count;
    const part = (k) => numbers.slice(k * rows, (k + 1) * rows);
    this.recorded = Array.from({ length: count }, (_, i) => {
      const [time, ...columns] = Array.from({ length: COLUMNS.length + 1 }, (_, k) =>
        part(i * (COLUMNS.length + 1) + k)
      );
      return { time, columns, log: [], failed: null, milliseconds: null };
    });
    return { methods: [] };
  }

  async run() {
    await this.loaded;
    return this.recorded[this.chosen || 0];
  }

  async compare() {
    throw new Error("a recorded run has nothing to compare with");
  }
}

const COLUMNS = FACTS.variables.filter((v) => v.column);
const RECORDED = document.getElementById("recording");
const computation = RECORDED ? new Recording(RECORDED) : new Computation();

/* Settings with what was left out; a key that is unknown is an error. */
function complete(settings) {
  const whole = {
    parameters: {},
    start: {},
    inputs: {},
    tolerance: null,
    method: null,
    stopTime: FACTS.experiment.stopTime,
    stepSize: FACTS.experiment.stepSize,
  };
  const unknown = Object.keys(settings).filter((key) => !(key in whole));
  if (unknown.length) {
    const known = Object.keys(whole).join(", ");
    throw new RangeError(`${unknown.join(", ")}: no such setting, expected some of ${known}`);
  }
  return { ...whole, ...settings };
}

/* Columns as plain arrays by name: numbers, and true or false. */
function byName(run) {
  const values = {};
  COLUMNS.forEach((v, k) => {
    const column = Array.from(run.columns[k]);
    values[v.name] = v.type === "Boolean" ? column.map(Boolean) : column;
  });
  return { time: Array.from(run.time), values, log: run.log };
}

window.lagfmu = {
  name: FACTS.name,
  variables: FACTS.variables,
  async run(settings = {}) {
    const run = await computation.run(complete(settings));
    const result = byName(run);
    if (run.failed) throw Object.assign(new Error(run.failed), { log: run.log, result });
    return result;
  },
};

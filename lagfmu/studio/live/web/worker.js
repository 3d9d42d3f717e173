/* worker.js -- the thread that computes: one FMU, one job after the other.
 *
 * In: {kind: "load", module, variables, rules}, then {kind: "run" | "compare", id, settings[, reference]}.
 * Out: {id, ...} with the result, or {id, error, log}. */

let fmu = null;
let reference = { key: "", run: null };

/* Largest difference of each column from the reference, relative to its largest value there. */
function errorsOf(run, exact) {
  return run.columns.map((column, k) => {
    const other = exact.columns[k];
    let largest = 0;
    let difference = 0;
    for (let i = 0; i < Math.min(column.length, other.length); i++) {
      largest = Math.max(largest, Math.abs(other[i]));
      difference = Math.max(difference, Math.abs(column[i] - other[i]));
    }
    return largest > 0 ? difference / largest : difference;
  });
}

/* The run at the reference's tolerance and method, kept until the physics changes. */
function exact(settings, tight) {
  const { parameters, start, inputs, stopTime, stepSize } = settings;
  const key = JSON.stringify({ parameters, start, inputs, stopTime, stepSize, tight });
  if (reference.key !== key) {
    reference = { key, run: fmu.run({ ...settings, ...tight }) };
  }
  return reference.run;
}

const JOBS = {
  load: async ({ module, variables, rules }) => {
    const { instance } = await WebAssembly.instantiate(module, {});
    fmu = new Fmu(instance.exports, variables, rules);
    return { methods: fmu.methods };
  },
  run: async ({ settings }) => fmu.run(settings),
  compare: async ({ settings, tight }) => {
    const best = exact(settings, tight);
    const run = fmu.run(settings);
    return {
      errors: errorsOf(run, best),
      milliseconds: run.milliseconds,
      failed: run.failed || best.failed,
      steps: run.columns.map((column) => column[column.length - 1]),
    };
  },
};

let last = Promise.resolve();
self.onmessage = ({ data }) => {
  last = last.then(async () => {
    try {
      const result = await JOBS[data.kind](data);
      const arrays = [result.time, ...(result.columns || [])].filter((a) => a instanceof Float64Array);
      self.postMessage({ id: data.id, result }, arrays.map((a) => a.buffer));
    } catch (error) {
      self.postMessage({ id: data.id, error: error.message, log: error.log || [] });
    }
  });
};

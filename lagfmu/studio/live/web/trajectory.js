/* trajectory.js -- a run as the page reads it: values at any time, and what happened when. */

const PLACE = new Map(COLUMNS.map((v, k) => [v.name, k]));

class Trajectory {
  constructor(run, settings) {
    this.time = run.time;
    this.columns = run.columns;
    this.log = run.log;
    this.failed = run.failed;
    this.milliseconds = run.milliseconds;
    this.fixed = new Map(SETTABLE.map((v) => [v.name, settings.get(v)])); // parameters, inputs
    this.events = this.happened();
  }

  get end() {
    return this.time[this.time.length - 1];
  }

  /* The row at or before time t [s], and the part of the way to the next. */
  place(t) {
    let low = 0;
    let high = this.time.length - 1;
    while (high - low > 1) {
      const middle = (low + high) >> 1;
      if (this.time[middle] <= t) low = middle;
      else high = middle;
    }
    if (high === low) return [low, 0];
    const part = (t - this.time[low]) / (this.time[high] - this.time[low]);
    return [low, Math.min(1, Math.max(0, part))];
  }

  /* A variable's value at a place; between two rows linear, if it is continuous. */
  at(name, [row, part]) {
    if (name === "time") return this.time[row] + (part ? part * (this.time[row + 1] - this.time[row]) : 0);
    const k = PLACE.get(name);
    if (k === undefined) return this.fixed.get(name);
    const column = this.columns[k];
    const here = column[row];
    if (part === 0) return here;
    if (COLUMNS[k].discrete) return part < 1 ? here : column[row + 1];
    return here + part * (column[row + 1] - here);
  }

  /* Whether a variable says something there: the time and the state of an event from the first one on. */
  isKnown(variable, [row]) {
    return !variable.counted || this.columns[PLACE.get(variable.counted)][row] > 0;
  }

  /* [{time, text}]: counted events at their time, else a truth that changes, at the row that shows it. */
  happened() {
    const found = [];
    COLUMNS.forEach((v, k) => {
      const column = this.columns[k];
      if (v.event) {
        const name = v.name.slice(0, -".count".length);
        const times = this.columns[PLACE.get(`${name}.time`)];
        const impulse = PLACE.get(`${name}.impulse`);
        for (let i = 1; i < column.length; i++) {
          const more = column[i] - column[i - 1];
          const blow = this.columns[impulse]?.[i] > 0 ? `, impulse ${shown(this.columns[impulse][i])} ${COLUMNS[impulse].unit}` : "";
          const text = `${name}${more > 1 ? ` (latest of ${more})` : ""}${blow}`;
          if (more > 0 && times) found.push({ time: times[i], text });
        }
      } else if (v.type === "Boolean" && !v.name.startsWith("unique.")) {
        for (let i = 1; i < column.length; i++) {
          if (column[i] === column[i - 1]) continue;
          const text = `${v.name} ${column[i] ? "begins" : "ends"}`;
          found.push({ time: this.time[i], since: this.time[i - 1], text, truth: true });
        }
      }
    });
    const counted = found.filter((e) => !e.truth);
    return found
      .filter((e) => !e.truth || !counted.some((c) => e.since < c.time && c.time <= e.time))
      .sort((a, b) => a.time - b.time);
  }

  csv() {
    const lines = [["time", ...COLUMNS.map((v) => v.name)].map((n) => `"${n}"`).join(",")];
    for (let i = 0; i < this.time.length; i++) {
      lines.push([this.time[i], ...this.columns.map((column) => column[i])].join(","));
    }
    return `${lines.join("\r\n")}\r\n`;
  }
}

/* controls.js -- a slider and a number for each parameter, start value and input. */

const TITLES = [
  ["parameter", "Parameters", true],
  ["start", "Start values", true],
  ["input", "Inputs, held over the run", true],
];

/* 1, 2 or 5 times a power of ten, about a two-hundredth of the width. */
function niceStep(width) {
  const rough = width / 200;
  const power = 10 ** Math.floor(Math.log10(rough));
  const factor = [1, 2, 5, 10].find((f) => f * power >= rough) || 10;
  return Number((factor * power).toPrecision(1));
}

/* The ends of a slider: those of the model's page, or the bounds, and where there are none what the value
 * suggests. */
function rangeOf(v) {
  const told = FACTS.preset.ranges[v.name];
  if (told) return { low: told[0], high: told[1], step: niceStep(told[1] - told[0]) };
  const value = Number(v.start);
  const size = Math.abs(value);
  let low = value < 0 ? 3 * value : 0;
  let high = value > 0 ? 3 * value : 0;
  if (v.role !== "parameter") {
    const reach = v.unit === "rad" ? Math.PI : Math.max(2 * size, 1);
    const center = v.unit === "rad" ? 0 : value;
    low = Math.min(center - reach, value);
    high = Math.max(center + reach, value);
  } else if (value === 0) {
    [low, high] = [-1, 1];
  }
  if (v.min !== null) low = v.min;
  if (v.max !== null) high = v.max;
  if (!(low < high)) [low, high] = [low - 1, low + 1];
  const step = niceStep(high - low);
  return { low: Math.floor(low / step + 1e-9) * step, high: Math.ceil(high / step - 1e-9) * step, step };
}

class Dial {
  constructor(variable, settings, changed) {
    this.variable = variable;
    this.settings = settings;
    const { low, high, step } = rangeOf(variable);
    const id = `dial-${variable.reference}`;
    const hint = variable.description;
    this.slider = element("input", {
      type: "range",
      min: Number(low.toPrecision(12)),
      max: Number(high.toPrecision(12)),
      step,
      id,
      "data-name": variable.name,
      "aria-label": [variable.name, hint].filter(Boolean).join(", "),
    });
    this.number = element("input", {
      type: "number",
      step: "any",
      "aria-label": `${variable.name}, as a number${variable.unit ? ` in ${variable.unit}` : ""}`,
    });
    const name = element("label", { for: id }, element("code", {}, variable.name));
    if (hint) name.append(" ", element("small", {}, hint));
    const unit = element("span", { class: "unit" }, variable.unit);
    this.moved = element("small", { class: "moved" });
    this.row = element("div", { class: "dial" }, name, this.slider, this.number, unit, this.moved);
    this.slider.addEventListener("input", () => this.take(this.slider.valueAsNumber, changed));
    this.number.addEventListener("input", () => this.take(this.number.valueAsNumber, changed));
    this.show();
  }

  take(value, changed) {
    if (!Number.isFinite(value)) return; // half typed
    this.settings.set(this.variable, value);
    this.show(document.activeElement === this.number);
    changed();
  }

  /* A start value that misses the constraints was moved: the run begins with another. */
  tell(trajectory) {
    if (this.variable.role !== "start") return;
    const given = this.settings.get(this.variable);
    const used = trajectory.at(this.variable.name, [0, 0]);
    const same = used === undefined || Math.abs(used - given) <= 1e-9 * Math.max(1e-3, Math.abs(used));
    const text = same ? "" : `the constraints make it ${withUnit(used, this.variable.unit, 6)}`;
    if (this.moved.textContent !== text) this.moved.textContent = text;
  }

  show(typing = false) {
    const value = this.settings.get(this.variable);
    this.slider.value = value;
    this.slider.setAttribute("aria-valuetext", withUnit(value, this.variable.unit));
    if (!typing) this.number.value = Number(Number(value).toPrecision(12));
    this.row.classList.toggle("changed", this.settings.values.has(this.variable.name));
  }
}

/* All dials, in one fieldset a role; returns functions that show the settings anew, and what became of the
 * start values. */
function buildDials(box, settings, changed) {
  const dials = [];
  const first = FACTS.preset.sliders.map((name) => SETTABLE.find((v) => v.name === name));
  const groups = TITLES.map(([role, title, open]) => [
    SETTABLE.filter((v) => v.role === role && !first.includes(v)),
    first.length ? `Other ${title.toLowerCase()}` : title,
    open && !first.length,
  ]);
  for (const [found, title, open] of [[first, "To play with", true], ...groups]) {
    if (!found.length) continue;
    const made = found.map((v) => new Dial(v, settings, changed));
    dials.push(...made);
    box.append(
      element("details", { open }, element("summary", {}, title), ...made.map((d) => d.row))
    );
  }
  return {
    show: () => dials.forEach((d) => d.show()),
    tell: (trajectory) => dials.forEach((d) => d.tell(trajectory)),
  };
}

/* format.js -- numbers and elements of the page. */

const byId = (id) => document.getElementById(id);

/* A number for reading: enough digits to tell, not more. */
function shown(value, digits = 6) {
  if (typeof value === "boolean") return value ? "yes" : "no";
  if (value === 0) return "0";
  const size = Math.abs(value);
  if (size >= 1e6 || size < 1e-4) {
    return value.toExponential(digits - 1).replace(/\.?0+e/, "e").replace("e+", "e");
  }
  return String(Number(value.toPrecision(digits)));
}

function withUnit(value, unit, digits) {
  return unit ? `${shown(value, digits)} ${unit}` : shown(value, digits);
}

/* A value of a variable with its unit; a truth as a word. */
function worded(variable, value, digits) {
  return variable.type === "Boolean" ? shown(Boolean(value)) : withUnit(value, variable.unit, digits);
}

/* An element with attributes and children; a text is text, never markup. */
function element(tag, attributes = {}, ...children) {
  const made = document.createElement(tag);
  for (const [key, value] of Object.entries(attributes)) {
    if (value === true) made.setAttribute(key, "");
    else if (value !== false && value !== null) made.setAttribute(key, value);
  }
  made.append(...children);
  return made;
}

/* What is drawn is drawn anew where colours change: in the other theme, and on paper. */
function onColors(draw) {
  for (const media of ["(prefers-color-scheme: dark)", "print"]) {
    matchMedia(media).addEventListener("change", draw);
  }
}

function color(name) {
  return getComputedStyle(document.documentElement).getPropertyValue(name).trim();
}

/* Not more often than every `wait` ms, and a last time at the end. */
function calmly(action, wait) {
  let timer = 0;
  return () => {
    clearTimeout(timer);
    timer = setTimeout(action, wait);
  };
}

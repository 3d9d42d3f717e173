/* expression.js -- the expressions of a picture: numbers, names, and lists [operation, ...operands].
 *
 * They are data of the FMU, evaluated here and never run as a program.  page/picture.py has the
 * same operations. */

/* A table at x: whether it repeats, then a knot and its four coefficients, row by row (numeric/functions.py). */
function spline(x, periodic, ...rows) {
  const last = rows.length - 5;
  const period = rows[last] - rows[0];
  if (periodic) x -= period * Math.floor((x - rows[0]) / period);
  let k = last;
  while (k > 0 && rows[k] > x) k -= 5;
  const s = x - rows[k];
  const [c0, c1, c2, c3] = rows.slice(k + 1, k + 5);
  return s < 0 ? c0 + s * c1 : c0 + s * (c1 + s * (c2 + s * c3));
}

/* An element of the rotation matrix of a quaternion (model/attitude.py), which between two rows is no longer
 * of norm 1. */
function attitude(i, j, e0, ...e) {
  const norm = e.reduce((sum, x) => sum + x * x, e0 * e0);
  if (i === j) return e.reduce((sum, x, k) => sum + (k === i ? x * x : -x * x), e0 * e0) / norm;
  const sign = (i + 1) % 3 === j ? 1 : -1;
  return (2 * (e[i] * e[j] - sign * e0 * e[3 - i - j])) / norm;
}

const OPERATIONS = {
  "+": (...x) => x.reduce((a, b) => a + b, 0),
  "*": (...x) => x.reduce((a, b) => a * b, 1),
  "^": (a, b) => a ** b,
  sin: Math.sin,
  cos: Math.cos,
  tan: Math.tan,
  asin: Math.asin,
  acos: Math.acos,
  atan: Math.atan,
  atan2: Math.atan2,
  sinh: Math.sinh,
  cosh: Math.cosh,
  tanh: Math.tanh,
  exp: Math.exp,
  log: Math.log,
  abs: Math.abs,
  sign: Math.sign,
  min: Math.min,
  max: Math.max,
  spline,
  attitude,
};

/* A function of a look-up of names; NaN where a name is unknown. */
function compiled(expression) {
  if (typeof expression === "number") return () => expression;
  if (typeof expression === "string") {
    return (look) => {
      const value = look(expression);
      return typeof value === "number" ? value : NaN;
    };
  }
  const [head, ...rest] = expression;
  if (!Object.hasOwn(OPERATIONS, head)) return () => NaN;
  const operation = OPERATIONS[head];
  const operands = rest.map(compiled);
  if (operands.length === 1) return (look) => operation(operands[0](look));
  if (operands.length === 2) return (look) => operation(operands[0](look), operands[1](look));
  return (look) => operation(...operands.map((f) => f(look)));
}

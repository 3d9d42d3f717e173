/* expression.js -- the expressions of a picture: numbers, names, and lists [operation, ...operands].
 *
 * They are data of the FMU, evaluated here and never run as a program.  picture/expression.py has the
 * same operations. */

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

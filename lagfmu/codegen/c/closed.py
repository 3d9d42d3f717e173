"""Matrices and vectors of closed functions as C99: the functions that compute them, and calls of these."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence

from ...model.closing import VECTOR, Step
from ...model.elements import Expr

ROTATION = """/* R (3, 3) by rows, of a unit quaternion. */
static void rotation(const double *e, double *R) {
    const double w = e[0], x = e[1], y = e[2], z = e[3];
    R[0] = w * w + x * x - y * y - z * z;
    R[1] = 2.0 * (x * y - w * z);
    R[2] = 2.0 * (x * z + w * y);
    R[3] = 2.0 * (x * y + w * z);
    R[4] = w * w - x * x + y * y - z * z;
    R[5] = 2.0 * (y * z - w * x);
    R[6] = 2.0 * (x * z - w * y);
    R[7] = 2.0 * (y * z + w * x);
    R[8] = w * w - x * x - y * y + z * z;
}
"""
ROTATION_CHANGE = """/* Its change for that of the quaternion. */
static void rotation_change(const double *e, const double *d, double *R) {
    const double w = 2.0 * e[0], x = 2.0 * e[1], y = 2.0 * e[2], z = 2.0 * e[3];
    const double ww = w * d[0], xx = x * d[1], yy = y * d[2], zz = z * d[3];
    const double wx = w * d[1] + x * d[0], wy = w * d[2] + y * d[0], wz = w * d[3] + z * d[0];
    const double xy = x * d[2] + y * d[1], xz = x * d[3] + z * d[1], yz = y * d[3] + z * d[2];
    R[0] = ww + xx - yy - zz;
    R[1] = xy - wz;
    R[2] = xz + wy;
    R[3] = xy + wz;
    R[4] = ww - xx + yy - zz;
    R[5] = yz - wx;
    R[6] = xz - wy;
    R[7] = yz + wx;
    R[8] = ww - xx - yy + zz;
}
"""
TURNED = """/* u = R s. */
static void turned(const double *R, const double *s, double *u) {
    for (int i = 0; i < 3; i++) u[i] = R[3 * i] * s[0] + R[3 * i + 1] * s[1] + R[3 * i + 2] * s[2];
}
"""
TURNED_CHANGE = """/* u = dR s + R ds. */
static void turned_change(const double *R, const double *dR, const double *s, const double *ds,
                          double *u) {
    for (int i = 0; i < 3; i++) {
        u[i] = dR[3 * i] * s[0] + dR[3 * i + 1] * s[1] + dR[3 * i + 2] * s[2] + R[3 * i] * ds[0] +
               R[3 * i + 1] * ds[1] + R[3 * i + 2] * ds[2];
    }
}
"""
ACROSS = """/* x = w x s. */
static void across(const double *w, const double *s, double *x) {
    x[0] = w[1] * s[2] - w[2] * s[1];
    x[1] = w[2] * s[0] - w[0] * s[2];
    x[2] = w[0] * s[1] - w[1] * s[0];
}
"""
ACROSS_CHANGE = """/* x = dw x s + w x ds. */
static void across_change(const double *w, const double *dw, const double *s, const double *ds,
                          double *x) {
    x[0] = dw[1] * s[2] - dw[2] * s[1] + w[1] * ds[2] - w[2] * ds[1];
    x[1] = dw[2] * s[0] - dw[0] * s[2] + w[2] * ds[0] - w[0] * ds[2];
    x[2] = dw[0] * s[1] - dw[1] * s[0] + w[0] * ds[1] - w[1] * ds[0];
}
"""
LEVERS = """/* L = R (e_k x s) (3) of each axis k: what a speed about it does. */
static void levers(const double *R, const double *s, double *L) {
    for (int i = 0; i < 3; i++) {
        L[i] = R[3 * i + 2] * s[1] - R[3 * i + 1] * s[2];
        L[3 + i] = R[3 * i] * s[2] - R[3 * i + 2] * s[0];
        L[6 + i] = R[3 * i + 1] * s[0] - R[3 * i] * s[1];
    }
}
"""
FUNCTIONS = {
    "rotation": ROTATION,
    "rotation_change": ROTATION_CHANGE,
    "turned": TURNED,
    "turned_change": TURNED_CHANGE,
    "across": ACROSS,
    "across_change": ACROSS_CHANGE,
    "levers": LEVERS,
}


def calls(steps: Sequence[Step], printed: Callable[[Expr], str]) -> Iterator[str]:
    """Statements: the arrays, then what fills them."""
    for step in steps:
        if step.operation == VECTOR:
            numbers = ", ".join(map(printed, step.numbers))
            yield f"const double {step.name}[] = {{{numbers}}};"
    made = [step for step in steps if step.operation != VECTOR]
    if made:
        yield f"double {', '.join(f'{step.name}[{step.size}]' for step in made)};"
    for step in made:
        yield f"{step.operation}({', '.join((*step.arguments, step.name))});"
